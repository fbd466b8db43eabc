//! Launching worker processes; the only module that depends on the operating system.

use futures_util::future::BoxFuture;
use std::fmt;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use tokio::process::{Child, Command};
use worker_protocol::WORKER_CONFIG_ENV;

/// Worker process to launch.
#[derive(Clone, Debug)]
pub(crate) struct LaunchSpec {
    /// Arguments of the worker executable.
    pub(crate) argv: Vec<String>,
    /// The command as a shell line; written to the log before the output of the worker.
    pub(crate) display: String,
    /// Working directory.
    pub(crate) working_dir: PathBuf,
    /// Worker configuration; its path is passed in the variable [`WORKER_CONFIG_ENV`].
    pub(crate) worker_config: PathBuf,
    /// File that receives stdout and stderr.
    pub(crate) log_file: PathBuf,
}

/// Launches worker processes: on this machine, or on a cluster by another implementation.
pub(crate) trait Launcher: Send + Sync + fmt::Debug {
    /// Launches a worker.
    fn launch(&self, spec: &LaunchSpec) -> io::Result<Box<dyn Process>>;
}

/// Handle of a running worker.
pub(crate) trait Process: Send {
    /// Waits until the process exits.
    fn wait(&mut self) -> BoxFuture<'_, ()>;

    /// Kills the process and waits until it exits.
    fn kill(&mut self) -> BoxFuture<'_, ()>;
}

/// Launches workers on this machine.
#[derive(Clone, Debug)]
pub(crate) struct LocalLauncher {
    executable: PathBuf,
}

impl LocalLauncher {
    /// Launcher of this executable.
    pub(crate) fn new(program: &Path) -> Self {
        Self { executable: program.to_owned() }
    }
}

impl Launcher for LocalLauncher {
    fn launch(&self, spec: &LaunchSpec) -> io::Result<Box<dyn Process>> {
        let mut log = File::options().create(true).read(true).append(true).open(&spec.log_file)?;
        complete_last_line(&mut log)?;
        writeln!(log, "$ {}", spec.display)?;
        let mut command = Command::new(&self.executable);
        command
            .args(&spec.argv)
            .current_dir(&spec.working_dir)
            .env(WORKER_CONFIG_ENV, &spec.worker_config)
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log);
        // Ctrl-C in the terminal of the server must not reach the workers.
        #[cfg(unix)]
        command.process_group(0);
        Ok(Box::new(command.spawn()?))
    }
}

/// Completes the last line of the log, which a killed worker may have left unfinished.
fn complete_last_line(log: &mut File) -> io::Result<()> {
    let mut last = [b'\n'];
    if log.seek(SeekFrom::End(0))? > 0 {
        log.seek(SeekFrom::End(-1))?;
        log.read_exact(&mut last)?;
    }
    if last == [b'\n'] { Ok(()) } else { writeln!(log) }
}

impl Process for Child {
    fn wait(&mut self) -> BoxFuture<'_, ()> {
        Box::pin(async { drop(Child::wait(self).await) })
    }

    fn kill(&mut self) -> BoxFuture<'_, ()> {
        Box::pin(async { drop(Child::kill(self).await) })
    }
}
