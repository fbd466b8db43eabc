//! Applying worker reports to jobs.

use super::{JobScheduler, LEASE, MAX_LEASE, deadline_ms};
use crate::jobs::{DesiredState, Job, JobError};
use crate::problem::Problem;
use crate::store::{EventType, Level, NewEvent};
use serde_json::json;
use worker_protocol::{
    Completion, Directive, MetricValues, Progress, ReportReply, WorkerEvent, WorkerReport,
};

impl JobScheduler {
    /// Applies a report of the worker of a job, and returns the instruction to the worker. After an error of the
    /// server, the worker repeats the report.
    pub(crate) async fn apply_report(
        &self,
        id: &str,
        token: &str,
        report: WorkerReport,
    ) -> Result<ReportReply, Problem> {
        let reply = self.try_apply_report(id, token, report).await;
        if reply.as_ref().is_err_and(|problem| problem.status.is_server_error()) {
            self.report_failed();
        }
        reply
    }

    async fn try_apply_report(
        &self,
        id: &str,
        token: &str,
        report: WorkerReport,
    ) -> Result<ReportReply, Problem> {
        let hash = blake3::hash(token.as_bytes());
        // Storing outputs or checkpoints takes longer than the lease, and the worker sends no reports
        // meanwhile.
        let is_checkpoint = |event: &WorkerEvent| matches!(event, WorkerEvent::Checkpoint(_));
        let has_checkpoints = report.events.iter().any(is_checkpoint);
        let needs_long_lease = report.completion.is_some() || has_checkpoints;
        let until = deadline_ms(if needs_long_lease { MAX_LEASE } else { LEASE });
        if !self.store.renew_lease(id, hash.as_bytes(), until).await? {
            return Err(Problem::stale_worker());
        }
        let (completion, seq) = (report.completion.clone(), report.seq);
        let mut added = None;
        let apply = |job: &mut Job, events: &mut Vec<NewEvent>| {
            if !job.status.has_process() {
                return Err(Problem::stale_worker());
            }
            // Skips a repeated report.
            if seq == 0 || seq > job.last_report_seq {
                added = apply_events(job, report, events);
            }
            Ok::<_, Problem>(job.desired_state)
        };
        let updated = self.store.update(id, apply).await?;
        let (job, desired) = updated.ok_or_else(|| Problem::job_not_found(id))??;
        if let Some((unit, amount)) = added {
            self.metrics.add_progress(job.kind(), &unit, amount);
        }
        if has_checkpoints {
            self.store_checkpoints(&job).await?;
        }
        if let Some(completion) = completion {
            self.apply_completion(&job, completion).await?;
        }
        if desired != DesiredState::Run {
            // The worker exits on this reply. No task awaits a worker that a former server process started,
            // so the job is released here.
            self.worker_lost(id, Some(job.attempt)).await?;
            return Ok(ReportReply { directive: Directive::Stop });
        }
        if has_checkpoints {
            self.store.renew_lease(id, hash.as_bytes(), deadline_ms(LEASE)).await?;
        }
        Ok(ReportReply { directive: Directive::Continue })
    }

    /// Finishes a job whose worker has reported its completion.
    async fn apply_completion(&self, job: &Job, completion: Completion) -> Result<(), Problem> {
        let outcome = match completion {
            Completion::Succeeded => match self.collect_outputs(job).await {
                Ok(outputs) => Ok(outputs),
                // The outputs are complete; the worker reports them again until they can be stored.
                Err(error) if error.is_disk_full() => return Err(error.into()),
                Err(error) => Err(JobError {
                    code: "invalid_output".into(),
                    message: error.to_string(),
                    param: None,
                    hint: Some("check the job log".into()),
                }),
            },
            Completion::Failed(message) => {
                let hint = Some("check the job log; a retry resumes from stored progress".into());
                Err(JobError { code: "job_failed".into(), message, param: None, hint })
            }
        };
        self.finish(&job.id, job.attempt, outcome).await?;
        Ok(())
    }

    /// Whether a token belongs to the current worker of a job.
    pub(crate) async fn is_current_token(&self, id: &str, token: &str) -> Result<bool, Problem> {
        Ok(self.store.is_current_token(id, blake3::hash(token.as_bytes()).as_bytes()).await?)
    }
}

/// Applies a report to its job and appends its events. Returns the unit and the amount of new progress.
fn apply_events(
    job: &mut Job,
    report: WorkerReport,
    events: &mut Vec<NewEvent>,
) -> Option<(String, f64)> {
    job.last_report_seq = report.seq;
    if report.worker.is_some() {
        job.worker = report.worker;
    }
    let is_new_phase = report.phase.is_some() && report.phase != job.phase;
    if is_new_phase {
        job.phase = report.phase;
    }
    let added = report.progress.and_then(|now| apply_progress(job, now, is_new_phase, events));
    events.extend(report.events.into_iter().filter_map(|event| match event {
        WorkerEvent::Log(text) => Some(NewEvent::new(EventType::Log, text, json!({}))),
        WorkerEvent::Warning(text) => {
            Some(NewEvent { level: Level::Warn, ..NewEvent::new(EventType::Log, text, json!({})) })
        }
        WorkerEvent::Metric(MetricValues(values)) => {
            let data = json!(values);
            job.latest_metrics.extend(values);
            Some(NewEvent::new(EventType::Metric, "", data))
        }
        WorkerEvent::Checkpoint(_) => None,
    }));
    added
}

/// Applies reported progress; a new phase restarts at zero. Returns the unit and the amount of new progress.
fn apply_progress(
    job: &mut Job,
    now: Progress,
    is_new_phase: bool,
    events: &mut Vec<NewEvent>,
) -> Option<(String, f64)> {
    if !is_new_phase && job.progress.as_ref() == Some(&now) {
        return None;
    }
    let phase = job.phase.clone().unwrap_or_default();
    let best = job.best_progress.entry(phase.clone()).or_default();
    if now.completed > *best {
        (*best, job.consecutive_lost_workers) = (now.completed, 0);
    }
    let before = job.progress.as_ref().filter(|_| !is_new_phase);
    let amount = now.completed - before.map_or(0.0, |before| before.completed);
    let unit = now.unit.clone();
    job.progress = Some(now);
    let data = json!({ "phase": job.phase, "progress": job.progress });
    events.push(NewEvent::new(EventType::Progress, phase, data));
    Some((unit, amount))
}
