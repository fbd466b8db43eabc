//! Scene configuration: all parameters of the world and of the attempt protocol.

use geometry::{Pose, Vec3};
pub use robot::integrator::CONTROL_DT;
use robot::{ARM_DOF, HAND_DOF};

/// Error during the setup of a scene.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The scene file cannot be parsed.
    #[error("invalid scene file: {0}")]
    Config(#[from] serde_json::Error),
    /// A convex part of an object has no volume.
    #[error(
        "part {part} of the collision shapes of {name} is flat or empty; use a mesh with volume"
    )]
    FlatPart {
        /// Name of the object.
        name: String,
        /// Index of the convex part.
        part: usize,
    },
    /// The robot description is invalid.
    #[error(transparent)]
    Robot(#[from] robot::UrdfError),
}

/// Contents of the scene file. `assets/scene/scene.toml` documents each value.
#[derive(Clone, Debug, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the comments of the scene file document the fields")]
pub struct SceneConfig {
    pub table: Table,
    pub workspace: Workspace,
    pub camera: CameraConfig,
    pub crop: Crop,
    pub robot: RobotConfig,
    pub physics: Physics,
    pub motors: Motors,
    pub protocol: AttemptProtocol,
    pub pregrasp_region: PregraspRegion,
}

/// The table, a box.
#[derive(Clone, Debug, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Centre (m).
    pub center: [f32; 3],
    /// Half extents (m).
    pub half_extents: [f32; 3],
    /// Coulomb friction coefficient.
    pub friction: f32,
}

impl Table {
    /// Whether a point (x, y) (m) of the table top is within its edges.
    pub fn contains(&self, [x, y]: [f32; 2]) -> bool {
        (x - self.center[0]).abs() <= self.half_extents[0]
            && (y - self.center[1]).abs() <= self.half_extents[1]
    }
}

/// Rectangle on the table top in which objects are placed (m).
#[derive(Clone, Copy, Debug, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct Workspace {
    /// Min and max x (m).
    pub x: [f32; 2],
    /// Min and max y (m).
    pub y: [f32; 2],
}

impl Workspace {
    /// Whether a point (x, y) (m) is inside the rectangle.
    pub fn contains(&self, [x, y]: [f32; 2]) -> bool {
        let is_within = |value: f32, [min, max]: [f32; 2]| (min..=max).contains(&value);
        is_within(x, self.x) && is_within(y, self.y)
    }
}

/// A pinhole depth camera.
#[derive(Clone, Debug, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct CameraConfig {
    /// Optical centre (m).
    pub position: [f32; 3],
    /// Look-at point, at the image centre (m).
    pub target: [f32; 3],
    /// Image width (pixels).
    pub width: usize,
    /// Image height (pixels).
    pub height: usize,
    /// Horizontal field of view (degrees).
    pub hfov_deg: f32,
    /// Min and max measurable depth (m).
    pub range: [f32; 2],
    /// Sensor noise.
    pub noise: DepthNoise,
}

/// Noise parameters of a stereo depth sensor; see [`crate::depth_noise`].
#[derive(Clone, Debug, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct DepthNoise {
    /// Fraction of pixels without a measurement.
    pub dropout: f32,
    /// Fraction of pixels with a random depth in range.
    pub outlier: f32,
    /// Standard deviation of the lateral shift (pixels).
    pub shift_sigma: f32,
    /// Standard deviation of the disparity (steps).
    pub disparity_sigma: f32,
    /// Disparity at 1 m (steps).
    pub disparity_base: f32,
}

/// Crop box, outlier filter and size of the point cloud.
#[derive(Clone, Debug, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct Crop {
    /// Min corner (m), base frame.
    pub min: [f32; 3],
    /// Max corner (m), base frame.
    pub max: [f32; 3],
    /// Number of points after downsampling.
    pub num_points: usize,
    /// Min number of close points among the eight neighbouring pixels; points with fewer are outliers.
    pub min_neighbors: usize,
    /// Distance (m) within which a neighbouring point is close.
    pub neighbor_radius: f32,
}

