//! Reports to the server whose job this process does, if it does one.
//!
//! A thread sends what has come up four times a second, or only that the process is there, and ends the process when it
//! is told so: whatever is on disk is whole.

use anyhow::{Context, Result};
use serde_json::{Map, Value};
use server::engine::{Answer, Command, Ended, JOB_FILE, JobFile, Note, Progress, Report, Worker};
use std::fs::File;
use std::path::Path;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Time between two reports.
const PACE: Duration = Duration::from_millis(250);

/// Progress is told at most so often.
const PROGRESS_PACE: Duration = Duration::from_secs(1);

/// A server that does not answer for so long is given up.
const PATIENCE: Duration = Duration::from_secs(60);

/// Notes that are kept while the server does not answer.
const MOST_NOTES: usize = 10_000;

/// Tells whoever looks that it was ended on the way and can be begun again (EX_TEMPFAIL).
const STOPPED: i32 = 75;

static REPORTER: OnceLock<Reporter> = OnceLock::new();

struct Reporter {
    file: JobFile,
    pending: Mutex<Pending>,
    /// Of two reports at a time one would overtake the other.
    sending: Mutex<()>,
    agent: ureq::Agent,
    /// Open as long as the process is at work.
    _lock: File,
}

#[derive(Default)]
struct Pending {
    report: Report,
    phase: Option<Phase>,
    told: Option<Instant>,
    number: u64,
}

/// What the process is at.
struct Phase {
    name: String,
    unit: &'static str,
    began: Instant,
    first: usize,
    done: usize,
    total: usize,
}

/// Whether this process does a job.
pub(crate) fn is_asked() -> bool {
    std::env::var_os(JOB_FILE).is_some()
}

/// Begins to report, where this process does a job; waits for one that is still at work in its folder.
pub(crate) fn begin() -> Result<()> {
    let Some(path) = std::env::var_os(JOB_FILE) else { return Ok(()) };
    let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let file: JobFile = serde_json::from_slice(&bytes)
        .with_context(|| format!("{} is not what a server writes", path.display()))?;
    let lock = File::create(&file.lock)
        .with_context(|| format!("cannot write {}", file.lock.display()))?;
    let config = ureq::Agent::config_builder()
        .timeout_global(Some(Duration::from_secs(30)))
        .http_status_as_error(false)
        // The server is reached as it said, whatever the rest of the world is reached through.
        .proxy(None);
    let worker = Worker {
        host: std::env::var("HOSTNAME").unwrap_or_else(|_| "localhost".into()),
        pid: std::process::id(),
        version: env!("CARGO_PKG_VERSION").into(),
        threads: std::thread::available_parallelism().map_or(1, usize::from),
    };
    let report = Report { worker: Some(worker), ..Report::default() };
    let reporter = REPORTER.get_or_init(|| Reporter {
        file,
        pending: Mutex::new(Pending { report, ..Pending::default() }),
        sending: Mutex::new(()),
        agent: config.build().into(),
        _lock: lock,
    });
    std::thread::spawn(|| reporter.run());
    reporter._lock.lock().context("cannot lock the folder of the job")
}

/// So many things of a stage are done.
pub(crate) fn progress(phase: &str, unit: &'static str, done: usize, total: usize) {
    let Some(reporter) = REPORTER.get() else { return };
    let mut pending = reporter.pending();
    match &mut pending.phase {
        Some(known) if known.name == phase => (known.done, known.total) = (done, total),
        other => {
            let name = phase.to_owned();
            *other = Some(Phase { name, unit, began: Instant::now(), first: done, done, total });
        }
    }
}

/// Something that people want to read.
pub(crate) fn say(text: &str) {
    note(|| Note::Log(text.to_owned()));
}

/// Something that went wrong and does not end the work.
pub(crate) fn warn(text: &str) {
    note(|| Note::Warning(text.to_owned()));
}

/// Numbers at a step; `values` has a `step`.
pub(crate) fn metric(values: &Value) {
    note(|| Note::Metric(values.as_object().cloned().unwrap_or_default()));
}

