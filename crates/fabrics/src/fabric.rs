//! Geometric fabric: sums its terms, energizes, forces and damps them (paper §III-A; Eq. 3 with fixed terms).

use crate::energy::energization;
use crate::joint_limits::JointLimitConfig;
use crate::terms::attractor::Attractor;
use crate::terms::repulsion::{self, Obstacle, RepulsionConfig};
use crate::terms::{TermSums, palm, posture};
use robot::collision_spheres::Sphere;
use robot::{HAND_DOF, Isometry, JointState, JointVector, KinematicTree, UrdfError};

/// Parameters of all terms.
#[derive(Clone, Debug)]
pub struct FabricConfig {
    /// Geometric attraction of all joints to the rest posture.
    pub posture: Attractor,
    /// Attraction of the hand to its goal posture.
    pub hand: Attractor,
    /// Attraction of the palm to its goal pose.
    pub palm: Attractor,
    /// Parameters of the joint limits.
    pub joint_limits: JointLimitConfig,
    /// Repulsion from obstacles and from the robot itself.
    pub repulsion: RepulsionConfig,
    /// Damping of all joints (1/s).
    pub damping: f64,
}

impl FabricConfig {
    /// Parameters for demonstrations: the palm moves 10 to 25 cm in 1 to 3 s.
    ///
    /// Forms and orders of magnitude follow the published pose fabric of the same robot. The attraction is
    /// weaker, so that motions are long enough to be imitated at 30 Hz.
    pub fn demonstration() -> Self {
        let attractor = |gain, sharpness, mass| Attractor {
            gain,
            sharpness,
            mass,
            damping: 20.0,
            damping_radius: 0.15,
        };
        Self {
            posture: attractor(1.0, 20.0, 1.0),
            hand: attractor(12.0, 8.0, 8.0),
            palm: attractor(12.0, 12.0, 4.0),
            joint_limits: JointLimitConfig { margin: 0.02, rate: 5.0, priority: 100.0 },
            repulsion: RepulsionConfig {
                potential_gain: 1.0,
                geometric_gain: 5.0,
                priority: 0.01,
                max_distance: 0.5,
                min_distance: 0.01,
            },
            damping: 10.0,
        }
    }

    /// Parameters for lifting: as [`FabricConfig::demonstration`], with half the palm gain for heavy objects.
    pub fn lifting() -> Self {
        let base = Self::demonstration();
        Self { palm: Attractor { gain: 6.0, ..base.palm }, ..base }
    }
}

/// Goal of the fabric.
#[derive(Clone, Copy, Debug)]
pub struct Goal {
    /// Palm pose, world frame.
    pub palm: Isometry,
    /// Hand posture (rad).
    pub hand: [f64; HAND_DOF],
}

/// A fabric for one robot and a set of obstacles.
pub struct Fabric<'a> {
    tree: &'a KinematicTree,
    spheres: Vec<Sphere>,
    obstacles: Vec<Obstacle>,
    rest_posture: JointVector,
    config: FabricConfig,
}

impl<'a> Fabric<'a> {
    /// A fabric with the rest posture `rest` (rad) and repulsion from `obstacles`.
    pub fn new(
        tree: &'a KinematicTree,
        rest: JointVector,
        obstacles: Vec<Obstacle>,
        config: FabricConfig,
    ) -> Result<Self, UrdfError> {
        Ok(Self { tree, spheres: tree.collision_spheres()?, obstacles, rest_posture: rest, config })
    }

    /// Computes q̈ = h̃ + α q̇ - M⁻¹ ∂ψ - γ q̇ (rad/s²), constrained at the joint limits and scaled to the
    /// acceleration limits; `None` if the state is not finite.
    pub fn acceleration(&self, state: &JointState, goal: &Goal) -> Option<JointVector> {
        let config = &self.config;
        let kinematics = self.tree.forward_kinematics(&state.q);
        let mut sums = TermSums::zero();
        posture::add_rest_posture(&mut sums, state, &self.rest_posture, &config.posture);
        posture::add_hand_goal(&mut sums, state, &goal.hand, &config.hand);
        palm::add(&mut sums, self.tree, &kinematics, &state.qd, &goal.palm, &config.palm);
        let (spheres, obstacles) = (&self.spheres, &self.obstacles);
        repulsion::add(&mut sums, &kinematics, &state.qd, spheres, obstacles, &config.repulsion);

        let summed = sums.geometry.metric;
        let metric = summed.cholesky()?;
        let h = -metric.solve(&sums.geometry.force);
        let alpha = energization(&state.qd, &h);
        let forcing = metric.solve(&sums.potential);
        let qdd = h + state.qd * (alpha - config.damping) - forcing;
        let limits = &self.tree.limits;
        Some(
            limits.scale_acceleration(&config.joint_limits.constrain(&summed, qdd, state, limits)?),
        )
    }

    /// The robot model.
    pub fn tree(&self) -> &'a KinematicTree {
        self.tree
    }
}