/// Friction and initial joint positions of the robot.
#[derive(Clone, Debug, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct RobotConfig {
    /// Coulomb friction coefficient of all links.
    pub friction: f32,
    /// Arm joints (rad) at the start of every attempt, when the camera captures its frame.
    pub home: [f64; ARM_DOF],
    /// Hand joints (rad) at home and above the object: the open hand.
    pub open: [f64; HAND_DOF],
}

/// Parameters of the physics simulation.
#[derive(Clone, Debug, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct Physics {
    /// Physics steps per control period.
    pub substeps: usize,
    /// Solver iterations per physics step. Each integrates the velocities once and assembles the mass matrices.
    pub solver_iterations: usize,
    /// Sweeps over all constraints per solver iteration that also correct penetration.
    pub pgs_iterations: usize,
    /// Sweeps over all constraints per solver iteration that do not correct penetration.
    pub stabilization_iterations: usize,
    /// Whether the sweeps that correct penetration include friction.
    pub friction_in_bias_pass: bool,
    /// Size of a typical object (m), the scale of rapier's tolerances.
    pub length_unit: f32,
}

/// Joint motors that track the commanded state.
#[derive(Clone, Debug, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the comments of the scene file document the fields")]
pub struct Motors {
    pub arm_stiffness: f32,
    pub arm_damping: f32,
    pub arm_armature: f32,
    pub hand_stiffness: f32,
    pub hand_damping: f32,
    pub hand_armature: f32,
    pub joint_damping: [f32; 2],
}

/// Durations and thresholds of an attempt.
#[derive(Clone, Debug, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the comments of the scene file document the fields")]
pub struct AttemptProtocol {
    pub policy_seconds: f64,
    pub rest_speed: f64,
    pub rest_seconds: f64,
    pub lift_height: f64,
    pub hold_seconds: f64,
    pub min_hold_height: f32,
    pub max_slip: f32,
    pub max_rotation_deg: f32,
}

/// Region above the object from which pre-grasp poses of the palm are sampled (Fig. 2).
#[derive(Clone, Debug, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct PregraspRegion {
    /// Max offset in x and y, in half extents of the bounding box.
    pub lateral: [f64; 2],
    /// Min and max height (m) of the fingertip centre above the top of the object.
    pub height: [f64; 2],
    /// Max tilt relative to the grasp (degrees).
    pub tilt_deg: f64,
}

impl SceneConfig {
    /// The scene of this project, from `assets/scene/scene.toml`.
    pub fn standard() -> Result<Self, SceneError> {
        Self::parse(include_str!(concat!(env!("OUT_DIR"), "/scene.json")))
    }

    /// Parses a scene file in JSON. `build.rs` converts the TOML file to JSON.
    pub fn parse(text: &str) -> Result<Self, SceneError> {
        Ok(serde_json::from_slice(text.as_bytes())?)
    }

    /// Home position: arm at home, hand open (rad).
    pub fn home(&self) -> robot::JointVector {
        robot::joint_vector(&self.robot.home, &self.robot.open)
    }

    /// Height of the table top (m).
    pub fn table_top(&self) -> f32 {
        self.table.center[2] + self.table.half_extents[2]
    }

    /// Pose of an upright object on the table top at (x, y) (m), rotated by `yaw` (rad).
    pub fn object_pose(&self, x: f32, y: f32, yaw: f32) -> Pose {
        let (sin, cos) = libm::sincosf(0.5 * yaw);
        let rotation = glamx::Quat::from_xyzw(0.0, 0.0, sin, cos);
        Pose::from_parts(Vec3::new(x, y, self.table_top()), rotation)
    }

    /// Duration of a physics step (s).
    pub fn physics_dt(&self) -> f64 {
        CONTROL_DT / self.physics.substeps as f64
    }
}

/// Converts a configuration array to a vector.
pub(crate) fn vec3(a: [f32; 3]) -> Vec3 {
    Vec3::from_array(a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_scene_parses_and_unknown_field_is_rejected_by_name() {
        let config = SceneConfig::standard().unwrap();
        assert_eq!(config.crop.num_points, 512);
        let standard = include_str!(concat!(env!("OUT_DIR"), "/scene.json"));
        let error = SceneConfig::parse(&standard.replace("hfov_deg", "hfow_deg")).unwrap_err();
        assert!(error.to_string().contains("hfow_deg"), "{error}");
    }
}
