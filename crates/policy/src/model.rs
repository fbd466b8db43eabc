//! A model as it is shipped: encoder, policy, start configurations, configuration.

use crate::encoder::{Decoder, Encoder, LATENT};
use crate::ngf::{Ngf, NgfConfig};
use crate::weights::{Tensors, WeightsError};
use robot::{DOF, Isometry, JointVector, Tree, rotation};

/// The configuration that lies beside the weights.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct ModelConfig {
    /// Sizes, seed and length scales of the policy.
    pub ngf: NgfConfig,
}

/// A start configuration of the training data (paper §III-F).
#[derive(Clone, Debug)]
pub struct Start {
    /// z of the object pose that it belongs to.
    pub z: Vec<f32>,
    /// Joint positions (rad).
    pub q: JointVector,
    /// Pose of the palm there.
    pub palm: Isometry,
}

/// Everything that an attempt needs.
#[derive(Clone, Debug)]
pub struct Model {
    /// Point cloud -> z.
    pub encoder: Encoder,
    /// z -> point cloud.
    pub decoder: Decoder,
    /// (q, q̇, z) -> q̈.
    pub ngf: Ngf,
    /// Start configurations; those of one object pose stand together.
    pub starts: Vec<Start>,
}

/// Metres that a radian counts for when palm poses are compared.
const LEVER: f64 = 0.1;

impl Model {
    /// Builds a model from the bytes of its three files.
    pub fn load(
        weights: &[u8],
        starts: &[u8],
        config: &[u8],
        tree: &Tree,
    ) -> Result<Self, WeightsError> {
        let config: ModelConfig = serde_json::from_slice(config)?;
        let tensors = Tensors::parse(weights)?;
        Ok(Self {
            encoder: Encoder::load(&tensors)?,
            decoder: Decoder::load(&tensors)?,
            ngf: Ngf::load(&tensors, &config.ngf, &tree.limits)?,
            starts: load_starts(starts, tree)?,
        })
    }

    /// The start of the paper's §III-F: the nearest encoding first, then, among the starts of that
    /// object pose, the one whose palm is nearest to `target`.
    pub fn start(&self, z: &[f32], target: &Isometry) -> Option<&Start> {
        let nearest =
            self.starts.iter().map(|start| squared_distance(&start.z, z)).min_by(f64::total_cmp)?;
        self.starts.iter().filter(|start| squared_distance(&start.z, z) == nearest).min_by(
            |a, b| palm_distance(&a.palm, target).total_cmp(&palm_distance(&b.palm, target)),
        )
    }
}

fn load_starts(bytes: &[u8], tree: &Tree) -> Result<Vec<Start>, WeightsError> {
    let tensors = Tensors::parse(bytes)?;
    let count = tensors.shape("starts.q")?.first().copied().unwrap_or(0);
    let z = tensors.get("starts.z", &[count, LATENT])?;
    let q = tensors.get("starts.q", &[count, DOF])?;
    let start = |(z, q): (&[f32], &[f32])| {
        let q = JointVector::from_fn(|i, _| q[i] as f64);
        Start { z: z.to_vec(), q, palm: tree.kinematics(&q).palm() }
    };
    Ok(z.chunks_exact(LATENT).zip(q.chunks_exact(DOF)).map(start).collect())
}

fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| ((a - b) as f64) * ((a - b) as f64)).sum()
}

fn palm_distance(a: &Isometry, b: &Isometry) -> f64 {
    let moved = (a.translation.vector - b.translation.vector).norm();
    moved + LEVER * rotation::angle_between(&a.rotation, &b.rotation)
}
