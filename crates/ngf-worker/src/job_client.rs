//! Job client: sends reports to the server if this process is the worker of a job.
//!
//! A thread sends pending reports, or a heartbeat, four times per second. It ends the process when the server
//! requests a stop; all files on disk are complete at any time.

use anyhow::{Context, Result};
use serde_json::{Map, Value};
use std::fs::File;
use std::path::Path;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};
use worker_protocol::{
    Completion, Directive, MetricValues, Progress, ReportReply, WORKER_CONFIG_ENV, Worker,
    WorkerConfig, WorkerEvent, WorkerReport, WrittenCheckpoint,
};

/// Interval between reports.
const REPORT_INTERVAL: Duration = Duration::from_millis(250);

/// Minimum interval between progress updates.
const PROGRESS_INTERVAL: Duration = Duration::from_secs(1);

/// Time without a reply after which the worker exits.
const SERVER_TIMEOUT: Duration = Duration::from_secs(60);

/// Status of a reply of a server whose disk is full.
const INSUFFICIENT_STORAGE: u16 = 507;

/// Interval between reports to a server whose disk is full.
const FULL_DISK_INTERVAL: Duration = Duration::from_secs(1);

/// Maximum number of events buffered while the server does not respond.
const MAX_BUFFERED_EVENTS: usize = 10_000;

/// Exit status of a worker that was stopped and can be restarted (EX_TEMPFAIL).
const EXIT_STOPPED: i32 = 75;

static JOB_CLIENT: OnceLock<JobClient> = OnceLock::new();

struct JobClient {
    config: WorkerConfig,
    pending: Mutex<Pending>,
    /// Serializes reports, because a later report must not overtake an earlier one.
    sending: Mutex<()>,
    agent: ureq::Agent,
    /// Locked until the process ends.
    _lock: File,
}

#[derive(Default)]
struct Pending {
    report: WorkerReport,
    phase: Option<Phase>,
    last_progress: Option<Instant>,
    seq: u64,
}

/// Current phase of the work.
struct Phase {
    name: String,
    unit: &'static str,
    started: Instant,
    first: usize,
    done: usize,
    total: usize,
}

/// Whether this process is the worker of a job.
pub(crate) fn is_job() -> bool {
    std::env::var_os(WORKER_CONFIG_ENV).is_some()
}

/// Starts reporting if this process is the worker of a job. Waits until an earlier worker has released the
/// job folder.
pub(crate) fn start() -> Result<()> {
    let Some(path) = std::env::var_os(WORKER_CONFIG_ENV) else { return Ok(()) };
    let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let file: WorkerConfig = serde_json::from_slice(&bytes)
        .with_context(|| format!("{} is not a valid worker configuration", path.display()))?;
    let lock = File::create(&file.lock_file)
        .with_context(|| format!("cannot write {}", file.lock_file.display()))?;
    let config = ureq::Agent::config_builder()
        .timeout_global(Some(Duration::from_secs(30)))
        .http_status_as_error(false)
        // Proxy settings of the environment must not apply to the server address.
        .proxy(None);
    let worker = Worker {
        host: host_name(),
        pid: std::process::id(),
        version: env!("CARGO_PKG_VERSION").into(),
        threads: std::thread::available_parallelism().map_or(1, usize::from),
    };
    let report = WorkerReport { worker: Some(worker), ..WorkerReport::default() };
    let reporter = JOB_CLIENT.get_or_init(|| JobClient {
        config: file,
        pending: Mutex::new(Pending { report, ..Pending::default() }),
        sending: Mutex::new(()),
        agent: config.build().into(),
        _lock: lock,
    });
    std::thread::spawn(|| reporter.run());
    reporter._lock.lock().context("cannot lock the folder of the job")
}

/// Host name of this machine. Shells do not export HOSTNAME.
fn host_name() -> String {
    #[cfg(unix)]
    let name = rustix::system::uname().nodename().to_string_lossy().into_owned();
    #[cfg(not(unix))]
    let name = std::env::var("COMPUTERNAME").unwrap_or_default();
    if name.is_empty() { "localhost".into() } else { name }
}

/// Sets the progress of a phase: `done` of `total` items.
pub(crate) fn progress(phase: &str, unit: &'static str, done: usize, total: usize) {
    let Some(reporter) = JOB_CLIENT.get() else { return };
    let mut pending = reporter.pending();
    match &mut pending.phase {
        Some(known) if known.name == phase => (known.done, known.total) = (done, total),
        other => {
            let name = phase.to_owned();
            *other = Some(Phase { name, unit, started: Instant::now(), first: done, done, total });
        }
    }
}

/// Sends a log line.
pub(crate) fn log(text: &str) {
    push_event(|| WorkerEvent::Log(text.to_owned()));
}

/// Sends a warning that does not end the work.
pub(crate) fn warn(text: &str) {
    push_event(|| WorkerEvent::Warning(text.to_owned()));
}

/// Sends metrics of a step; `values` contains the member `step`.
pub(crate) fn metric(values: &Value) {
    push_event(|| {
        WorkerEvent::Metric(MetricValues(values.as_object().cloned().unwrap_or_default()))
    });
}

