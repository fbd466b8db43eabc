//! The scene file: every figure of the world and of the protocol, and the hash that names them.

use geometry::{Pose, Vec3};
use robot::{ARM, HAND};

/// Why a scene cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The scene file does not parse.
    #[error("the scene file is not valid: {0}")]
    Config(#[from] serde_json::Error),
    /// An object's collision parts span no volume.
    #[error(
        "part {part} of the collision shapes of {name} is flat or empty; give it a mesh with volume"
    )]
    FlatPart {
        /// Object name.
        name: String,
        /// Index of the part.
        part: usize,
    },
    /// The robot description is at fault.
    #[error(transparent)]
    Robot(#[from] robot::UrdfError),
}

/// The whole scene file; see `assets/scene/scene.toml` for what each figure means.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the commented file is the documentation of its fields")]
pub struct SceneConfig {
    pub table: Table,
    pub workspace: Workspace,
    pub camera: CameraConfig,
    pub crop: Crop,
    pub robot: RobotConfig,
    pub physics: Physics,
    pub motors: Motors,
    pub attempt: Protocol,
    pub target: TargetBox,
}

/// The table: a finite box.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Centre (m).
    pub center: [f32; 3],
    /// Half sizes (m).
    pub half: [f32; 3],
    /// Coulomb friction coefficient.
    pub friction: f32,
}

impl Table {
    /// Whether a point of its top (m) lies within its edges.
    pub fn contains(&self, [x, y]: [f32; 2]) -> bool {
        (x - self.center[0]).abs() <= self.half[0] && (y - self.center[1]).abs() <= self.half[1]
    }
}

/// Rectangle of the table on which objects are placed (m).
#[derive(Clone, Copy, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Workspace {
    /// Least and greatest x.
    pub x: [f32; 2],
    /// Least and greatest y.
    pub y: [f32; 2],
}

impl Workspace {
    /// Whether a point of the table (m) lies in it.
    pub fn contains(&self, [x, y]: [f32; 2]) -> bool {
        let is_within = |value: f32, [least, most]: [f32; 2]| (least..=most).contains(&value);
        is_within(x, self.x) && is_within(y, self.y)
    }
}

/// A pinhole depth camera.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraConfig {
    /// Optical centre (m).
    pub position: [f32; 3],
    /// Point in the middle of the image (m).
    pub target: [f32; 3],
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Horizontal field of view (degrees).
    pub hfov_deg: f32,
    /// Least and greatest depth that is measured (m).
    pub range: [f32; 2],
    /// Errors of the sensor.
    pub noise: Noise,
}

/// Errors of a stereo depth sensor; see [`crate::noise`].
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// Share of pixels without a value.
    pub dropout: f32,
    /// Share of pixels with an arbitrary value in range.
    pub outlier: f32,
    /// Standard deviation of the lateral shift (pixels).
    pub shift_sigma: f32,
    /// Standard deviation of the disparity (steps).
    pub disparity_sigma: f32,
    /// Disparity at 1 m (steps).
    pub disparity_base: f32,
}

/// Which measured points become the cloud.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Crop {
    /// Least corner (m).
    pub min: [f32; 3],
    /// Greatest corner (m).
    pub max: [f32; 3],
    /// Points after thinning.
    pub num_points: usize,
    /// Pixels, of the eight around a point, that must have a point close by.
    pub neighbors: usize,
    /// How close (m).
    pub near: f32,
}

/// The robot in the scene.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotConfig {
    /// Coulomb friction coefficient of all links.
    pub friction: f32,
    /// Arm joints (rad) where every attempt begins and the camera takes its frame.
    pub home: [f64; ARM],
    /// Hand joints (rad) at home and above the object.
    pub open: [f64; HAND],
}

/// How the world is stepped.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Physics {
    /// Physics steps in a control period.
    pub substeps: usize,
    /// Solver iterations a step.
    pub solver_iterations: usize,
    /// Size of a typical object (m), for the engine's tolerances.
    pub length_unit: f32,
}

/// The motors that make physics follow the commanded joints.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the commented file is the documentation of its fields")]
pub struct Motors {
    pub arm_stiffness: f32,
    pub arm_damping: f32,
    pub arm_armature: f32,
    pub hand_stiffness: f32,
    pub hand_damping: f32,
    pub hand_armature: f32,
    pub joint_damping: [f32; 2],
}

/// Times and thresholds of an attempt.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the commented file is the documentation of its fields")]
pub struct Protocol {
    pub policy_seconds: f64,
    pub rest_speed: f64,
    pub rest_seconds: f64,
    pub lift_height: f64,
    pub hold_seconds: f64,
    pub held_height: f32,
    pub held_distance: f32,
    pub held_angle_deg: f32,
}

/// Region above the object from which target poses of the palm are drawn (Fig. 2).
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TargetBox {
    /// Greatest offset in x and y, in half sizes of the bounding box.
    pub spread: [f64; 2],
    /// Least and greatest height of the fingertips' middle over the object's top (m).
    pub above: [f64; 2],
    /// Greatest tilt against the grasp (degrees).
    pub tilt_deg: f64,
}

impl SceneConfig {
    /// The scene of this project, from `assets/scene/scene.toml`.
    pub fn standard() -> Result<Self, SceneError> {
        Self::parse(include_str!(concat!(env!("OUT_DIR"), "/scene.json")))
    }

    /// Reads a scene file, which `build.rs` made JSON of.
    pub fn parse(text: &str) -> Result<Self, SceneError> {
        Ok(serde_json::from_str(text)?)
    }

    /// Joints at home, hand open.
    pub fn home(&self) -> robot::JointVector {
        robot::join(&self.robot.home, &self.robot.open)
    }

    /// Height of the table's top (m).
    pub fn table_top(&self) -> f32 {
        self.table.center[2] + self.table.half[2]
    }

    /// Pose of an object that stands upright on the table, turned by `yaw` (rad).
    pub fn upright(&self, x: f32, y: f32, yaw: f32) -> Pose {
        let (sin, cos) = libm::sincosf(0.5 * yaw);
        let rotation = glamx::Quat::from_xyzw(0.0, 0.0, sin, cos);
        Pose::from_parts(Vec3::new(x, y, self.table_top()), rotation)
    }

    /// Seconds of a physics step.
    pub fn physics_dt(&self) -> f64 {
        CONTROL_PERIOD / self.physics.substeps as f64
    }
}

/// Seconds between two policy steps (paper: 30 Hz).
pub const CONTROL_PERIOD: f64 = 1.0 / 30.0;

/// BLAKE3 of the scene file and the robot description, hex: names the experiment.
pub fn scene_hash() -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(include_bytes!("../../../assets/scene/scene.toml"));
    hasher.update(include_bytes!("../../../assets/robot/iiwa7_allegro.urdf"));
    hasher.finalize().to_hex().to_string()
}

/// An array of the file as a vector.
pub(crate) fn vec3(a: [f32; 3]) -> Vec3 {
    Vec3::from_array(a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_standard_scene_parses_and_a_typo_is_named() {
        let config = SceneConfig::standard().unwrap();
        assert_eq!(config.crop.num_points, 512);
        let standard = include_str!(concat!(env!("OUT_DIR"), "/scene.json"));
        let error = SceneConfig::parse(&standard.replace("hfov_deg", "hfow_deg")).unwrap_err();
        assert!(error.to_string().contains("hfow_deg"), "{error}");
    }
}
