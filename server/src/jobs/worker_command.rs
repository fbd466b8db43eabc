//! Commands of the worker executable that read a dataset: the server itself cannot read Parquet.

use super::scheduler::JobScheduler;
use std::ffi::OsStr;
use std::io;
use std::process::Stdio;
use std::time::Duration;
use tokio::process::Command;
use tokio::sync::Semaphore;
use worker_protocol::WORKER_CONFIG_ENV;

/// Limits concurrent commands, because each is a process.
static PERMITS: Semaphore = Semaphore::const_new(4);

/// Maximum duration of a command.
const TIMEOUT: Duration = Duration::from_secs(60);

/// Error of a command.
#[derive(Debug)]
pub(crate) enum CommandError {
    /// The command failed with this error message.
    Failed(String),
    /// The command cannot be started, or it does not end.
    Io(io::Error),
}

impl From<io::Error> for CommandError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl JobScheduler {
    /// Runs a command of the worker executable outside of any job, and returns its standard output. The
    /// process is killed if the future is dropped.
    pub(crate) async fn run_command<I, S>(&self, args: I) -> Result<Vec<u8>, CommandError>
    where
        I: IntoIterator<Item = S>,
        S: AsRef<OsStr>,
    {
        self.run_command_within(TIMEOUT, args).await
    }

    /// Runs a command that may take up to `limit`; see [`JobScheduler::run_command`].
    pub(crate) async fn run_command_within<I, S>(
        &self,
        limit: Duration,
        args: I,
    ) -> Result<Vec<u8>, CommandError>
    where
        I: IntoIterator<Item = S>,
        S: AsRef<OsStr>,
    {
        let _permit = PERMITS.acquire().await;
        let mut command = Command::new(self.program());
        command.args(args).env_remove(WORKER_CONFIG_ENV).stdin(Stdio::null()).kill_on_drop(true);
        let output = tokio::time::timeout(limit, command.output()).await;
        let output = output.map_err(|_| io::Error::from(io::ErrorKind::TimedOut))??;
        if output.status.success() {
            return Ok(output.stdout);
        }
        let stderr = String::from_utf8_lossy(&output.stderr);
        Err(match error_message(&stderr) {
            Some(message) => CommandError::Failed(message.to_owned()),
            // The process was killed, or it is not the worker executable.
            None => io::Error::other(format!("the worker command ended: {}", output.status)).into(),
        })
    }
}

/// The error message that a command has printed.
fn error_message(stderr: &str) -> Option<&str> {
    stderr.lines().find_map(|line| line.strip_prefix("error: "))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use crate::jobs::scheduler::SchedulerConfig;

    #[tokio::test]
    async fn command_returns_its_output_or_its_error_message() {
        let folder = tempfile::tempdir().unwrap();
        let open = async |program: &str| {
            let config = SchedulerConfig {
                data_dir: folder.path().join(program),
                models_dir: folder.path().join("models"),
                program: program.into(),
                waits_for_program: false,
                max_concurrent: 1,
                min_free_bytes: 0,
            };
            JobScheduler::open(config).await.unwrap()
        };
        let shell = open("sh").await;
        let run = async |script: &str| shell.run_command(["-c", script]).await;
        assert_eq!(run("echo '[1]'").await.unwrap(), b"[1]\n");
        let failed = run("echo 'warning: x' >&2; echo 'error: no episode 7' >&2; exit 2").await;
        assert!(matches!(failed, Err(CommandError::Failed(text)) if text == "no episode 7"));
        assert!(matches!(run("kill -9 $$").await, Err(CommandError::Io(_))));
        let missing = open("no-such-program").await;
        assert!(matches!(missing.run_command(["x"]).await, Err(CommandError::Io(_))));
    }
}
