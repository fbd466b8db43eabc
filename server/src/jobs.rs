//! Jobs: their kinds, their stored records and statuses, and the scheduler that runs them.

mod json;
pub(crate) mod kinds;
mod record;
pub mod scheduler;
mod status;
mod transitions;
mod worker_command;

pub(crate) use json::JobView;
pub(crate) use kinds::{Kind, Params};
pub(crate) use record::{Inputs, Job, JobError, Outputs};
pub(crate) use status::{DesiredState, Status};
pub(crate) use worker_command::CommandError;
