//! Alerts on problems that a job status does not show: a stalled job whose worker still reports, and a disk
//! that is nearly full.

use super::JobScheduler;
use crate::jobs::{Job, Status};
use crate::store::{EventType, Filter, Level, NewEvent, StoreError};
use serde_json::json;
use std::collections::HashMap;
use std::time::{Duration, Instant};

/// Interval of the checks.
const CHECK_INTERVAL: Duration = Duration::from_secs(15);

/// A job without progress for this long is reported as stalled.
const STALL_AFTER: Duration = Duration::from_secs(600);

/// Progress of a job: attempt, phase, and completed units.
type ProgressKey = (u64, Option<String>, Option<f64>);

/// Health of the running jobs.
#[derive(Debug, Default)]
pub(super) struct HealthMonitor {
    /// Time of the last check.
    last_check: Option<Instant>,
    /// Health by job id.
    jobs: HashMap<String, JobHealth>,
}

/// Health of one job.
#[derive(Debug)]
struct JobHealth {
    progress_key: ProgressKey,
    /// When this progress was first observed.
    since: Instant,
    /// Whether the stall at this progress was reported.
    stall_reported: bool,
    /// Whether low disk space was reported in this attempt.
    disk_reported: bool,
}

impl HealthMonitor {
    /// New alerts of a job, given the free disk space (bytes) and its minimum; each alert is returned once.
    fn alerts(
        &mut self,
        job: &Job,
        free: Option<u64>,
        min_free: u64,
        now: Instant,
    ) -> Vec<NewEvent> {
        let completed = job.progress.as_ref().map(|progress| progress.completed);
        let progress_key = (job.attempt, job.phase.clone(), completed);
        let new = |disk_reported| JobHealth {
            progress_key: progress_key.clone(),
            since: now,
            stall_reported: false,
            disk_reported,
        };
        let health = self.jobs.entry(job.id.clone()).or_insert_with(|| new(false));
        if health.progress_key != progress_key {
            let same_attempt = health.progress_key.0 == progress_key.0;
            *health = new(same_attempt && health.disk_reported);
        }
        let mut alerts = Vec::new();
        if !health.stall_reported && now - health.since >= STALL_AFTER {
            health.stall_reported = true;
            let minutes = STALL_AFTER.as_secs() / 60;
            let message = format!("no progress for {minutes} minutes; check the job log");
            alerts.push(alert(message, json!({ "code": "no_progress", "minutes": minutes })));
        }
        if let Some(free) = free.filter(|free| *free < min_free)
            && !health.disk_reported
        {
            health.disk_reported = true;
            let gigabytes = free as f64 / 1e9;
            let message = format!(
                "only {gigabytes:.1} GB of disk space free; delete datasets, models or jobs"
            );
            alerts.push(alert(message, json!({ "code": "disk_low", "free_bytes": free })));
        }
        alerts
    }
}

fn alert(message: String, data: serde_json::Value) -> NewEvent {
    NewEvent { level: Level::Warn, ..NewEvent::new(EventType::Alert, message, data) }
}

impl JobScheduler {
    /// Checks the running jobs, at most once per [`CHECK_INTERVAL`], and appends alerts to their events.
    pub(super) async fn check_health(&self, health: &mut HealthMonitor) -> Result<(), StoreError> {
        let now = Instant::now();
        if health.last_check.is_some_and(|last_check| now - last_check < CHECK_INTERVAL) {
            return Ok(());
        }
        health.last_check = Some(now);
        let filter = Filter { status: vec![Status::Running], limit: i64::MAX, ..Filter::default() };
        let running = self.store.jobs(&filter).await?;
        health.jobs.retain(|id, _| running.iter().any(|job| job.id == *id));
        let free = fs4::available_space(self.data_dir()).ok();
        for job in running {
            let alerts = health.alerts(&job, free, self.config.min_free_bytes, now);
            if alerts.is_empty() {
                continue;
            }
            // The job may have finished meanwhile.
            let append = |current: &mut Job, events: &mut Vec<NewEvent>| {
                if current.status != Status::Running || current.attempt != job.attempt {
                    return Err(());
                }
                events.extend(alerts);
                Ok(())
            };
            if let Err(error) = self.store.update(&job.id, append).await {
                tracing::warn!(job = job.id, %error, "cannot store an alert");
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::kinds::MeshParams;
    use crate::jobs::{Inputs, Params};
    use worker_protocol::Progress;

    /// A running job in its first attempt.
    fn job() -> Job {
        let params =
            Params::MeshPrepare(MeshParams { mesh_id: "msh_1".into(), ..MeshParams::default() });
        let mut job = Job::new(params, Inputs::default());
        (job.status, job.attempt) = (Status::Running, 1);
        job
    }

    fn at(completed: f64) -> Option<Progress> {
        let unit = "attempts".into();
        Some(Progress { completed, total: 100.0, unit, rate_per_second: None })
    }

    fn codes(alerts: &[NewEvent]) -> Vec<&str> {
        assert!(
            alerts.iter().all(|alert| alert.kind == EventType::Alert && alert.level == Level::Warn)
        );
        alerts.iter().map(|alert| alert.data["code"].as_str().unwrap()).collect()
    }

    #[test]
    fn stalled_job_is_reported_once_until_it_progresses() {
        let (mut health, mut job, start) = (HealthMonitor::default(), job(), Instant::now());
        let mut check = |job: &Job, minute: u64| {
            let now = start + Duration::from_secs(60 * minute);
            codes(&health.alerts(job, None, 0, now)).len()
        };
        job.progress = at(1.0);
        assert_eq!([0, 9, 10, 11, 30].map(|minute| check(&job, minute)), [0, 0, 1, 0, 0]);
        job.progress = at(2.0);
        assert_eq!([31, 40, 41, 42].map(|minute| check(&job, minute)), [0, 0, 1, 0]);
        // A new phase or a new worker restarts the timer.
        job.phase = Some("counting".into());
        assert_eq!([43, 52].map(|minute| check(&job, minute)), [0, 0]);
        job.attempt = 2;
        assert_eq!([53, 62, 63].map(|minute| check(&job, minute)), [0, 0, 1]);
    }

    #[test]
    fn low_disk_space_is_reported_once_per_attempt() {
        let (mut health, mut job, now) = (HealthMonitor::default(), job(), Instant::now());
        let mut check =
            |job: &Job, free| codes(&health.alerts(job, Some(free), 1000, now)).concat();
        assert_eq!([1000, 999, 500].map(|free| check(&job, free)), ["", "disk_low", ""]);
        job.progress = at(1.0);
        assert_eq!(check(&job, 10), "");
        job.attempt = 2;
        assert_eq!(check(&job, 10), "disk_low");
    }
}
