//! Progress of long work: one trait for imports, searches, generation and verification.
//!
//! Training has a trait of its own, `imitation::train::callback::TrainingCallback`, because its reports carry
//! losses and parameters.

/// Receives the progress of long work, and can stop it.
///
/// ```
/// use progress::Progress;
///
/// fn sum(items: &[u32], progress: &dyn Progress) -> Option<u32> {
///     let mut sum = 0;
///     for (i, item) in items.iter().enumerate() {
///         if progress.is_stopped() {
///             return None;
///         }
///         progress.update("sum", i, items.len());
///         sum += item;
///     }
///     Some(sum)
/// }
/// let print = |stage: &str, done: usize, total: usize| println!("{stage}: {done}/{total}");
/// assert_eq!(sum(&[1, 2, 3], &print), Some(6));
/// ```
pub trait Progress {
    /// Reports that `done` of `total` items of a stage are finished. `done` does not decrease within a stage.
    fn update(&self, stage: &str, done: usize, total: usize);

    /// Whether the work must stop at the next opportunity; it then returns an error.
    fn is_stopped(&self) -> bool {
        false
    }
}

impl<F: Fn(&str, usize, usize)> Progress for F {
    fn update(&self, stage: &str, done: usize, total: usize) {
        self(stage, done, total);
    }
}

/// Ignores all reports.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProgress;

impl Progress for NoProgress {
    fn update(&self, _: &str, _: usize, _: usize) {}
}
