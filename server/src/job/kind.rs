//! Job kinds.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Kind of a job; selects the worker command and the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub(crate) enum Kind {
    /// Generates demonstrations and point clouds.
    #[serde(rename = "dataset.generate")]
    DatasetGenerate,
    /// Trains the autoencoder on the point clouds of a dataset.
    #[serde(rename = "encoder.train")]
    EncoderTrain,
    /// Trains a policy on the demonstrations of a dataset, with a trained encoder.
    #[serde(rename = "policy.train")]
    PolicyTrain,
    /// Evaluates a policy: grasp attempts by the protocol.
    #[serde(rename = "policy.evaluate")]
    PolicyEvaluate,
    /// Inspects a mesh and decomposes it into convex parts.
    #[serde(rename = "mesh.prepare")]
    MeshPrepare,
}

impl Kind {
    /// All kinds, in the order of the documentation.
    pub(crate) const ALL: [Self; 5] = [
        Self::DatasetGenerate,
        Self::EncoderTrain,
        Self::PolicyTrain,
        Self::PolicyEvaluate,
        Self::MeshPrepare,
    ];

    /// Name in JSON and in the database.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::DatasetGenerate => "dataset.generate",
            Self::EncoderTrain => "encoder.train",
            Self::PolicyTrain => "policy.train",
            Self::PolicyEvaluate => "policy.evaluate",
            Self::MeshPrepare => "mesh.prepare",
        }
    }

    /// Inverse of [`Kind::name`].
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}
