//! Where an attempt begins: the start of the training data that is looked up (paper §III-F), or what a network says, as
//! the paper leaves it for future work.

use crate::encoding::Encoding;
use crate::mlp::{Activation, Mlp};
use crate::weights::{Tensors, WeightsError};
use robot::{DOF, Isometry, JointVector, Limits, Tree, rotation};
use std::sync::Arc;

/// Start configurations by object and wanted pose of the palm.
#[derive(Clone, Debug)]
pub enum Starts {
    /// Those of the training data; those of one object pose stand together.
    Table(Vec<Start>),
    /// What a network has learned of such a table.
    Network(Box<StartNetwork>),
}

/// [`inputs`] -> q in front of the robot, in halves of the joints' [`ranges`].
#[derive(Clone, Debug)]
pub struct StartNetwork {
    mlp: Mlp,
    limits: Limits,
}

/// A start configuration of the training data, with the object in front.
#[derive(Clone, Debug)]
pub struct Start {
    /// What a policy is told of the object pose that it belongs to.
    pub z: Vec<f32>,
    /// Joint positions (rad).
    pub q: JointVector,
    /// Pose of the palm there.
    pub palm: Isometry,
    /// Name of the object, where the file tells it.
    pub object: Option<Arc<str>>,
}

/// Name of the note in the file of a table that tells the objects: `[[name, number of starts], ...]` as JSON, in the order
/// of the starts.
pub const OBJECTS: &str = "objects";

/// Name of the network's layers.
pub const NAME: &str = "start";
/// Widths of its hidden layers.
pub const HIDDEN: [usize; 2] = [256, 256];
/// What stands between them.
pub const ACTIVATION: Activation = Activation::Elu;

/// Numbers that tell of a palm: place, and two of its axes.
const PALM: usize = 9;
/// Middle (m) and scale (m) of places above objects.
const ABOVE: [f64; 3] = [0.6, 0.0, 0.2];
const SCALE: f64 = 0.2;

/// Metres that a radian counts for when palm poses are compared.
const LEVER: f64 = 0.1;

/// Margin (rad) that a start of the network keeps from the joint limits.
const MARGIN: f64 = 0.02;
/// How far (rad) a start may be beyond a limit: as far as a demonstration, and what a file of half precision rounds.
const BEYOND: f64 = 0.03;

/// Widths of the network's layers; `object` numbers tell of the object.
pub fn widths(object: usize) -> Vec<usize> {
    [&[object + PALM][..], &HIDDEN, &[DOF]].concat()
}

/// What the network is told: the object, and the wanted palm with the object in front.
pub fn inputs(z: &[f32], palm: &Isometry) -> Vec<f32> {
    let turn = palm.rotation.to_rotation_matrix();
    let place = palm.translation.vector.iter().zip(ABOVE).map(|(x, middle)| (x - middle) / SCALE);
    let axes = turn.matrix().columns(0, 2).iter().copied().collect::<Vec<f64>>();
    z.iter().copied().chain(place.chain(axes).map(|x| x as f32)).collect()
}

/// Middle and half (rad) of the ranges of the joints: the network says -1 and 1 for their limits.
pub fn ranges(limits: &Limits) -> [JointVector; 2] {
    [(limits.upper + limits.lower) * 0.5, (limits.upper - limits.lower) * 0.5]
}

/// The configuration (rad) that the network says.
fn configuration(limits: &Limits, said: &[f32]) -> JointVector {
    let [middle, half] = ranges(limits);
    JointVector::from_fn(|i, _| middle[i] + half[i] * f64::from(said[i]))
}

impl Starts {
    /// Reads the network, or else the table; `object` numbers tell of the object.
    pub fn load(bytes: &[u8], object: usize, tree: &Tree) -> Result<Self, WeightsError> {
        let tensors = Tensors::parse(bytes)?;
        if tensors.shape("starts.q").is_err() && tensors.shape(&format!("{NAME}.0.bias")).is_ok() {
            let mlp = Mlp::load(&tensors, NAME, &widths(object), ACTIVATION)?;
            let limits = tree.limits.clone();
            return Ok(Self::Network(Box::new(StartNetwork { mlp, limits })));
        }
        let count = tensors.shape("starts.q")?.first().copied().unwrap_or(0);
        let z = tensors.get("starts.z", &[count, object])?;
        let q = tensors.get("starts.q", &[count, DOF])?;
        let names = match tensors.note(OBJECTS) {
            Some(note) => names(note, count)?,
            None => vec![None; count],
        };
        let rows = z.chunks_exact(object).zip(q.chunks_exact(DOF)).zip(names);
        let starts = rows.enumerate().map(|(row, ((z, q), object))| {
            let q = JointVector::from_fn(|i, _| f64::from(q[i]));
            if !tree.limits.contains(&q, -BEYOND) {
                return Err(WeightsError::Start(row));
            }
            Ok(Start { z: z.to_vec(), q, palm: tree.kinematics(&q).palm(), object })
        });
        Ok(Self::Table(starts.collect::<Result<_, _>>()?))
    }

