//! Bars that show how far long work is, its rate and the time left.

use crate::report;
use indicatif::{ProgressBar, ProgressStyle};

/// A bar for one stage; a server whose job this is sees it, too.
pub(crate) struct Bar {
    bar: ProgressBar,
    stage: String,
}

impl Bar {
    /// A bar of `total` things.
    pub(crate) fn new(stage: &str, total: usize) -> Self {
        let style =
            ProgressStyle::with_template("{msg:28} {bar:32} {pos}/{len} {per_sec} {eta} left");
        let bar = ProgressBar::new(total as u64);
        let bar = bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(stage.to_owned());
        Self { bar, stage: stage.to_owned() }
    }

    /// A bar of `total` things, of which `done` were there before: they do not count for the rate.
    pub(crate) fn begun(stage: &str, done: usize, total: usize) -> Self {
        let bar = Self::new(stage, total);
        bar.set(done);
        bar.bar.reset_eta();
        bar
    }

    /// So many are done.
    pub(crate) fn set(&self, done: usize) {
        self.bar.set_position(done as u64);
        let total = self.bar.length().unwrap_or_default();
        report::progress(&self.stage, "things", done, total as usize);
    }

    /// So many of as many as there now are.
    pub(crate) fn go(&self, done: usize, total: usize) {
        self.bar.set_length(total as u64);
        self.set(done);
    }

    /// Takes the bar off the screen.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}
