//! What the page and its worker say to each other. The same in TypeScript: web/src/demo/protocol.ts.
//!
//! Metres, radians, kilograms, seconds; z is up; quaternions are x, y, z, w.

mod from_page;
mod to_page;

pub(crate) use from_page::ToWorker;
pub(crate) use to_page::{
    Amount, Attempted, BuiltIn, Cloud, DepthCamera, Failure, File, Found, Frame, FromWorker, Joint,
    Link, Model, ObjectLoaded, Phase, Played, Progress, Ready, Rectangle, Report, Shape, Table,
    Verdict,
};

use serde::{Deserialize, Serialize};

/// Where somebody pulls at the object (its frame), and where to.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(crate) struct Pull {
    pub(crate) point: [f32; 3],
    pub(crate) towards: [f32; 3],
}

/// Where an object stands on the table.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub(crate) struct PlanarPose {
    pub(crate) x: f32,
    pub(crate) y: f32,
    pub(crate) yaw: f32,
}
