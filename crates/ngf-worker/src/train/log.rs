//! Log of a training, on the terminal and as a JSON Lines file.

use crate::job_client;
use anyhow::{Context, Result};
use imitation::train::callback::{TrainingCallback, TrainingStatus};
use serde_json::{Value, json};
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Log of a training.
pub(super) struct TrainingLog {
    file: File,
    path: PathBuf,
    name: &'static str,
    /// Name and unit of the loss.
    loss: &'static str,
    /// States or clouds per step.
    batch: usize,
    /// First reported step and its time.
    first_report: Option<(u64, Instant)>,
}

impl TrainingLog {
    /// Opens `name.log.jsonl` in a folder and appends to it.
    pub(super) fn open(
        out: &Path,
        name: &'static str,
        loss: &'static str,
        batch: usize,
    ) -> Result<Self> {
        std::fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
        let path = out.join(format!("{name}.log.jsonl"));
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let file = file.with_context(|| format!("cannot write {}", path.display()))?;
        Ok(Self { file, path, name, loss, batch, first_report: None })
    }

    /// Reports progress, rate and remaining time.
    fn log_status(&mut self, now: &TrainingStatus) -> Result<()> {
        let TrainingStatus { step, steps, loss, .. } = now;
        let (first, start) = *self.first_report.get_or_insert_with(|| (*step, Instant::now()));
        // The rate is undefined before the second report.
        let rate = (*step > first).then(|| (step - first) as f64 / start.elapsed().as_secs_f64());
        let left = rate.map(|rate| (steps - step) as f64 / rate);
        let pace = rate.zip(left).map_or(String::new(), |(rate, left)| {
            format!("  {rate:.1} steps/s  {:.0} min left", left / 60.0)
        });
        println!("{} {step}/{steps}  {} {loss:.5}{pace}", self.name, self.loss);
        job_client::progress("training", "steps", now.step as usize, now.steps as usize);
        self.write(&json!({
            "step": step, "loss": loss, "gradient_norm": now.gradient_norm,
            "samples_per_s": rate.map(|rate| rate * self.batch as f64), "seconds_left": left,
        }))
    }

    /// Whether the log has a line of this step with this member.
    pub(super) fn has(&self, member: &str, step: u64) -> Result<bool> {
        let text = std::fs::read_to_string(&self.path)?;
        let lines = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        Ok(lines.into_iter().any(|line| line["step"] == step && !line[member].is_null()))
    }

    /// Excludes a pause from the training rate.
    pub(super) fn exclude_time(&mut self, pause: Duration) {
        if let Some((_, start)) = &mut self.first_report {
            *start += pause;
        }
    }

    /// Appends a line, and sends its numbers as metrics.
    pub(super) fn write(&mut self, line: &Value) -> Result<()> {
        job_client::metric(&Value::Object(job_client::flatten_metrics(line)));
        Ok(writeln!(self.file, "{line}")?)
    }
}

impl TrainingCallback for TrainingLog {
    fn on_progress(&mut self, now: &TrainingStatus) -> Result<bool> {
        self.log_status(now)?;
        Ok(true)
    }

    fn on_warning(&mut self, text: &str) {
        job_client::warn(text);
        eprintln!("warning: {text}");
    }
}
