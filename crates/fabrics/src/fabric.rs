//! The fabric as a whole: terms summed, energized, forced and damped (paper §III-A; Eq. 3 with fixed terms).

use crate::energy::energization;
use crate::limit::LimitConfig;
use crate::terms::attractor::Attractor;
use crate::terms::repulsion::{self, Obstacle, RepulsionConfig};
use crate::terms::{Pull, palm, posture};
use robot::spheres::Sphere;
use robot::{HAND, Isometry, JointState, JointVector, Tree, UrdfError};

/// Parameters of all terms.
#[derive(Clone, Debug)]
pub struct FabricConfig {
    /// Geometric pull of all joints to the resting posture.
    pub posture: Attractor,
    /// Pull of the hand to its goal posture.
    pub hand: Attractor,
    /// Pull of the palm to its goal pose.
    pub palm: Attractor,
    /// Joint limits.
    pub limit: LimitConfig,
    /// Obstacles and the robot itself.
    pub repulsion: RepulsionConfig,
    /// Damping of all joints (1/s).
    pub damping: f64,
}

impl FabricConfig {
    /// Parameters that bring the palm over 10 to 25 cm in one to three seconds.
    ///
    /// The forms and orders of magnitude follow the published pose fabric of the same robot; the
    /// pulls are weaker, so that motions last long enough to be imitated at 30 Hz.
    pub fn calm() -> Self {
        let pull = |gain, sharpness, mass| Attractor {
            gain,
            sharpness,
            mass,
            damping: 20.0,
            damping_radius: 0.15,
        };
        Self {
            posture: pull(1.0, 20.0, 1.0),
            hand: pull(12.0, 8.0, 8.0),
            palm: pull(12.0, 12.0, 4.0),
            limit: LimitConfig { margin: 0.02, rate: 5.0, priority: 100.0 },
            repulsion: RepulsionConfig {
                push: 1.0,
                bend: 5.0,
                priority: 0.01,
                reach: 0.5,
                least: 0.01,
            },
            damping: 10.0,
        }
    }

    /// As [`FabricConfig::calm`], but soft enough to carry something heavy.
    pub fn gentle() -> Self {
        let calm = Self::calm();
        Self { palm: Attractor { gain: 6.0, ..calm.palm }, ..calm }
    }
}

/// Where the fabric flows to.
#[derive(Clone, Copy, Debug)]
pub struct Goal {
    /// Pose of the palm in the world.
    pub palm: Isometry,
    /// Posture of the hand (rad).
    pub hand: [f64; HAND],
}

/// A fabric for one robot among obstacles.
pub struct Fabric<'a> {
    tree: &'a Tree,
    spheres: Vec<Sphere>,
    obstacles: Vec<Obstacle>,
    rest: JointVector,
    config: FabricConfig,
}

impl<'a> Fabric<'a> {
    /// A fabric that prefers the posture `rest` and keeps off `obstacles`.
    pub fn new(
        tree: &'a Tree,
        rest: JointVector,
        obstacles: Vec<Obstacle>,
        config: FabricConfig,
    ) -> Result<Self, UrdfError> {
        Ok(Self { tree, spheres: tree.spheres()?, obstacles, rest, config })
    }

    /// The acceleration q̈ = h̃ + α q̇ - M⁻¹ ∂ψ - γ q̇ (rad/s²), held off the joints' limits and scaled
    /// down to what they can;
    /// `None` if the state is not finite.
    pub fn acceleration(&self, state: &JointState, goal: &Goal) -> Option<JointVector> {
        let config = &self.config;
        let kinematics = self.tree.kinematics(&state.q);
        let mut pull = Pull::zero();
        posture::add_resting(&mut pull, state, &self.rest, &config.posture);
        posture::add_hand(&mut pull, state, &goal.hand, &config.hand);
        palm::add(&mut pull, self.tree, &kinematics, &state.qd, &goal.palm, &config.palm);
        let (spheres, obstacles) = (&self.spheres, &self.obstacles);
        repulsion::add(&mut pull, &kinematics, &state.qd, spheres, obstacles, &config.repulsion);

        let sum = pull.geometry.metric;
        let metric = sum.cholesky()?;
        let h = -metric.solve(&pull.geometry.force);
        let alpha = energization(&state.qd, &h);
        let drive = metric.solve(&pull.potential);
        let qdd = h + state.qd * (alpha - config.damping) - drive;
        let limits = &self.tree.limits;
        Some(limits.scale_acceleration(&config.limit.hold(&sum, qdd, state, limits)?))
    }

    /// The robot that it moves.
    pub fn tree(&self) -> &'a Tree {
        self.tree
    }
}
