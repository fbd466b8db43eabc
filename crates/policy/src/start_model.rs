//! Start configuration of an attempt: the joint positions where the policy starts.
//!
//! It is the nearest neighbour in the training data (paper §III-F), or the output of a network, which the paper
//! leaves for future work.

use crate::networks::mlp::{Activation, Mlp};
use crate::observation::Observation;
use crate::weights::{Tensors, WeightsError};
use robot::{DOF, Isometry, JointLimits, JointVector, KinematicTree, rotation};
use std::sync::Arc;

/// Maps an observation and a target palm pose above the object to a start configuration.
#[derive(Clone, Debug)]
pub enum StartModel {
    /// Start configurations of the training data, grouped by object pose.
    Table(Vec<StartConfiguration>),
    /// A network that was trained on such a table.
    Network(Box<StartNetwork>),
}

/// A network from [`inputs`] to q in the canonical frame. Outputs of -1 and 1 are the joint limits
/// ([`joint_ranges`]).
#[derive(Clone, Debug)]
pub struct StartNetwork {
    mlp: Mlp,
    limits: JointLimits,
}

/// A start configuration of the training data, in the canonical frame.
#[derive(Clone, Debug)]
pub struct StartConfiguration {
    /// Observation of the object pose ([`crate::Observation::latent`]).
    pub latent: Vec<f32>,
    /// Joint positions (rad).
    pub q: JointVector,
    /// Palm pose (m) at these joint positions.
    pub palm: Isometry,
    /// Name of the object, if the file stores the names.
    pub object: Option<Arc<str>>,
}

/// Metadata key of the object names in a table file. The value is JSON, in the order of the rows:
/// `[[name, number of starts], ...]`.
pub const OBJECTS_KEY: &str = "objects";

/// Prefix of the layers' tensor names in the file.
pub const TENSOR_PREFIX: &str = "start";
/// Widths of the hidden layers.
pub const HIDDEN_WIDTHS: [usize; 2] = [256, 256];
/// Activation between the layers.
pub const ACTIVATION: Activation = Activation::Elu;

/// Number of inputs of a palm pose: position, and two axes of its orientation.
const PALM_DIM: usize = 9;
/// Centre (m) and scale (m) of palm positions above objects.
const PALM_REGION_CENTER: [f64; 3] = [0.6, 0.0, 0.2];
const PALM_REGION_SCALE: f64 = 0.2;

/// Lever arm (m) that converts a rotation (rad) into a distance between palm poses.
const ROTATION_LEVER: f64 = 0.1;

/// Distance (rad) that a predicted start keeps from the joint limits.
const LIMIT_MARGIN: f64 = 0.02;
/// Tolerance (rad) of stored starts beyond the limits: that of the demonstrations, and rounding to half
/// precision.
const LIMIT_TOLERANCE: f64 = 0.03;

/// Layer widths of the network, for an observation of `observation_dim` values.
pub fn layer_widths(observation_dim: usize) -> Vec<usize> {
    [&[observation_dim + PALM_DIM][..], &HIDDEN_WIDTHS, &[DOF]].concat()
}

/// Network inputs: the observation, and the target palm pose in the canonical frame.
pub fn inputs(z: &[f32], palm: &Isometry) -> Vec<f32> {
    let rotation_matrix = palm.rotation.to_rotation_matrix();
    let position = palm
        .translation
        .vector
        .iter()
        .zip(PALM_REGION_CENTER)
        .map(|(x, center)| (x - center) / PALM_REGION_SCALE);
    let axes = rotation_matrix.matrix().columns(0, 2).iter().copied().collect::<Vec<f64>>();
    z.iter().copied().chain(position.chain(axes).map(|x| x as f32)).collect()
}

/// Centre and half width (rad) of the joint ranges; network outputs of -1 and 1 are the joint limits.
pub fn joint_ranges(limits: &JointLimits) -> [JointVector; 2] {
    [(limits.upper + limits.lower) * 0.5, (limits.upper - limits.lower) * 0.5]
}

/// Converts network outputs to joint positions (rad).
fn joints_from_output(limits: &JointLimits, outputs: &[f32]) -> JointVector {
    let [center, half] = joint_ranges(limits);
    JointVector::from_fn(|i, _| center[i] + half[i] * f64::from(outputs[i]))
}

