//! Texts of a robot description: the files of one folder under `assets/robot`.

/// Texts of the three files that describe a robot; [`crate::KinematicTree::load`] checks and combines them.
#[derive(Clone, Copy, Debug)]
pub struct RobotDescription<'a> {
    /// `robot.urdf`: links with inertia and primitive collision shapes; joints with limits.
    pub urdf: &'a str,
    /// `collision_spheres.json`: spheres (m, link frames) that cover the robot, for the motion planner.
    pub collision_spheres: &'a str,
    /// `hand.toml`, converted to JSON: the values of [`crate::HandModel`].
    pub hand: &'a str,
}

impl RobotDescription<'static> {
    /// The robot of this project, embedded at compile time from `assets/robot/iiwa7_allegro`. `build.rs`
    /// converts its TOML file to JSON.
    pub const STANDARD: Self = Self {
        urdf: include_str!("../../../assets/robot/iiwa7_allegro/robot.urdf"),
        collision_spheres: include_str!(
            "../../../assets/robot/iiwa7_allegro/collision_spheres.json"
        ),
        hand: include_str!(concat!(env!("OUT_DIR"), "/hand.json")),
    };
}
