//! Finishing jobs: after the report of a worker, or after its loss.

use super::outputs::JobOutputs;
use super::{JobScheduler, MAX_LOST_WORKERS};
use crate::jobs::{DesiredState, Job, JobError, Status};
use crate::store::{EventType, Level, NewEvent, StoreError};
use serde_json::json;

impl JobScheduler {
    /// Handles a worker that exited or stopped reporting without completion: cancels, pauses, requeues or
    /// fails the job. With `attempt`, only if it is still the current attempt.
    pub(super) async fn worker_lost(
        &self,
        id: &str,
        attempt: Option<u64>,
    ) -> Result<(), StoreError> {
        let update = |job: &mut Job, events: &mut Vec<NewEvent>| {
            let is_current = attempt.is_none_or(|attempt| attempt == job.attempt);
            if !is_current || !job.status.has_process() {
                return Err(());
            }
            match job.desired_state {
                DesiredState::Cancel => job.finish(Status::Cancelled, events),
                DesiredState::Pause => {
                    job.status = Status::Paused;
                    events.push(NewEvent::new(
                        EventType::Status,
                        "paused",
                        json!({ "status": job.status }),
                    ));
                }
                DesiredState::Run => {
                    job.consecutive_lost_workers += 1;
                    let message = "worker lost";
                    let data = json!({ "code": "worker_lost", "consecutive_lost_workers": job.consecutive_lost_workers });
                    events.push(NewEvent {
                        level: Level::Warn,
                        ..NewEvent::new(EventType::Alert, message, data)
                    });
                    if job.consecutive_lost_workers > MAX_LOST_WORKERS {
                        job.error = Some(JobError {
                            code: "worker_lost".into(),
                            message: format!(
                                "{} workers were lost in a row",
                                job.consecutive_lost_workers
                            ),
                            param: None,
                            hint: Some(
                                "check the job log and the free memory of the host; \
                                 a retry resumes from the last checkpoint"
                                    .into(),
                            ),
                        });
                        job.finish(Status::Failed, events);
                    } else {
                        job.status = Status::Queued;
                        let data = json!({ "status": job.status });
                        events.push(NewEvent::new(EventType::Status, "requeued", data));
                    }
                }
            }
            Ok(())
        };
        let updated = self.store.update(id, update).await?;
        self.release(updated);
        Ok(())
    }

    /// Records that a job has released its worker slot, and wakes the scheduler.
    pub(super) fn release(&self, updated: Option<Result<(Job, ()), ()>>) {
        if let Some(Ok((job, ()))) = updated {
            let (status, lost) = (job.status.name(), job.consecutive_lost_workers);
            match &job.error {
                Some(error) => {
                    tracing::warn!(
                        job = job.id,
                        status,
                        lost,
                        error = error.message,
                        "worker released"
                    );
                }
                None => tracing::info!(job = job.id, status, lost, "worker released"),
            }
            self.metrics.job_finished(&job);
        }
        self.wake.notify_one();
    }

    /// Finishes a job with its outputs or its error; cancels it if a cancellation was requested meanwhile.
    pub(super) async fn finish(
        &self,
        id: &str,
        attempt: u64,
        outcome: Result<JobOutputs, JobError>,
    ) -> Result<(), StoreError> {
        let update = |job: &mut Job, events: &mut Vec<NewEvent>| {
            if attempt != job.attempt || !job.status.has_process() {
                return Err(());
            }
            match outcome {
                _ if job.desired_state == DesiredState::Cancel => {
                    job.finish(Status::Cancelled, events)
                }
                Ok(collected) => {
                    job.outputs = collected.outputs;
                    events.extend(collected.events);
                    job.finish(Status::Succeeded, events);
                }
                Err(error) => {
                    job.error = Some(error);
                    job.finish(Status::Failed, events);
                }
            }
            Ok(())
        };
        let updated = self.store.update(id, update).await?;
        self.release(updated);
        Ok(())
    }
}