/// A model that can be used is there after `step` steps: `write` is given a folder for it beside the results. Nothing is
/// written where no server waits for it, which takes the folder away.
pub(crate) fn checkpoint(
    out: &Path,
    step: u64,
    write: impl FnOnce(&Path) -> Result<()>,
) -> Result<()> {
    if REPORTER.get().is_none() {
        return Ok(());
    }
    let folder = out.join(format!("step-{step}"));
    // It is there as a whole or not at all; a process that was killed after these steps takes them again.
    if !folder.exists() {
        let begun = out.join(format!(".step-{step}"));
        std::fs::create_dir_all(&begun)
            .with_context(|| format!("cannot make {}", begun.display()))?;
        write(&begun)?;
        std::fs::rename(&begun, &folder)
            .with_context(|| format!("cannot rename {}", begun.display()))?;
    }
    note(|| Note::Checkpoint { step });
    Ok(())
}

fn note(note: impl FnOnce() -> Note) {
    let Some(reporter) = REPORTER.get() else { return };
    let notes = &mut reporter.pending().report.notes;
    if notes.len() < MOST_NOTES {
        notes.push(note());
    }
}

/// Says that the work is over, and how; what is said before that has arrived, too, or the server is gone.
pub(crate) fn end(result: &Result<()>) {
    let Some(reporter) = REPORTER.get() else { return };
    reporter.pending().report.ended = Some(match result {
        Ok(()) => Ended::Done,
        Err(error) => Ended::Failed(format!("{error:#}")),
    });
    reporter.insist();
}

impl Reporter {
    fn pending(&self) -> std::sync::MutexGuard<'_, Pending> {
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn run(&self) {
        loop {
            self.insist();
            std::thread::sleep(PACE);
        }
    }

    /// Sends what is there, and again until it has arrived; ends the process if it is told so, or if nobody answers.
    fn insist(&self) {
        let _alone = self.sending.lock().unwrap_or_else(PoisonError::into_inner);
        let report = self.pending().take();
        let began = Instant::now();
        loop {
            match self.send(&report) {
                Ok(Some(Command::Go)) => return,
                // It ends in any case.
                Ok(_) if report.ended.is_some() => return,
                Ok(_) => std::process::exit(STOPPED),
                Err(error) if began.elapsed() > PATIENCE => {
                    eprintln!("error: the server does not answer: {error}");
                    std::process::exit(STOPPED);
                }
                Err(_) => std::thread::sleep(PACE),
            }
        }
    }

    /// What the server answers; nothing if it refuses.
    fn send(&self, report: &Report) -> Result<Option<Command>, ureq::Error> {
        let token = format!("Bearer {}", self.file.token);
        let mut answer =
            self.agent.post(&self.file.url).header("Authorization", token).send_json(report)?;
        let status = answer.status();
        if status.is_server_error() {
            return Err(ureq::Error::StatusCode(status.as_u16()));
        }
        if !status.is_success() {
            return Ok(None);
        }
        Ok(Some(answer.body_mut().read_json::<Answer>()?.command))
    }
}

impl Pending {
    /// What is to be said now.
    fn take(&mut self) -> Report {
        let is_over = self.report.ended.is_some();
        let is_due = is_over || self.told.is_none_or(|told| told.elapsed() >= PROGRESS_PACE);
        if let Some(phase) = self.phase.as_ref().filter(|_| is_due) {
            self.told = Some(Instant::now());
            self.report.phase = Some(phase.name.clone());
            let seconds = phase.began.elapsed().as_secs_f64();
            let made = phase.done.saturating_sub(phase.first);
            self.report.progress = Some(Progress {
                completed: phase.done as f64,
                total: phase.total as f64,
                unit: phase.unit.to_owned(),
                rate_per_second: (made > 0).then(|| made as f64 / seconds),
            });
        }
        self.number += 1;
        Report { number: self.number, ..std::mem::take(&mut self.report) }
    }
}

/// Numbers of an object, those of objects in it with their names joined by a slash: columns of a table.
pub(crate) fn flattened(value: &Value) -> Map<String, Value> {
    let mut columns = Map::new();
    for (name, value) in value.as_object().into_iter().flatten() {
        match value {
            Value::Object(_) => {
                let inner = flattened(value).into_iter();
                columns.extend(inner.map(|(rest, value)| (format!("{name}/{rest}"), value)));
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
    fn numbers_become_columns() {
        let found = flattened(
            &json!({ "step": 3, "exam": { "lifted": 5, "tips": { "p90": 0.1 } }, "x": "y" }),
        );
        let expected = json!({ "step": 3, "exam/lifted": 5, "exam/tips/p90": 0.1 });
        assert_eq!(Value::Object(found), expected);
    }
}
