//! The beginning and the turns of a job's life.

use super::{Inputs, Job, Kind, Outputs, Params, Status, Wish};
use crate::store::{Level, News, Type};
use chrono::Utc;
use serde_json::{Map, json};
use std::collections::BTreeMap;

impl Job {
    /// A job that waits.
    pub(crate) fn new(kind: Kind, params: Params, inputs: Inputs) -> Self {
        let now = Utc::now();
        Self {
            id: format!("job_{}", uuid::Uuid::now_v7().simple()),
            kind,
            status: Status::Queued,
            phase: None,
            progress: None,
            created_at: now,
            started_at: None,
            finished_at: None,
            updated_at: now,
            params,
            name: None,
            metadata: Map::new(),
            priority: 0,
            inputs,
            outputs: Outputs::default(),
            latest_metrics: Map::new(),
            checkpoint_count: 0,
            checkpoint_step: 0,
            error: None,
            worker: None,
            attempt: 0,
            lost: 0,
            furthest: BTreeMap::new(),
            heard: 0,
            wish: Wish::Run,
            revision: 0,
        }
    }

    /// Waits for its turn.
    pub(crate) fn queue(&mut self, news: &mut Vec<News>) {
        (self.status, self.wish) = (Status::Queued, Wish::Run);
        news.push(News::new(Type::Status, "queued", json!({ "status": self.status })));
    }

    /// Ends in a terminal state.
    pub(crate) fn close(&mut self, status: Status, news: &mut Vec<News>) {
        (self.status, self.finished_at) = (status, Some(Utc::now()));
        let level = if status == Status::Failed { Level::Error } else { Level::Info };
        let message = self.error.as_ref().map_or(status.name().to_owned(), |e| e.message.clone());
        let data = json!({ "status": status, "outputs": self.outputs, "error": self.error });
        news.push(News { level, ..News::new(Type::Status, message, data) });
    }
}
