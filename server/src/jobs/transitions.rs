//! Creation of jobs and transitions between statuses.

use super::{DesiredState, Inputs, Job, Outputs, Params, Status};
use crate::store::{EventType, Level, NewEvent};
use chrono::Utc;
use serde_json::{Map, json};
use std::collections::BTreeMap;

impl Job {
    /// Creates a queued job with a new id that sorts by time.
    pub(crate) fn new(params: Params, inputs: Inputs) -> Self {
        let now = Utc::now();
        Self {
            id: format!("job_{}", uuid::Uuid::now_v7().simple()),
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
            consecutive_lost_workers: 0,
            best_progress: BTreeMap::new(),
            last_report_seq: 0,
            desired_state: DesiredState::Run,
            revision: 0,
        }
    }

    /// Puts the job into the queue.
    pub(crate) fn enqueue(&mut self, events: &mut Vec<NewEvent>) {
        (self.status, self.desired_state) = (Status::Queued, DesiredState::Run);
        events.push(NewEvent::new(EventType::Status, "queued", json!({ "status": self.status })));
    }

    /// Moves the job to a terminal status.
    pub(crate) fn finish(&mut self, status: Status, events: &mut Vec<NewEvent>) {
        (self.status, self.finished_at) = (status, Some(Utc::now()));
        let level = if status == Status::Failed { Level::Error } else { Level::Info };
        let message = self.error.as_ref().map_or(status.name().to_owned(), |e| e.message.clone());
        let data = json!({ "status": status, "outputs": self.outputs, "error": self.error });
        events.push(NewEvent { level, ..NewEvent::new(EventType::Status, message, data) });
    }
}
