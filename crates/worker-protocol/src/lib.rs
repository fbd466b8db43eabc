//! Protocol between the job server and its workers: configuration, reports and replies.
//!
//! The server writes a [`WorkerConfig`] and starts a worker process. The worker sends a [`WorkerReport`] at
//! least every few seconds; the server answers each with a [`ReportReply`].
//!
//! ```rust
//! use worker_protocol::{Completion, WorkerReport};
//! // All members are optional; an empty report only renews the lease.
//! let report: WorkerReport = serde_json::from_str("{}")?;
//! assert!(report.phase.is_none() && report.events.is_empty());
//! let report: WorkerReport = serde_json::from_str(r#"{"seq": 3, "completion": "succeeded"}"#)?;
//! assert_eq!((report.seq, report.completion), (3, Some(Completion::Succeeded)));
//! # Ok::<(), serde_json::Error>(())
//! ```

mod progress;
mod report;
mod worker;

pub use progress::Progress;
pub use report::{
    Completion, Directive, MetricValues, ReportReply, WorkerEvent, WorkerReport, WrittenCheckpoint,
};
pub use worker::{WORKER_CONFIG_ENV, Worker, WorkerConfig};