impl StartModel {
    /// Loads the network, or else the table, for an observation of `observation_dim` values.
    pub fn load(
        bytes: &[u8],
        observation_dim: usize,
        tree: &KinematicTree,
    ) -> Result<Self, WeightsError> {
        let tensors = Tensors::parse(bytes)?;
        if tensors.shape("starts.q").is_err()
            && tensors.shape(&[TENSOR_PREFIX, ".0.bias"].concat()).is_ok()
        {
            let mlp =
                Mlp::load(&tensors, TENSOR_PREFIX, &layer_widths(observation_dim), ACTIVATION)?;
            let limits = tree.limits.clone();
            return Ok(Self::Network(Box::new(StartNetwork { mlp, limits })));
        }
        let count = tensors.shape("starts.q")?.first().copied().unwrap_or(0);
        let z = tensors.get("starts.z", &[count, observation_dim])?;
        let q = tensors.get("starts.q", &[count, DOF])?;
        let names = match tensors.metadata(OBJECTS_KEY) {
            Some(text) => parse_object_names(text, count)?,
            None => vec![None; count],
        };
        let rows = z.chunks_exact(observation_dim).zip(q.chunks_exact(DOF)).zip(names);
        let starts = rows.enumerate().map(|(row, ((z, q), object))| {
            let q = JointVector::from_fn(|i, _| f64::from(q[i]));
            if !tree.limits.contains(&q, -LIMIT_TOLERANCE) {
                return Err(WeightsError::StartBeyondLimits(row));
            }
            Ok(StartConfiguration {
                latent: z.to_vec(),
                q,
                palm: tree.forward_kinematics(&q).palm_pose(),
                object,
            })
        });
        Ok(Self::Table(starts.collect::<Result<_, _>>()?))
    }

    /// The object with the nearest z at any stored pose, and the distance in z. `None` for a network, and for
    /// a table without object names.
    pub fn nearest_training_object(&self, z: &[f32]) -> Option<(&str, f32)> {
        let Self::Table(starts) = self else { return None };
        let distance = |start: &StartConfiguration| squared_distance(&start.latent, z);
        let nearest = starts.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        Some((nearest.object.as_deref()?, libm::sqrt(distance(nearest)) as f32))
    }

    /// Start configuration (rad) for a target palm pose (base frame); `None` if the table is empty.
    ///
    /// In a table, the nearest z selects the object pose. Among the starts of that pose, the one with the
    /// palm nearest to `target` is selected (paper §III-F).
    pub fn find(&self, observation: &Observation, target: &Isometry) -> Option<JointVector> {
        self.find_candidates(observation, target, 1).pop()
    }

    /// Start configurations (rad) of the `count` object poses with the nearest z, nearest first, each with the palm
    /// nearest to a target pose (base frame). A network has one.
    pub fn find_candidates(
        &self,
        observation: &Observation,
        target: &Isometry,
        count: usize,
    ) -> Vec<JointVector> {
        let target = observation.pose_to_canonical(target);
        match self {
            Self::Table(starts) => nearest_starts(starts, &observation.latent, &target, count)
                .into_iter()
                .map(|start| observation.from_canonical(&start.q))
                .collect(),
            Self::Network(network) => vec![network.find(observation, &target)],
        }
    }
}

impl StartNetwork {
    fn find(&self, observation: &Observation, target: &Isometry) -> JointVector {
        let outputs = self.mlp.apply(&inputs(observation.features(), target));
        self.limits.clamp(
            &observation.from_canonical(&joints_from_output(&self.limits, &outputs)),
            LIMIT_MARGIN,
        )
    }
}

/// Among the starts with the nearest z, the one with the palm nearest to `target` (canonical frame).
pub fn nearest_start<'a>(
    starts: &'a [StartConfiguration],
    z: &[f32],
    target: &Isometry,
) -> Option<&'a StartConfiguration> {
    nearest_starts(starts, z, target, 1).pop()
}

