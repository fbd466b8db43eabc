//! Kinds of jobs.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a job does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub(crate) enum Kind {
    /// Demonstrations and clouds.
    #[serde(rename = "dataset.generate")]
    DatasetGenerate,
    /// The autoencoder, on a dataset's clouds.
    #[serde(rename = "encoder.train")]
    EncoderTrain,
    /// A policy, on a dataset's demonstrations, with an encoder.
    #[serde(rename = "policy.train")]
    PolicyTrain,
    /// Attempts by the protocol, counted.
    #[serde(rename = "policy.evaluate")]
    PolicyEvaluate,
    /// What a mesh is, and its convex parts.
    #[serde(rename = "mesh.prepare")]
    MeshPrepare,
}

impl Kind {
    /// All of them.
    pub(crate) const ALL: [Self; 5] = [
        Self::DatasetGenerate,
        Self::EncoderTrain,
        Self::PolicyTrain,
        Self::PolicyEvaluate,
        Self::MeshPrepare,
    ];

    /// As in JSON.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::DatasetGenerate => "dataset.generate",
            Self::EncoderTrain => "encoder.train",
            Self::PolicyTrain => "policy.train",
            Self::PolicyEvaluate => "policy.evaluate",
            Self::MeshPrepare => "mesh.prepare",
        }
    }

    /// The kind of this name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}
