//! What attempts share: robot, camera, model, and the grasps that the planner knows.

use geometry::object::Object;
use grasps::Robot;
use grasps::search::GraspSet;
use policy::{Model, WeightsError};
use scene::SceneError;
use scene::cloud::Eye;

/// Why an attempt cannot begin; failures during an attempt are verdicts.
#[derive(Debug, thiserror::Error)]
pub enum RolloutError {
    /// The scene cannot be set up.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The model cannot be used.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The policy was asked to act without a model.
    #[error("no model is loaded; train one, or let the planner act")]
    NoModel,
    /// The planner was asked to act on an object without grasps.
    #[error("the planner knows no grasps of {0}; it only acts on the objects it was prepared for")]
    NoGrasps(String),
    /// The grasps that come with the project cannot be read.
    #[error("assets/grasps/{name}.json cannot be read: {source}; make it again with `ngf grasps`")]
    Grasps {
        /// The object.
        name: String,
        /// What is wrong.
        source: serde_json::Error,
    },
    /// A row of an episode has another length than a state.
    #[error("row {row} of the episode has {found} numbers instead of {wanted}; record it again")]
    Row {
        /// Index of the row.
        row: usize,
        /// Its numbers.
        found: usize,
        /// Those of a state.
        wanted: usize,
    },
    /// An episode belongs to another scene or object.
    #[error("the episode was recorded with another {what}: {found} instead of {wanted}")]
    Foreign {
        /// What differs.
        what: &'static str,
        /// The hash here.
        wanted: String,
        /// The hash in the episode.
        found: String,
    },
}

/// Robot and camera in their scene, with what they have learned.
pub struct Workcell {
    /// The robot.
    pub robot: Robot,
    /// The camera.
    pub eye: Eye,
    /// The learned policy, once it is there.
    pub model: Option<Model>,
}

impl Workcell {
    /// The standard scene without a model.
    pub fn new() -> Result<Self, RolloutError> {
        let robot = Robot::standard()?;
        let eye = Eye::new(&robot.config, &robot.tree);
        Ok(Self { robot, eye, model: None })
    }

    /// Loads a model from the bytes of its three files.
    pub fn load_model(
        &mut self,
        weights: &[u8],
        starts: &[u8],
        config: &[u8],
    ) -> Result<(), RolloutError> {
        self.model = Some(Model::load(weights, starts, config, &self.robot.tree)?);
        Ok(())
    }
}

/// BLAKE3 over an object's mesh, parts and mass, hex.
pub fn object_hash(object: &Object) -> String {
    let mut hasher = blake3::Hasher::new();
    let points = object.mesh.vertices.iter().chain(object.parts.iter().flatten());
    for x in points.flat_map(|p| p.to_array()).chain([object.mass, object.friction]) {
        hasher.update(&x.to_bits().to_le_bytes());
    }
    for triangle in &object.mesh.triangles {
        triangle.iter().for_each(|i| {
            hasher.update(&i.to_le_bytes());
        });
    }
    hasher.finalize().to_hex().to_string()
}

/// Grasps that come with the project for an object of this file name; `None` if it has none.
pub fn built_in_grasps(name: &str) -> Result<Option<GraspSet>, RolloutError> {
    let text = match name {
        "sugar_box" => include_str!("../../../assets/grasps/sugar_box.json"),
        "bleach" => include_str!("../../../assets/grasps/bleach.json"),
        _ => return Ok(None),
    };
    let unreadable = |source| RolloutError::Grasps { name: name.to_owned(), source };
    serde_json::from_str(text).map(Some).map_err(unreadable)
}

#[cfg(test)]
mod tests {
    use super::*;
    use grasps::search;

    #[test]
    fn built_in_grasps_are_read_and_numbered_by_kind() {
        for name in ["sugar_box", "bleach"] {
            let grasps = built_in_grasps(name).unwrap().expect("a set").grasps;
            let kinds: Vec<usize> = grasps.iter().map(|grasp| grasp.kind).collect();
            assert!(kinds.is_sorted() && kinds[0] == 0 && kinds.len() >= 2, "{name}: {kinds:?}");
        }
        assert!(built_in_grasps("mustard").unwrap().is_none());
    }

    #[test]
    fn the_first_kind_serves_most_object_poses_and_each_pose_is_served_by_one() {
        let robot = Robot::standard().unwrap();
        let object = Object::built_in("sugar_box").unwrap();
        let grasps = built_in_grasps("sugar_box").unwrap().unwrap().grasps;
        let served = search::poses_served(&robot, &object, &grasps);
        let all: usize = served.iter().sum();
        println!("{served:?} of {}", search::REACH_POSES);
        assert!(all <= search::REACH_POSES && all > search::REACH_POSES * 95 / 100, "{served:?}");
        assert!(served.iter().all(|poses| *poses <= served[0]), "{served:?}");
        // Nothing stands before the first kind.
        let first: Vec<_> = grasps.iter().filter(|grasp| grasp.kind == 0).cloned().collect();
        assert_eq!(search::poses_served(&robot, &object, &first), served[..1]);
    }
}
