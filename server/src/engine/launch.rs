//! How the process of a job is started. Nothing else knows.

use std::io;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use tokio::process::{Child, Command};

/// What is started.
#[derive(Clone, Debug)]
pub(crate) struct Order {
    /// Arguments of the program.
    pub(crate) arguments: Vec<String>,
    /// Folder in which it works.
    pub(crate) folder: PathBuf,
    /// File with what it needs to report, in the variable [`JOB_FILE`].
    pub(crate) job_file: PathBuf,
    /// File that takes what it prints.
    pub(crate) log: PathBuf,
}

/// Names the file that tells a process which job it works on, and to whom it reports.
pub const JOB_FILE: &str = "NGF_JOB";

/// Starts processes on this machine; a scheduler of a cluster would take its place.
#[derive(Clone, Debug)]
pub(crate) struct Local {
    program: PathBuf,
}

/// A process that was started.
#[derive(Debug)]
pub(crate) struct Process(Child);

impl Local {
    /// Runs this program.
    pub(crate) fn new(program: &Path) -> Self {
        Self { program: program.to_owned() }
    }

    /// Starts a process.
    pub(crate) fn start(&self, order: &Order) -> io::Result<Process> {
        let log = std::fs::OpenOptions::new().create(true).append(true).open(&order.log)?;
        let mut command = Command::new(&self.program);
        command
            .args(&order.arguments)
            .current_dir(&order.folder)
            .env(JOB_FILE, &order.job_file)
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log);
        // Ctrl-C at the server's terminal is for the server.
        #[cfg(unix)]
        command.process_group(0);
        command.spawn().map(Process)
    }
}

impl Process {
    /// Waits for its end; `true` if it ended of itself.
    pub(crate) async fn ended(&mut self) -> bool {
        self.0.wait().await.is_ok_and(|status| status.code().is_some())
    }

    /// Ends it at once.
    pub(crate) async fn kill(&mut self) {
        self.0.kill().await.ok();
    }
}
