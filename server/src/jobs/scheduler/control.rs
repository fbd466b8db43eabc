//! Client requests on jobs: cancel, pause, resume, retry.

use super::JobScheduler;
use crate::jobs::{DesiredState, Job, Status};
use crate::problem::Problem;
use crate::store::{EventType, NewEvent};
use serde_json::json;

impl JobScheduler {
    /// Cancels a job; idempotent.
    pub(crate) async fn cancel(&self, id: &str) -> Result<Job, Problem> {
        let mut is_finished = false;
        let job = self
            .request(id, |job, events| match job.status {
                Status::Queued | Status::Paused => {
                    job.finish(Status::Cancelled, events);
                    is_finished = true;
                    Ok(())
                }
                Status::Running => {
                    (job.status, job.desired_state) = (Status::Cancelling, DesiredState::Cancel);
                    events.push(NewEvent::new(
                        EventType::Status,
                        "cancelling",
                        json!({ "status": job.status }),
                    ));
                    Ok(())
                }
                Status::Cancelling | Status::Cancelled => Ok(()),
                Status::Succeeded | Status::Failed => Err(Problem::invalid_state(job, "cancelled")),
            })
            .await?;
        if is_finished {
            self.metrics.job_finished(&job);
        }
        Ok(job)
    }

    /// Pauses a queued or running job; idempotent.
    pub(crate) async fn pause(&self, id: &str) -> Result<Job, Problem> {
        self.request(id, |job, events| match job.status {
            Status::Queued => {
                job.status = Status::Paused;
                events.push(NewEvent::new(
                    EventType::Status,
                    "paused",
                    json!({ "status": job.status }),
                ));
                Ok(())
            }
            Status::Running => {
                job.desired_state = DesiredState::Pause;
                Ok(())
            }
            Status::Paused => Ok(()),
            _ => Err(Problem::invalid_state(job, "paused")),
        })
        .await
    }

    /// Resumes a paused job; idempotent.
    pub(crate) async fn resume(&self, id: &str) -> Result<Job, Problem> {
        self.request(id, |job, events| match job.status {
            Status::Paused => {
                job.enqueue(events);
                Ok(())
            }
            Status::Queued => Ok(()),
            // Already resumed; with a pending pause request, resuming is rejected.
            Status::Running if job.desired_state == DesiredState::Run => Ok(()),
            _ => Err(Problem::invalid_state(job, "resumed")),
        })
        .await
    }

    /// Retries a failed or cancelled job from its stored progress; idempotent.
    pub(crate) async fn retry(&self, id: &str) -> Result<Job, Problem> {
        self.request(id, |job, events| match job.status {
            Status::Failed | Status::Cancelled => {
                (job.error, job.finished_at, job.consecutive_lost_workers) = (None, None, 0);
                job.enqueue(events);
                Ok(())
            }
            // Already retried.
            Status::Queued | Status::Running => Ok(()),
            _ => Err(Problem::invalid_state(job, "retried")),
        })
        .await
    }

    /// Updates a job, and kills its worker if the desired state requires it.
    async fn request(
        &self,
        id: &str,
        update: impl FnOnce(&mut Job, &mut Vec<NewEvent>) -> Result<(), Problem>,
    ) -> Result<Job, Problem> {
        let updated = self.store.update(id, update).await?;
        let (job, ()) = updated.ok_or_else(|| Problem::job_not_found(id))??;
        if job.status.has_process() && job.desired_state != DesiredState::Run {
            // The task that awaits the worker releases the job. A worker of a former server process receives
            // `Stop` in the reply to its next report.
            self.kill_switches().remove(id).map(|(_, kill)| kill.send(()));
        }
        self.wake.notify_one();
        Ok(job)
    }

    /// Wakes the scheduler after a job was queued.
    pub(crate) fn wake(&self) {
        self.wake.notify_one();
    }
}
