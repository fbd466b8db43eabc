//! Whether the database can be written, and recovery after a time when it could not be.

use super::{JobScheduler, MAX_LEASE};
use crate::quotas::has_database_space;
use crate::store::StoreError;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time for which a successful check is valid: each check writes to the disk.
const CHECK_INTERVAL: Duration = Duration::from_secs(1);

/// Maximum duration of a check. A disk that hangs is not ready.
const CHECK_TIMEOUT: Duration = Duration::from_secs(5);

/// Interval at which a persistent failure is logged again.
const LOG_INTERVAL: Duration = Duration::from_secs(60);

/// State of the database as observed by this process.
#[derive(Debug, Default)]
pub(super) struct Readiness {
    /// Time of the last successful check.
    last_success: tokio::sync::Mutex<Option<Instant>>,
    /// Whether a report of a worker could not be stored since the last scheduling round.
    report_failed: AtomicBool,
}

/// Logs a failure that recurs in every round, once per [`LOG_INTERVAL`].
#[derive(Debug, Default)]
pub(super) struct RecurringFailure {
    last: Option<(Instant, String)>,
}

impl RecurringFailure {
    /// Whether to log this failure: another one than before, or one that has lasted for the interval.
    fn is_due(&mut self, failure: &str, now: Instant) -> bool {
        let is_repeated = self.last.as_ref().is_some_and(|(logged, known)| {
            known == failure && now.duration_since(*logged) < LOG_INTERVAL
        });
        if !is_repeated {
            self.last = Some((now, failure.to_owned()));
        }
        !is_repeated
    }

    /// Logs the failure if it is due.
    pub(super) fn log(&mut self, action: &str, error: &StoreError) {
        let failure = format!("{action}: {error}");
        if self.is_due(&failure, Instant::now()) {
            tracing::warn!("{failure}");
        }
    }
}

impl JobScheduler {
    /// Whether the database can be written.
    pub(crate) async fn is_ready(&self) -> bool {
        if !has_database_space(self.data_dir()) {
            return false;
        }
        let mut last_success = self.readiness.last_success.lock().await;
        if last_success.is_some_and(|time| time.elapsed() < CHECK_INTERVAL) {
            return true;
        }
        let check = tokio::time::timeout(CHECK_TIMEOUT, self.store.check_writable()).await;
        let is_ready = matches!(check, Ok(Ok(())));
        if is_ready {
            *last_success = Some(Instant::now());
        }
        is_ready
    }

    /// Records that a report of a worker could not be stored.
    pub(super) fn report_failed(&self) {
        self.readiness.report_failed.store(true, Ordering::Relaxed);
    }

    /// After reports could not be stored, extends the leases: the workers are healthy and repeat their reports.
    /// Fails while the database cannot be written.
    pub(super) async fn recover_leases(&self) -> Result<(), StoreError> {
        if self.readiness.report_failed.load(Ordering::Relaxed) {
            self.extend_leases(MAX_LEASE).await?;
            self.readiness.report_failed.store(false, Ordering::Relaxed);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recurring_failure_is_logged_once_per_interval() {
        let (mut failure, start) = (RecurringFailure::default(), Instant::now());
        let mut is_due =
            |text: &str, second: u64| failure.is_due(text, start + Duration::from_secs(second));
        assert_eq!(
            [0, 1, 59, 60, 61].map(|second| is_due("full", second)),
            [true, false, false, true, false]
        );
        assert!(is_due("locked", 62) && is_due("full", 63));
    }
}
