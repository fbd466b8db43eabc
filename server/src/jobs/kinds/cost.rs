//! Cost of a job.

/// Run time and disk space of a job by reference measurements on two cores (2026).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cost {
    /// Run time (s).
    pub(crate) seconds: f64,
    /// Disk space (bytes).
    pub(crate) bytes: f64,
}
