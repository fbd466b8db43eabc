//! How the process of a job ends: it said that it was over, or it vanished.

use super::settle::Found;
use super::{Engine, MOST_LOST};
use crate::job::{Failure, Job, Status, Wish};
use crate::store::{Level, News, StoreError, Type};
use serde_json::json;

impl Engine {
    /// Settles a job whose process is gone without having said that it is over.
    pub(super) async fn vanished(&self, id: &str, attempt: Option<u64>) -> Result<(), StoreError> {
        let settle = |job: &mut Job, news: &mut Vec<News>| {
            let is_its = attempt.is_none_or(|attempt| attempt == job.attempt);
            if !is_its || !job.status.has_process() {
                return Err(());
            }
            match job.wish {
                Wish::Cancel => job.close(Status::Cancelled, news),
                Wish::Pause => {
                    job.status = Status::Paused;
                    news.push(News::new(Type::Status, "paused", json!({ "status": job.status })));
                }
                Wish::Run => {
                    job.lost += 1;
                    let message = "its process vanished";
                    let data = json!({ "code": "worker_lost", "lost": job.lost });
                    news.push(News { level: Level::Warn, ..News::new(Type::Alert, message, data) });
                    if job.lost > MOST_LOST {
                        job.error = Some(Failure {
                            code: "worker_lost".into(),
                            message: format!("{} processes in a row vanished", job.lost),
                            param: None,
                            hint: Some("look at its log, and at the memory of the machine; a retry goes on from the last checkpoint".into()),
                        });
                        job.close(Status::Failed, news);
                    } else {
                        job.status = Status::Queued;
                        let data = json!({ "status": job.status });
                        news.push(News::new(Type::Status, "queued again", data));
                    }
                }
            }
            Ok(())
        };
        let changed = self.store.change(id, settle).await?;
        self.settled(changed);
        Ok(())
    }

    /// Notes that the process of a job is gone.
    pub(super) fn settled(&self, changed: Option<Result<(Job, ()), ()>>) {
        if let Some(Ok((job, ()))) = changed {
            let (status, lost) = (job.status.name(), job.lost);
            match &job.error {
                Some(error) => {
                    tracing::warn!(job = job.id, status, lost, error = error.message, "ended");
                }
                None => tracing::info!(job = job.id, status, lost, "ended"),
            }
            self.metrics.ended(&job);
        }
        self.wake.notify_one();
    }

    /// Ends a job as its process says.
    pub(super) async fn end(
        &self,
        id: &str,
        attempt: u64,
        outcome: Result<Found, Failure>,
    ) -> Result<(), StoreError> {
        let settle = |job: &mut Job, news: &mut Vec<News>| {
            if attempt != job.attempt || !job.status.has_process() {
                return Err(());
            }
            match outcome {
                _ if job.wish == Wish::Cancel => job.close(Status::Cancelled, news),
                Ok(found) => {
                    job.outputs = found.outputs;
                    news.extend(found.news);
                    job.close(Status::Succeeded, news);
                }
                Err(failure) => {
                    job.error = Some(failure);
                    job.close(Status::Failed, news);
                }
            }
            Ok(())
        };
        let changed = self.store.change(id, settle).await?;
        self.settled(changed);
        Ok(())
    }
}
