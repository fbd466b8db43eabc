//! Bars that show how far long work is, its rate and the time left.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar for one stage.
pub(crate) struct Bar(ProgressBar);

impl Bar {
    /// A bar of `total` things.
    pub(crate) fn new(stage: &str, total: usize) -> Self {
        let style =
            ProgressStyle::with_template("{msg:28} {bar:32} {pos}/{len} {per_sec} {eta} left");
        let bar = ProgressBar::new(total as u64);
        let bar = bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(stage.to_owned());
        Self(bar)
    }

    /// A bar of `total` things, of which `done` were there before: they do not count for the rate.
    pub(crate) fn begun(stage: &str, done: usize, total: usize) -> Self {
        let bar = Self::new(stage, total);
        bar.set(done);
        bar.0.reset_eta();
        bar
    }

    /// So many are done.
    pub(crate) fn set(&self, done: usize) {
        self.0.set_position(done as u64);
    }

    /// So many of as many as there now are.
    pub(crate) fn go(&self, done: usize, total: usize) {
        self.0.set_length(total as u64);
        self.set(done);
    }

    /// Takes the bar off the screen.
    pub(crate) fn clear(&self) {
        self.0.finish_and_clear();
    }
}
