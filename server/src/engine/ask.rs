//! Asking for something to be done to a job, and for what it works on.

use super::Engine;
use crate::job::{Inputs, Job, Params, Status, Wish};
use crate::problem::Problem;
use crate::store::{News, RecordKind, Type};
use serde_json::json;

impl Engine {
    /// Asks that a job is cancelled; harmless if it is.
    pub(crate) async fn cancel(&self, id: &str) -> Result<Job, Problem> {
        let mut is_over = false;
        let job = self
            .ask(id, |job, news| match job.status {
                Status::Queued | Status::Paused => {
                    job.close(Status::Cancelled, news);
                    is_over = true;
                    Ok(())
                }
                Status::Running => {
                    (job.status, job.wish) = (Status::Cancelling, Wish::Cancel);
                    news.push(News::new(
                        Type::Status,
                        "cancelling",
                        json!({ "status": job.status }),
                    ));
                    Ok(())
                }
                Status::Cancelling | Status::Cancelled => Ok(()),
                Status::Succeeded | Status::Failed => Err(Problem::invalid_state(job, "cancelled")),
            })
            .await?;
        if is_over {
            self.metrics.ended(&job);
        }
        Ok(job)
    }

    /// Asks that a job is paused.
    pub(crate) async fn pause(&self, id: &str) -> Result<Job, Problem> {
        self.ask(id, |job, news| match job.status {
            Status::Queued => {
                job.status = Status::Paused;
                news.push(News::new(Type::Status, "paused", json!({ "status": job.status })));
                Ok(())
            }
            Status::Running => {
                job.wish = Wish::Pause;
                Ok(())
            }
            Status::Paused => Ok(()),
            _ => Err(Problem::invalid_state(job, "paused")),
        })
        .await
    }

    /// Asks that a paused job goes on.
    pub(crate) async fn resume(&self, id: &str) -> Result<Job, Problem> {
        self.ask(id, |job, news| match job.status {
            Status::Paused => {
                job.queue(news);
                Ok(())
            }
            Status::Queued => Ok(()),
            // It was asked to pause a moment ago.
            Status::Running if job.wish == Wish::Run => Ok(()),
            _ => Err(Problem::invalid_state(job, "resumed")),
        })
        .await
    }

    /// Asks that a job that failed or was cancelled is tried again, from where it was.
    pub(crate) async fn retry(&self, id: &str) -> Result<Job, Problem> {
        self.ask(id, |job, news| match job.status {
            Status::Failed | Status::Cancelled => {
                (job.error, job.finished_at, job.lost) = (None, None, 0);
                job.queue(news);
                Ok(())
            }
            // It was asked for a moment ago.
            Status::Queued | Status::Running => Ok(()),
            _ => Err(Problem::invalid_state(job, "tried again")),
        })
        .await
    }

    /// Changes a job, and ends its process if that is wished.
    async fn ask(
        &self,
        id: &str,
        change: impl FnOnce(&mut Job, &mut Vec<News>) -> Result<(), Problem>,
    ) -> Result<Job, Problem> {
        let changed = self.store.change(id, change).await?;
        let (job, ()) = changed.ok_or_else(|| Problem::no_job(id))??;
        if job.status.has_process() && job.wish != Wish::Run {
            // Its guardian settles the rest; one that was not started here is told when it reports.
            self.kills().remove(id).map(|(_, kill)| kill.send(()));
        }
        self.wake.notify_one();
        Ok(job)
    }

    /// Says that something waits.
    pub(crate) fn wake(&self) {
        self.wake.notify_one();
    }

    /// What a job works on, if it is there.
    pub(crate) async fn inputs(&self, params: &Params) -> Result<Inputs, Problem> {
        let mut inputs = Inputs::default();
        match params {
            Params::Dataset(params) => inputs.mesh_id.clone_from(&params.subject.mesh_id),
            Params::Mesh(params) => inputs.mesh_id = Some(params.mesh_id.clone()),
            Params::Encoder(params) => inputs.dataset_id = Some(params.dataset_id.clone()),
            Params::Policy(params) => {
                inputs.dataset_id = Some(params.dataset_id.clone());
                inputs.encoder_id = Some(params.encoder_id.clone());
            }
            Params::Evaluation(params) => {
                inputs.mesh_id.clone_from(&params.subject.mesh_id);
                if params.model_id != "planner" {
                    inputs.model_id = Some(params.model_id.clone());
                }
            }
        }
        if let Some(id) = &inputs.mesh_id
            && self.store.record(RecordKind::Mesh, id).await?.is_none()
        {
            return Err(Problem::missing_input("mesh_id", id));
        }
        if let Some(id) = &inputs.dataset_id
            && self.store.record(RecordKind::Dataset, id).await?.is_none()
        {
            return Err(Problem::missing_input("dataset_id", id));
        }
        for (param, id) in [("encoder_id", &inputs.encoder_id), ("model_id", &inputs.model_id)] {
            if let Some(id) = id
                && !self.has_model(id).await?
            {
                return Err(Problem::missing_input(param, id));
            }
        }
        if let Some(id) = &inputs.model_id
            && let Some(record) = self.store.record(RecordKind::Model, id).await?
            && record["kind"] == "encoder"
        {
            return Err(Problem::encoder_alone(id));
        }
        Ok(inputs)
    }
}
