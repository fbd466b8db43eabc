//! What a training says about itself: on the terminal, and in a file of JSON lines.

use crate::report;
use anyhow::{Context, Result};
use imitation::watcher::{Progress, Watcher};
use serde_json::{Value, json};
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The log of a training.
pub(super) struct Log {
    file: File,
    path: PathBuf,
    name: &'static str,
    /// What the loss is called, with its unit.
    loss: &'static str,
    /// States or clouds of a step.
    batch: usize,
    /// The first step that was reported, and when.
    first: Option<(u64, Instant)>,
}

impl Log {
    /// Goes on with `name.log.jsonl` in a folder.
    pub(super) fn open(
        out: &Path,
        name: &'static str,
        loss: &'static str,
        batch: usize,
    ) -> Result<Self> {
        std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
        let path = out.join(format!("{name}.log.jsonl"));
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let file = file.with_context(|| format!("cannot write {}", path.display()))?;
        Ok(Self { file, path, name, loss, batch, first: None })
    }

    /// How far it is, and how fast.
    fn report(&mut self, now: &Progress) -> Result<()> {
        let Progress { step, steps, loss, .. } = now;
        let (first, began) = *self.first.get_or_insert_with(|| (*step, Instant::now()));
        // There is none before the second report.
        let rate = (*step > first).then(|| (step - first) as f64 / began.elapsed().as_secs_f64());
        let left = rate.map(|rate| (steps - step) as f64 / rate);
        let pace = rate.zip(left).map_or(String::new(), |(rate, left)| {
            format!("  {rate:.1} steps/s  {:.0} min left", left / 60.0)
        });
        println!("{} {step}/{steps}  {} {loss:.5}{pace}", self.name, self.loss);
        report::progress("training", "steps", now.step as usize, now.steps as usize);
        self.write(&json!({
            "step": step, "loss": loss, "gradient_norm": now.gradient,
            "samples_per_s": rate.map(|rate| rate * self.batch as f64), "seconds_left": left,
        }))
    }

    /// Whether a step has a line with this member.
    pub(super) fn has(&self, member: &str, step: u64) -> Result<bool> {
        let text = std::fs::read_to_string(&self.path)?;
        let lines = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        Ok(lines.into_iter().any(|line| line["step"] == step && !line[member].is_null()))
    }

    /// What took so long was no training: the pace is told without it.
    pub(super) fn leave_out(&mut self, pause: Duration) {
        if let Some((_, began)) = &mut self.first {
            *began += pause;
        }
    }

    /// A line of its own.
    pub(super) fn write(&mut self, line: &Value) -> Result<()> {
        report::metric(&Value::Object(report::flattened(line)));
        Ok(writeln!(self.file, "{line}")?)
    }
}

impl Watcher for Log {
    fn progress(&mut self, now: &Progress) -> Result<bool> {
        self.report(now)?;
        Ok(true)
    }

    fn warn(&mut self, text: &str) {
        report::warn(text);
        eprintln!("warning: {text}");
    }
}
