//! Protocol between the job server and its workers: configuration, reports and replies.
//!
//! The server writes a [`WorkerConfig`] and starts a worker process. The worker sends a [`WorkerReport`] at
//! least every few seconds; the server answers each with a [`ReportReply`].

mod progress;
mod report;
mod worker;

pub use progress::Progress;
pub use report::{Completion, Directive, ReportReply, WorkerEvent, WorkerReport};
pub use worker::{WORKER_CONFIG_ENV, Worker, WorkerConfig};
