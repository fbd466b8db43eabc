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

/// A unit of length that a file may be drawn in.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub(crate) enum Unit {
    #[serde(rename = "m")]
    Metre,
    #[serde(rename = "cm")]
    Centimetre,
    #[serde(rename = "mm")]
    Millimetre,
    #[serde(rename = "in")]
    Inch,
}

/// How an object stands.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) enum Stands {
    AsInFile,
    /// On one of the sides that hold it, the steadiest being 0.
    On(usize),
}

/// Where an object stands on the table.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub(crate) struct PlanarPose {
    pub(crate) x: f32,
    pub(crate) y: f32,
    pub(crate) yaw: f32,
}
