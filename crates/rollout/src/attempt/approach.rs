//! Planning before the policy starts: observation, start configuration, and a quintic spline in joint space to
//! it (paper §III-F, §IV).

use crate::attempt::setup::{AttemptSetup, capture_cloud};
use crate::attempt::start_selection::select_start;
use crate::attempt::{DemonstrationLibrary, FailureReason};
use crate::rollout_context::{RolloutContext, RolloutError};
use grasps::PlacedObject;
use grasps::plan::demonstration::{self, TrajectoryConfig};
use grasps::plan::{lift, object_poses};
use grasps::set::catalog::catalog_grasps;
use grasps::set::grasp::Grasp;
use grasps::set::symmetry::expand_by_symmetry;
use policy::{Model, Observation};
use rand_chacha::ChaCha8Rng;
use robot::{ARM_DOF, HAND_DOF, Isometry, JointState, JointVector, KinematicTree, spline};
use scene::config::CONTROL_DT;

/// Inputs of the approach planner.
pub(crate) struct ApproachInputs<'a> {
    /// Robot, sensor and model.
    pub(crate) context: &'a RolloutContext,
    /// The object and its point cloud. Policies have access to the cloud only.
    pub(crate) setup: &'a AttemptSetup,
    /// Desired palm pose of the start configuration, world frame.
    pub(crate) target: Isometry,
}

/// z in the observation of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LatentInput {
    /// z of the captured cloud.
    Observed,
    /// z of the same object at another pose.
    Shuffled,
    /// z = 0.
    Zero,
}

/// A planned approach, with the planned grasp if there is one. Empty after a failure.
#[derive(Default)]
pub(crate) struct Approach {
    /// States from home to the start configuration; a planned grasp follows without a gap.
    pub(crate) states: Vec<JointState>,
    /// Number of states before the grasp.
    pub(crate) approach_ticks: usize,
    /// Observation of the object, the input of the policy.
    pub(crate) observation: Option<Observation>,
}

impl ApproachInputs<'_> {
    /// Plans a demonstration with the grasps of a built-in object.
    pub(crate) fn plan_catalog_grasps(
        &self,
        rng: &mut ChaCha8Rng,
    ) -> Result<Result<Approach, FailureReason>, RolloutError> {
        let name = &self.setup.object_name;
        let set = catalog_grasps(name).ok_or_else(|| RolloutError::NoGrasps(name.clone()))?;
        self.plan_demonstration(&set.grasps, rng)
    }

    /// Plans a demonstration with the first of these grasps that is feasible.
    pub(crate) fn plan_demonstration(
        &self,
        grasps: &[Grasp],
        rng: &mut ChaCha8Rng,
    ) -> Result<Result<Approach, FailureReason>, RolloutError> {
        let AttemptSetup { object, world_from_object: pose, .. } = self.setup;
        let robot = &self.context.robot;
        let config = TrajectoryConfig::standard();
        let placed = PlacedObject::new(robot, object, pose);
        for (_, posture) in placed.reachable(&expand_by_symmetry(object, grasps)) {
            let lift = lift::plan_from_grasp(&placed, &posture)?;
            if !lift.is_some_and(|lift| lift::reaches_hold_height(robot, &lift)) {
                continue;
            }
            let palm = robot.tree.forward_kinematics(&posture.grasp).palm_pose();
            let target =
                demonstration::sample_pregrasp_pose(robot, &object.bounds, pose, &palm, rng);
            let planned = demonstration::demonstrate(&placed, &posture, &target, &config);
            let Ok(planned) = planned else { continue };
            return Ok(Ok(self.prepend_approach(&planned.states)));
        }
        Ok(Err(FailureReason::Unreachable))
    }

    /// Joint position (rad) before the first step.
    fn home(&self) -> JointVector {
        self.context.robot.config.home()
    }

    /// Prepends a spline from home to the first state of a demonstration.
    pub(crate) fn prepend_approach(&self, states: &[JointState]) -> Approach {
        let limits = &self.context.robot.tree.limits;
        let mut rows = spline::quintic(&self.home(), &states[0].q, limits, CONTROL_DT);
        let ticks = rows.len();
        rows.extend(&states[1..]);
        Approach { states: rows, approach_ticks: ticks, observation: None }
    }

    /// Observes the object and finds the start configuration in the model (paper §III-F).
    fn find_start(
        &self,
    ) -> Result<Result<(&Model, Observation, JointVector), FailureReason>, RolloutError> {
        let model = self.context.model.as_ref().ok_or(RolloutError::NoModel)?;
        let Some(observation) = model.observe(&self.setup.cloud) else {
            return Ok(Err(FailureReason::NotVisible));
        };
        let tree = &self.context.robot.tree;
        let start = select_start(model, tree, &observation, &self.setup.cloud, &self.target);
        Ok(start.map(|start| (model, observation, start)).ok_or(FailureReason::Unreachable))
    }

    /// Plans the demonstration that starts nearest to the start configuration.
    pub(crate) fn plan_playback(
        &self,
        library: &DemonstrationLibrary,
    ) -> Result<Result<Approach, FailureReason>, RolloutError> {
        Ok(self.find_start()?.and_then(|(_, observation, start)| {
            let states = library.nearest(&start, &observation).ok_or(FailureReason::Unreachable)?;
            Ok(self.prepend_approach(&states))
        }))
    }

    /// Plans a spline to the start configuration, where the policy starts.
    pub(crate) fn plan_for_policy(
        &self,
        latent: LatentInput,
        rng: &mut ChaCha8Rng,
    ) -> Result<Result<Approach, FailureReason>, RolloutError> {
        let robot = &self.context.robot;
        let (model, observation, start) = match self.find_start()? {
            Ok(found) => found,
            Err(failure) => return Ok(Err(failure)),
        };
        let zero = || vec![0.0; model.observation_kind.dim()];
        let observation = match latent {
            LatentInput::Zero => Observation { latent: zero(), ..observation },
            LatentInput::Shuffled => {
                let [x, y, yaw] = object_poses::sample_planar_pose(robot, rng);
                let other = robot.config.object_pose(x, y, yaw);
                let cloud = capture_cloud(self.context, &self.setup.object, &other, rng);
                let z = model.observe(&cloud).map_or_else(zero, |other| other.latent);
                Observation { latent: z, ..observation }
            }
            LatentInput::Observed => observation,
        };
        let rows = spline::quintic(&self.home(), &start, &robot.tree.limits, CONTROL_DT);
        Ok(Ok(Approach {
            approach_ticks: rows.len(),
            states: rows,
            observation: Some(observation),
        }))
    }
}

/// A spline that flexes the fingers by the hand's scripted angle, or up to the joint limits, at a fixed palm.
pub(crate) fn scripted_closing(q: &JointVector, context: &RolloutContext) -> Vec<JointState> {
    let KinematicTree { limits, hand, .. } = &context.robot.tree;
    let mut closed = *q;
    for joint in (0..HAND_DOF).filter(|joint| robot::is_flexion_joint(*joint)) {
        let i = ARM_DOF + joint;
        closed[i] = (q[i] + hand.closing.scripted_angle).min(limits.upper[i]);
    }
    spline::quintic(q, &closed, limits, CONTROL_DT)
}
