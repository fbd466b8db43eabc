//! Data shared by attempts: robot, depth sensor and model.

use grasps::RobotContext;
use policy::model::ModelConfig;
use policy::{Model, WeightsError};
use scene::SceneError;
use scene::depth_sensor::DepthSensor;

/// Error that prevents the start of an attempt. Failures during an attempt are outcomes.
#[derive(Debug, thiserror::Error)]
pub enum RolloutError {
    /// The scene cannot be set up.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The model cannot be loaded.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The controller requires a model, but none is loaded.
    #[error("no model is loaded; load a trained model or use the planner")]
    NoModel,
    /// The planner has no grasps for the object.
    #[error("the planner has no grasps for {0}; use one of the built-in objects")]
    NoGrasps(String),
    /// A row of a recording has the wrong length.
    #[error("row {row} has {found} numbers instead of {wanted}; record the file again")]
    RowLength {
        /// Index of the row.
        row: usize,
        /// Length of the row.
        found: usize,
        /// Expected length.
        wanted: usize,
    },
    /// A demonstration has no states.
    #[error("the demonstration has no states; run `ngf dataset export-episode` again")]
    NoStates,
    /// A row exceeds the joint or speed limits of the robot.
    #[error("row {row} is beyond the robot's limits; record the file again")]
    BeyondLimits {
        /// Index of the row.
        row: usize,
    },
    /// The object pose is outside the table.
    #[error("the object is off the table; move it within the table's edges")]
    OffTheTable,
    /// A file was recorded with another scene or object.
    #[error(
        "the file was recorded with another {what}: {found} instead of {wanted}; record it again"
    )]
    HashMismatch {
        /// Name of the hashed input: scene or object.
        what: &'static str,
        /// Current hash (hex).
        wanted: String,
        /// Hash in the file (hex).
        found: String,
    },
}

/// Robot, depth sensor and model, shared by attempts.
pub struct RolloutContext {
    /// Robot, scene configuration and grasp planner.
    pub robot: RobotContext,
    /// Depth sensor, with the depth image of the scene without object, rendered once.
    pub sensor: DepthSensor,
    /// The learned model, if loaded.
    pub model: Option<Model>,
}

impl RolloutContext {
    /// The standard scene without a model.
    pub fn new() -> Result<Self, RolloutError> {
        let robot = RobotContext::standard()?;
        let sensor = DepthSensor::new(&robot.config, &robot.tree);
        Ok(Self { robot, sensor, model: None })
    }

    /// Loads a model from the bytes of its three files; returns their BLAKE3 hash (hex). The
    /// configuration contributes its values, not its text.
    pub fn load_model(
        &mut self,
        weights: &[u8],
        starts: &[u8],
        config: &[u8],
    ) -> Result<String, RolloutError> {
        self.model = Some(Model::load(weights, starts, config, &self.robot.tree)?);
        let values = ModelConfig::parse(config)?.canonical_bytes();
        let mut hasher = blake3::Hasher::new();
        hasher.update(weights).update(starts).update(&values);
        Ok(hasher.finalize().to_hex().to_string())
    }
}
