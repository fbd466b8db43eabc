//! How the process of a job is started. Nothing else knows.

use futures_util::future::BoxFuture;
use std::fmt;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use tokio::process::{Child, Command};

/// What is started.
#[derive(Clone, Debug)]
pub(crate) struct Order {
    /// Arguments of the program.
    pub(crate) arguments: Vec<String>,
    /// The same for people: each process of a job begins its part of the log with it.
    pub(crate) words: String,
    /// Folder in which it works.
    pub(crate) folder: PathBuf,
    /// File with what it needs to report, in the variable [`JOB_FILE`].
    pub(crate) job_file: PathBuf,
    /// File that takes what it prints.
    pub(crate) log: PathBuf,
}

/// Names the file that tells a process which job it works on, and to whom it reports.
pub const JOB_FILE: &str = "NGF_JOB";

/// Starts processes: on this machine, or whatever would take its place on a cluster.
pub(crate) trait Launcher: Send + Sync + fmt::Debug {
    /// Starts a process.
    fn start(&self, order: &Order) -> io::Result<Box<dyn Process>>;
}

/// A process that was started.
pub(crate) trait Process: Send {
    /// Waits for its end.
    fn ended(&mut self) -> BoxFuture<'_, ()>;

    /// Ends it at once.
    fn kill(&mut self) -> BoxFuture<'_, ()>;
}

/// Starts processes of a program on this machine.
#[derive(Clone, Debug)]
pub(crate) struct Local {
    program: PathBuf,
}

impl Local {
    /// Runs this program.
    pub(crate) fn new(program: &Path) -> Self {
        Self { program: program.to_owned() }
    }
}

impl Launcher for Local {
    fn start(&self, order: &Order) -> io::Result<Box<dyn Process>> {
        let mut log = File::options().create(true).read(true).append(true).open(&order.log)?;
        end_line(&mut log)?;
        writeln!(log, "$ {}", order.words)?;
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
        Ok(Box::new(command.spawn()?))
    }
}

/// Ends the line in which the process before was killed.
fn end_line(log: &mut File) -> io::Result<()> {
    let mut last = [b'\n'];
    if log.seek(SeekFrom::End(0))? > 0 {
        log.seek(SeekFrom::End(-1))?;
        log.read_exact(&mut last)?;
    }
    if last == [b'\n'] { Ok(()) } else { writeln!(log) }
}

impl Process for Child {
    fn ended(&mut self) -> BoxFuture<'_, ()> {
        Box::pin(async { drop(self.wait().await) })
    }

    fn kill(&mut self) -> BoxFuture<'_, ()> {
        Box::pin(async { drop(Child::kill(self).await) })
    }
}