/// Publishes a model checkpoint after `step` steps. `write` receives a folder inside `out`; the server moves
/// it away. Does nothing without a job server.
pub(crate) fn checkpoint(
    out: &Path,
    step: u64,
    write: impl FnOnce(&Path) -> Result<()>,
) -> Result<()> {
    if JOB_CLIENT.get().is_none() {
        return Ok(());
    }
    let folder = out.join(format!("step-{step}"));
    // The folder is renamed when complete. A worker that was killed and restarted repeats these steps and
    // finds it.
    if !folder.exists() {
        let partial = out.join(format!(".step-{step}"));
        std::fs::create_dir_all(&partial)
            .with_context(|| format!("cannot create {}", partial.display()))?;
        write(&partial)?;
        std::fs::rename(&partial, &folder)
            .with_context(|| format!("cannot rename {}", partial.display()))?;
    }
    push_event(|| WorkerEvent::Checkpoint(WrittenCheckpoint { step }));
    Ok(())
}

fn push_event(event: impl FnOnce() -> WorkerEvent) {
    let Some(reporter) = JOB_CLIENT.get() else { return };
    let events = &mut reporter.pending().report.events;
    if events.len() < MAX_BUFFERED_EVENTS {
        events.push(event());
    }
}

/// Reports that the work is finished, with its result. Returns after the server has received all reports or
/// is unreachable.
pub(crate) fn finish(result: &Result<()>) {
    let Some(reporter) = JOB_CLIENT.get() else { return };
    reporter.pending().report.completion = Some(match result {
        Ok(()) => Completion::Succeeded,
        Err(error) => Completion::Failed(format!("{error:#}")),
    });
    reporter.send_until_acked();
}

impl JobClient {
    fn pending(&self) -> std::sync::MutexGuard<'_, Pending> {
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn run(&self) {
        loop {
            self.send_until_acked();
            std::thread::sleep(REPORT_INTERVAL);
        }
    }

    /// Sends the pending report until the server acknowledges it. Ends the process if the server requests a
    /// stop or does not respond.
    fn send_until_acked(&self) {
        let _guard = self.sending.lock().unwrap_or_else(PoisonError::into_inner);
        let report = self.pending().drain();
        let mut start = Instant::now();
        loop {
            match self.send(&report) {
                Ok(Some(Directive::Continue)) => return,
                // The process ends in any case.
                Ok(_) if report.completion.is_some() => return,
                Ok(_) => std::process::exit(EXIT_STOPPED),
                // The server runs and will store the report once its disk has space.
                Err(ureq::Error::StatusCode(INSUFFICIENT_STORAGE)) => {
                    start = Instant::now();
                    std::thread::sleep(FULL_DISK_INTERVAL);
                }
                Err(error) if start.elapsed() > SERVER_TIMEOUT => {
                    eprintln!("error: the job server does not respond: {error}");
                    std::process::exit(EXIT_STOPPED);
                }
                Err(_) => std::thread::sleep(REPORT_INTERVAL),
            }
        }
    }

    /// Sends a report and returns the directive of the server; `None` if the server rejects it.
    fn send(&self, report: &WorkerReport) -> Result<Option<Directive>, ureq::Error> {
        let token = format!("Bearer {}", self.config.token);
        let mut reply = self
            .agent
            .post(&self.config.reports_url)
            .header("Authorization", token)
            .send_json(report)?;
        let status = reply.status();
        if status.is_server_error() {
            return Err(ureq::Error::StatusCode(status.as_u16()));
        }
        if !status.is_success() {
            return Ok(None);
        }
        Ok(Some(reply.body_mut().read_json::<ReportReply>()?.directive))
    }
}

impl Pending {
    /// Takes the pending report, with progress if it is due.
    fn drain(&mut self) -> WorkerReport {
        let is_over = self.report.completion.is_some();
        let is_due =
            is_over || self.last_progress.is_none_or(|told| told.elapsed() >= PROGRESS_INTERVAL);
        if let Some(phase) = self.phase.as_ref().filter(|_| is_due) {
            self.last_progress = Some(Instant::now());
            self.report.phase = Some(phase.name.clone());
            let seconds = phase.started.elapsed().as_secs_f64();
            let count = phase.done.saturating_sub(phase.first);
            self.report.progress = Some(Progress {
                completed: phase.done as f64,
                total: phase.total as f64,
                unit: phase.unit.to_owned(),
                rate_per_second: (count > 0).then(|| count as f64 / seconds),
            });
        }
        self.seq += 1;
        WorkerReport { seq: self.seq, ..std::mem::take(&mut self.report) }
    }
}

/// Flattens the numbers of a JSON object into columns; nested names are joined by slashes.
pub(crate) fn flatten_metrics(value: &Value) -> Map<String, Value> {
    let mut columns = Map::new();
    for (name, value) in value.as_object().into_iter().flatten() {
        match value {
            Value::Object(_) => {
                let nested = flatten_metrics(value).into_iter();
                columns.extend(nested.map(|(rest, value)| (format!("{name}/{rest}"), value)));
            }
            Value::Number(_) => {
                columns.insert(name.clone(), value.clone());
            }
            _ => {}
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    #[cfg(target_os = "linux")]
    fn host_name_is_that_of_the_kernel() {
        let kernel = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
        assert_eq!(host_name(), kernel.trim());
    }

    #[test]
    fn nested_numbers_become_columns() {
        let found = flatten_metrics(
            &json!({ "step": 3, "validation": { "lifted": 5, "fingertips": { "p90": 0.1 } }, "x": "y" }),
        );
        let expected =
            json!({ "step": 3, "validation/lifted": 5, "validation/fingertips/p90": 0.1 });
        assert_eq!(Value::Object(found), expected);
    }
}