    /// The object whose encoding at some pose is nearest to z, and how far away that is; of a table that tells its objects.
    pub fn most_like(&self, z: &[f32]) -> Option<(&str, f32)> {
        let Self::Table(starts) = self else { return None };
        let distance = |start: &Start| squared_distance(&start.z, z);
        let nearest = starts.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        Some((nearest.object.as_deref()?, libm::sqrt(distance(nearest)) as f32))
    }

    /// Where (rad) an attempt with an object begins whose palm should be at `target`; `None` if the table is empty.
    ///
    /// Of a table: the nearest encoding first, then, among the starts of that object pose, the one whose palm is nearest
    /// to `target` (paper §III-F).
    pub fn find(&self, object: &Encoding, target: &Isometry) -> Option<JointVector> {
        let target = object.pose_in_front(target);
        match self {
            Self::Table(starts) => Some(object.at_bearing(&look_up(starts, &object.z, &target)?.q)),
            Self::Network(network) => Some(network.find(object, &target)),
        }
    }
}

impl StartNetwork {
    fn find(&self, object: &Encoding, target: &Isometry) -> JointVector {
        let said = self.mlp.apply(&inputs(&object.z, target));
        self.limits.clamp(&object.at_bearing(&configuration(&self.limits, &said)), MARGIN)
    }
}

/// The start of the nearest encoding whose palm is nearest to `target`, which is seen with the object in front.
pub fn look_up<'a>(starts: &'a [Start], z: &[f32], target: &Isometry) -> Option<&'a Start> {
    let nearest =
        starts.iter().map(|start| squared_distance(&start.z, z)).min_by(f64::total_cmp)?;
    let of_pose = starts.iter().filter(|start| squared_distance(&start.z, z) == nearest);
    let distance = |start: &&Start| palm_distance(&start.palm, target);
    of_pose.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// The name of each start's object.
fn names(note: &str, wanted: usize) -> Result<Vec<Option<Arc<str>>>, WeightsError> {
    let malformed = |error: serde_json::Error| WeightsError::Objects(error.to_string());
    let objects: Vec<(String, usize)> = serde_json::from_str(note).map_err(malformed)?;
    let found = objects.iter().fold(0, |sum: usize, (_, count)| sum.saturating_add(*count));
    if found != wanted {
        return Err(WeightsError::Objects(format!("it names those of {found}, and has {wanted}")));
    }
    let rows = objects.into_iter().flat_map(|(name, count)| vec![Some(Arc::from(name)); count]);
    Ok(rows.collect())
}

fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a - b) * f64::from(a - b)).sum()
}

fn palm_distance(a: &Isometry, b: &Isometry) -> f64 {
    let moved = (a.translation.vector - b.translation.vector).norm();
    moved + LEVER * rotation::angle_between(&a.rotation, &b.rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mlp::Dense;

    fn tree() -> Tree {
        Tree::iiwa7_allegro().unwrap()
    }

    #[test]
    fn each_start_has_the_object_that_the_note_tells() {
        let found = names(r#"[["mug", 2], ["box.1", 1]]"#, 3).unwrap();
        let found: Vec<&str> = found.iter().flatten().map(|name| &**name).collect();
        assert_eq!(found, ["mug", "mug", "box.1"]);
        for note in ["mug", r#"[["mug", 2]]"#, r#"[["mug", 18446744073709551615], ["a", 9]]"#] {
            let message = names(note, 3).unwrap_err().to_string();
            assert!(message.starts_with("the file does not tell of which objects"), "{message}");
        }
    }

    #[test]
    fn a_network_is_asked_in_front_and_answers_within_the_limits_at_the_bearing() {
        let tree = tree();
        let (object, limits) = (2, &tree.limits);
        let dense = |pair: &[usize], bias: f32| Dense {
            weight: vec![half::f16::ZERO; pair[0] * pair[1]],
            bias: vec![bias; pair[1]],
        };
        let widths = widths(object);
        let network = |bias| {
            let layers = widths.windows(2).map(|pair| dense(pair, bias)).collect();
            let mlp = Mlp { layers, activation: ACTIVATION };
            Starts::Network(Box::new(StartNetwork { mlp, limits: limits.clone() }))
        };
        let seen = Encoding { bearing: 0.4, z: vec![0.1; object] };
        let start = network(0.5).find(&seen, &Isometry::identity()).unwrap();
        let wanted = seen.at_bearing(&configuration(limits, &[0.5; DOF]));
        assert!((start - limits.clamp(&wanted, MARGIN)).amax() < 1e-6);
        assert!((configuration(limits, &[1.0; DOF]) - limits.upper).amax() < 1e-9);
        assert!(limits.contains(&network(7.0).find(&seen, &Isometry::identity()).unwrap(), 0.0));

        // A palm that turns with the object about the robot is the same in front.
        let palm = tree.kinematics(&JointVector::repeat(0.2)).palm();
        let turned = Encoding { bearing: seen.bearing + 0.3, ..seen.clone() };
        let [a, b] = [(&seen, palm), (&turned, rotation::about_vertical(0.3) * palm)]
            .map(|(seen, palm)| inputs(&seen.z, &seen.pose_in_front(&palm)));
        assert_eq!(a.len(), widths[0]);
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
    }
}
