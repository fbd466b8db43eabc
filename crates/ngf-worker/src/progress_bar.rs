//! Progress bars with rate and remaining time.

use crate::job_client;
use indicatif::{ProgressBar, ProgressStyle};

/// Progress bar of one stage, also reported to the job server.
pub(crate) struct Bar {
    bar: ProgressBar,
    stage: String,
}

impl Bar {
    /// Creates a bar for `total` items.
    pub(crate) fn new(stage: &str, total: usize) -> Self {
        let style =
            ProgressStyle::with_template("{msg:28} {bar:32} {pos}/{len} {per_sec} {eta} left");
        let bar = ProgressBar::new(total as u64);
        let bar = bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(stage.to_owned());
        Self { bar, stage: stage.to_owned() }
    }

    /// Creates a bar for `total` items, of which `done` were finished earlier and do not count for the rate.
    pub(crate) fn resume_from(stage: &str, done: usize, total: usize) -> Self {
        let bar = Self::new(stage, total);
        bar.set(done);
        bar.bar.reset_eta();
        bar
    }

    /// Sets the number of finished items.
    pub(crate) fn set(&self, done: usize) {
        self.bar.set_position(done as u64);
        let total = self.bar.length().unwrap_or_default();
        job_client::progress(&self.stage, "items", done, total as usize);
    }

    /// Sets the number of finished items and the total.
    pub(crate) fn update(&self, done: usize, total: usize) {
        self.bar.set_length(total as u64);
        self.set(done);
    }

    /// Removes the bar from the terminal.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}
