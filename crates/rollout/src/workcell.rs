//! What attempts share: robot, camera, model, and the grasps that the planner knows.

use grasps::Robot;
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
    /// A demonstration is empty.
    #[error("the demonstration has no states; write it again with `ngf dataset episode`")]
    NoStates,
    /// A row leaves what the robot can do.
    #[error("row {row} is beyond the robot's limits; write it again")]
    Impossible {
        /// Index of the row.
        row: usize,
    },
    /// The object stands elsewhere.
    #[error("the object stands off the table")]
    OffTheTable,
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

    /// Loads a model from the bytes of its three files; gives their BLAKE3, hex.
    pub fn load_model(
        &mut self,
        weights: &[u8],
        starts: &[u8],
        config: &[u8],
    ) -> Result<String, RolloutError> {
        self.model = Some(Model::load(weights, starts, config, &self.robot.tree)?);
        let mut hasher = blake3::Hasher::new();
        hasher.update(weights).update(starts).update(config);
        Ok(hasher.finalize().to_hex().to_string())
    }
}
