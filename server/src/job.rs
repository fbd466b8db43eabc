//! A job: parameters, state, progress, inputs and outputs.

mod json;
mod kind;
mod params;
mod record;
mod status;
mod transitions;

pub(crate) use json::JobView;
pub(crate) use kind::Kind;
pub(crate) use params::{
    DatasetParams, EncoderParams, EvaluationParams, MeshParams, ObjectParams, Params, PolicyParams,
    TrainingParams,
};
pub(crate) use record::{Inputs, Job, JobError, Outputs};
pub use record::{Progress, Worker};
pub(crate) use status::{DesiredState, Status};
