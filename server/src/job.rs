//! A job: what is asked for, how far it is, what came of it.

mod kind;
mod life;
mod params;
mod record;
mod status;
mod view;

pub(crate) use kind::Kind;
pub(crate) use params::{
    Course, DatasetParams, EncoderParams, EvaluationParams, MeshParams, Params, PolicyParams,
    Subject,
};
pub(crate) use record::{Failure, Inputs, Job, Outputs};
pub use record::{Progress, Worker};
pub(crate) use status::{Status, Wish};
pub(crate) use view::JobView;