/// For each of the `count` nearest values of z, nearest first: among the starts with this z, the one with the palm
/// nearest to `target` (canonical frame).
fn nearest_starts<'a>(
    starts: &'a [StartConfiguration],
    z: &[f32],
    target: &Isometry,
    count: usize,
) -> Vec<&'a StartConfiguration> {
    let distances: Vec<f64> =
        starts.iter().map(|start| squared_distance(&start.latent, z)).collect();
    let mut nearest = distances.clone();
    nearest.sort_by(f64::total_cmp);
    nearest.dedup();
    let of_pose = |wanted: &f64| {
        let same_pose = starts.iter().zip(&distances).filter(|(_, distance)| *distance == wanted);
        let palms = same_pose.map(|(start, _)| (palm_distance(&start.palm, target), start));
        Some(palms.min_by(|a, b| a.0.total_cmp(&b.0))?.1)
    };
    nearest.iter().take(count).filter_map(of_pose).collect()
}

/// Object name of each row; `wanted` is the number of rows.
fn parse_object_names(text: &str, wanted: usize) -> Result<Vec<Option<Arc<str>>>, WeightsError> {
    let malformed = |error: serde_json::Error| WeightsError::ObjectNames(error.to_string());
    let objects: Vec<(String, usize)> =
        serde_json::from_slice(text.as_bytes()).map_err(malformed)?;
    let found = objects.iter().fold(0, |sum: usize, (_, count)| sum.saturating_add(*count));
    if found != wanted {
        return Err(WeightsError::ObjectNames(format!(
            "the names cover {found} starts, but the file has {wanted}"
        )));
    }
    let rows = objects.into_iter().flat_map(|(name, count)| vec![Some(Arc::from(name)); count]);
    Ok(rows.collect())
}

fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a - b) * f64::from(a - b)).sum()
}

fn palm_distance(a: &Isometry, b: &Isometry) -> f64 {
    let moved = (a.translation.vector - b.translation.vector).norm();
    moved + ROTATION_LEVER * rotation::angle_between(&a.rotation, &b.rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::networks::mlp::Dense;

    fn tree() -> KinematicTree {
        KinematicTree::iiwa7_allegro().unwrap()
    }

    #[test]
    fn each_start_gets_the_object_name_of_the_metadata() {
        let found = parse_object_names(r#"[["mug", 2], ["box.1", 1]]"#, 3).unwrap();
        let found: Vec<&str> = found.iter().flatten().map(|name| &**name).collect();
        assert_eq!(found, ["mug", "mug", "box.1"]);
        for text in ["mug", r#"[["mug", 2]]"#, r#"[["mug", 18446744073709551615], ["a", 9]]"#] {
            let message = parse_object_names(text, 3).unwrap_err().to_string();
            assert!(
                message.starts_with("the object names of the start configurations are not valid"),
                "{message}"
            );
        }
    }

    #[test]
    fn start_network_predicts_in_canonical_frame_and_within_limits() {
        let tree = tree();
        let (observation_dim, limits) = (2, &tree.limits);
        let dense = |pair: &[usize], bias: f32| Dense {
            weight: vec![half::f16::ZERO; pair[0] * pair[1]],
            bias: vec![bias; pair[1]],
        };
        let widths = layer_widths(observation_dim);
        let network = |bias| {
            let layers = widths.windows(2).map(|pair| dense(pair, bias)).collect();
            let mlp = Mlp { layers, activation: ACTIVATION };
            StartModel::Network(Box::new(StartNetwork { mlp, limits: limits.clone() }))
        };
        let observation = Observation { azimuth: 0.4, latent: vec![0.1; observation_dim] };
        let start = network(0.5).find(&observation, &Isometry::identity()).unwrap();
        let wanted = observation.from_canonical(&joints_from_output(limits, &[0.5; DOF]));
        assert!((start - limits.clamp(&wanted, LIMIT_MARGIN)).amax() < 1e-6);
        assert!((joints_from_output(limits, &[1.0; DOF]) - limits.upper).amax() < 1e-9);
        assert!(
            limits.contains(&network(7.0).find(&observation, &Isometry::identity()).unwrap(), 0.0)
        );

        // A palm that rotates with the object about the robot has the same pose in the canonical frame.
        let palm = tree.forward_kinematics(&JointVector::repeat(0.2)).palm_pose();
        let turned = Observation { azimuth: observation.azimuth + 0.3, ..observation.clone() };
        let [a, b] = [(&observation, palm), (&turned, rotation::rotation_z(0.3) * palm)].map(
            |(observation, palm)| {
                inputs(&observation.latent, &observation.pose_to_canonical(&palm))
            },
        );
        assert_eq!(a.len(), widths[0]);
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
    }
}
