//! Demonstrations of one object pose: planned, reversed in time, and each replayed in physics.

use crate::grasp_order::GraspOrder;
use crate::poses::shared_pregrasp;
use anyhow::{Context, Result, ensure};
use configs::DatasetConfig;
use dataset::shard::{DemoOutcome, DemoTrial, PoseShard};
use grasps::plan::demonstration::{self, Demonstration, PlanFailure, TrajectoryConfig};
use grasps::plan::lift;
use grasps::search::grasp_rating::{GraspRating, LOWERINGS};
use grasps::search::trial::{TrialOutcome, TrialProtocol};
use grasps::{Grasp, GraspBranch, PlacedObject, Posture};
use objects::object::Object;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use robot::{JointState, integrator};
use scene::HoldFailure;
use scene::config::CONTROL_DT;
use std::collections::BTreeSet;

/// Failed trials after which the next grasp is tried.
const MAX_FAILURES_PER_GRASP: usize = 3;

/// Maximum number of grasps at a pose that are tried in the order of [`GraspOrder`]. Those after the first few are
/// unlike the grasps of similar objects.
const MAX_GRASPS_PER_POSE: usize = 8;

/// Maximum number of trials at a pose, as a multiple of the demonstrations requested.
const MAX_TRIALS_PER_DEMO: usize = 2;

/// Upper bound on the targets of one pose; separates the random streams of poses.
const MAX_TARGETS: usize = 1 << 20;

/// Maximum error of Eq. 6 and 7 in a row (rad, rad/s), before rounding to the precision on disk.
const ROW_TOLERANCE: f64 = 1e-9;

/// Offset from a pose (m, rad) at which the preferred grasp of a neighboring pose is looked up. About the
/// distance to the nearest of 400 object poses, whose start configuration an attempt uses.
const OVERLAP_SHIFT: f32 = 0.03;
const OVERLAP_YAW: f32 = 0.3;

/// Maximum perturbation in a replay: along x and y (m), about the vertical axis (rad), and as a fraction of
/// the friction coefficient.
const PERTURB_SHIFT: f32 = 0.002;
const PERTURB_TURN: f32 = 0.0349;
const PERTURB_FRICTION: f32 = 0.1;

/// Grasps of an object at one pose.
#[derive(Clone, Copy)]
pub(crate) struct PoseGrasps<'a> {
    pub(crate) grasps: &'a [Grasp],
    /// Order and ratings of the grasps, with [`DatasetConfig::consistent_grasps`].
    pub(crate) order: Option<&'a GraspOrder>,
    pub(crate) ratings: &'a [GraspRating],
}

/// One object at one pose, with its grasps.
pub(crate) struct PoseTask<'a> {
    pub(crate) config: &'a DatasetConfig,
    pub(crate) name: &'a str,
    pub(crate) grasps: PoseGrasps<'a>,
    /// The object on the table, and above the lowered tables that [`GraspRating::lowering`] selects.
    pub(crate) placed: [PlacedObject<'a>; LOWERINGS.len()],
    pub(crate) pose: [f32; 3],
    /// Index of the pose among the poses of the object.
    pub(crate) index: usize,
    /// Independent random generator for a purpose and an index.
    pub(crate) rng: &'a dyn Fn(&str, usize) -> ChaCha8Rng,
}

impl PoseTask<'_> {
    /// Adds the trials with the first grasp that works, and the failed trials before it, to `shard`. With
    /// [`DatasetConfig::overlap_grasps`], also adds trials with the grasps that are preferred at neighboring
    /// poses.
    pub(crate) fn demonstrate(&self, shard: &mut PoseShard) -> Result<()> {
        shard.offsets.push(0);
        let mut tried = BTreeSet::new();
        for (way, posture) in self.in_order() {
            tried.insert(way);
            if self.try_posture(way.grasp, &posture, shard)? > 0 {
                shard.max_joint_jump = self.max_joint_jump(way, &posture);
                break;
            }
        }
        if self.config.overlap_grasps {
            let neighbors: BTreeSet<GraspBranch> = match self.grasps.order {
                Some(order) => order.of_neighbors.iter().copied().collect(),
                None => self.neighbor_branches().collect(),
            };
            for &way in neighbors.difference(&tried) {
                if let Some(posture) = self.plan(way) {
                    self.try_posture(way.grasp, &posture, shard)?;
                }
            }
        }
        Ok(())
    }

    /// Reachable grasps, the preferred one first.
    fn in_order(&self) -> Box<dyn Iterator<Item = (GraspBranch, Posture)> + '_> {
        let plan = |way: &GraspBranch| Some((*way, self.plan(*way)?));
        match self.grasps.order {
            Some(order) => {
                Box::new(order.preferred.iter().take(MAX_GRASPS_PER_POSE).filter_map(plan))
            }
            None => Box::new(self.placed[0].reachable(self.grasps.grasps)),
        }
    }

    /// The object above the table for which a grasp is planned.
    fn planned(&self, grasp: usize) -> &PlacedObject<'_> {
        let rating = self.grasps.ratings.get(grasp).copied().unwrap_or_default();
        &self.placed[rating.lowering]
    }

    fn plan(&self, branch: GraspBranch) -> Option<Posture> {
        self.planned(branch.grasp).plan_branch(branch, self.grasps.grasps)
    }

    /// Branches that are preferred at the neighboring poses.
    fn neighbor_branches(&self) -> impl Iterator<Item = GraspBranch> {
        let ([x, y, yaw], config) = (self.pose, &self.placed[0].robot.config);
        let [shift, turn] = [OVERLAP_SHIFT, OVERLAP_YAW];
        [[shift, 0.0, 0.0], [0.0, shift, 0.0], [0.0, 0.0, turn]]
            .into_iter()
            .flat_map(|step| [1.0, -1.0].map(|sign| step.map(|along: f32| sign * along)))
            .filter_map(move |[dx, dy, dyaw]| {
                let at = config.object_pose(x + dx, y + dy, yaw + dyaw);
                let neighbor = self.placed[0].at_pose(&at);
                neighbor.reachable(self.grasps.grasps).next().map(|(way, _)| way)
            })
    }

    /// Records demonstrations of one posture. Stops early if the first trials fail. Returns the number kept.
    fn try_posture(&self, grasp: usize, posture: &Posture, shard: &mut PoseShard) -> Result<usize> {
        let planned = self.planned(grasp);
        let robot = planned.robot;
        let lift = lift::plan_from_grasp(planned, posture)?;
        let lift = lift.filter(|lift| lift::reaches_hold_height(robot, lift));
        let Some(lift) = lift else { return Ok(0) };
        let palm = robot.tree.forward_kinematics(&posture.grasp).palm_pose();
        let trajectories = TrajectoryConfig::standard();
        let mut kept = 0;
        let mut num_shaken = shard.trials.iter().filter(|before| before.shaken.is_some()).count();
        for target in 0..MAX_TRIALS_PER_DEMO * self.config.trajectories {
            if kept == self.config.trajectories || (kept == 0 && target == MAX_FAILURES_PER_GRASP) {
                break;
            }
            // Every pose of the object uses the same pre-grasp targets.
            let mut rng = (self.rng)("target", target);
            let object = planned.object;
            let above = shared_pregrasp(robot, object, self.pose, &palm, &mut rng);
            let motion = demonstration::demonstrate(planned, posture, &above, &trajectories);
            let mut trial = planned_trial(target, grasp, motion.as_ref());
            trial.is_reachable = robot.can_reach(&above, posture);
            if let Ok(found) = motion {
                check_rows(&found).with_context(|| format!("{} at {:?}", self.name, self.pose))?;
                let outcome = found.replay(&self.placed[0], &lift, TrialProtocol::SHORT)?;
                trial.outcome = replay_outcome(outcome);
                if let TrialOutcome::Lifted { slip } = outcome {
                    trial.slip = slip;
                }
                if num_shaken < self.config.num_shaken_replays {
                    num_shaken += 1;
                    let outcome = found.replay(&self.placed[0], &lift, TrialProtocol::FULL)?;
                    trial.shaken = Some(replay_outcome(outcome));
                }
                if trial.outcome == DemoOutcome::Kept {
                    kept += 1;
                    shard.push(&found.states, &found.accelerations);
                    if kept <= self.config.num_perturbed_replays {
                        let mut rng = (self.rng)("perturbed", self.index * MAX_TARGETS + target);
                        trial.perturbed = Some(self.replay_perturbed(&found, &lift, &mut rng)?);
                    }
                }
            }
            shard.trials.push(trial);
        }
        Ok(kept)
    }

    /// Replays with the object pose and the friction slightly perturbed.
    fn replay_perturbed(
        &self,
        found: &Demonstration,
        lift: &[JointState],
        rng: &mut impl Rng,
    ) -> Result<DemoOutcome> {
        let PlacedObject { robot, object, .. } = self.placed[0];
        let mut draw = |max: f32| rng.random_range(-max..=max);
        let [x, y, yaw] = self.pose;
        let here = robot.config.object_pose(
            x + draw(PERTURB_SHIFT),
            y + draw(PERTURB_SHIFT),
            yaw + draw(PERTURB_TURN),
        );
        let friction = object.friction * (1.0 + draw(PERTURB_FRICTION));
        let object: Object = object.clone().with_friction(friction);
        let setting = PlacedObject { object: &object, ..self.placed[0].at_pose(&here) };
        let outcome = found.replay(&setting, lift, TrialProtocol::SHORT)?;
        Ok(replay_outcome(outcome))
    }

    /// Maximum joint difference (rad) between this posture and the postures for slightly shifted object
    /// poses.
    fn max_joint_jump(&self, way: GraspBranch, posture: &Posture) -> f32 {
        let [x, y, yaw] = self.pose;
        let planned = self.planned(way.grasp);
        let config = &planned.robot.config;
        let neighbors = [[x + 0.02, y, yaw], [x, y + 0.02, yaw], [x, y, yaw + 0.1]];
        let postures = neighbors.iter().filter_map(|&[x, y, yaw]| {
            planned.at_pose(&config.object_pose(x, y, yaw)).plan_branch(way, self.grasps.grasps)
        });
        postures.map(|other| (other.grasp - posture.grasp).amax() as f32).fold(0.0, f32::max)
    }
}

/// A trial with the results of planning.
fn planned_trial(
    target: usize,
    grasp: usize,
    planned: Result<&Demonstration, &PlanFailure>,
) -> DemoTrial {
    let none = DemoTrial {
        target,
        grasp,
        outcome: DemoOutcome::NotConverged,
        shaken: None,
        perturbed: None,
        num_frames: 0,
        contact_row: 0,
        restarts: 0,
        clearance: 0.0,
        jerk: 0.0,
        slip: 0.0,
        is_reachable: false,
        goal_error: [0.0; 2],
    };
    match planned {
        Err(flaw) => DemoTrial { outcome: planning_outcome(*flaw), ..none },
        Ok(found) => DemoTrial {
            num_frames: found.accelerations.len(),
            contact_row: found.contact_row,
            restarts: found.num_restarts,
            clearance: found.clearance,
            jerk: integrator::rms_jerk(&found.accelerations[..found.contact_row], CONTROL_DT)
                as f32,
            goal_error: [found.goal_error.distance as f32, found.goal_error.angle as f32],
            ..none
        },
    }
}

fn planning_outcome(failure: PlanFailure) -> DemoOutcome {
    match failure {
        PlanFailure::NotConverged => DemoOutcome::NotConverged,
        PlanFailure::TooShort => DemoOutcome::TooShort,
        PlanFailure::Collision => DemoOutcome::Collision,
    }
}

fn replay_outcome(outcome: TrialOutcome) -> DemoOutcome {
    match outcome {
        TrialOutcome::Lifted { .. } => DemoOutcome::Kept,
        TrialOutcome::Failed(HoldFailure::Slipped) => DemoOutcome::Slipped,
        TrialOutcome::Failed(HoldFailure::TooLow) => DemoOutcome::TooLow,
        TrialOutcome::Failed(HoldFailure::ForeignContact | HoldFailure::NoContact) => {
            DemoOutcome::ForeignContact
        }
        TrialOutcome::NotFinite => DemoOutcome::NotFinite,
    }
}

/// Checks that every row satisfies Eq. 6 and 7.
fn check_rows(found: &Demonstration) -> Result<()> {
    for (row, (pair, qdd)) in found.states.windows(2).zip(&found.accelerations).enumerate() {
        let next = integrator::step(&pair[0], qdd, CONTROL_DT);
        let error = (next.q - pair[1].q).amax().max((next.qd - pair[1].qd).amax());
        ensure!(error < ROW_TOLERANCE, "row {row} violates Eq. 6 and 7 by {error}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use grasps::plan::demonstration::GoalError;
    use rand::SeedableRng;
    use robot::JointVector;

    #[test]
    fn neighbor_branches_contain_both_grasps_when_preferred_grasp_changes() {
        let robot = grasps::RobotContext::standard().unwrap();
        let object = Object::from_catalog("bleach").unwrap();
        let grasps = grasps::set::catalog::catalog_grasps("bleach").unwrap().grasps;
        let config = DatasetConfig::preset("variants", 0).unwrap();
        let anywhere = PlacedObject::at_origin(&robot, &object);
        // The preferred grasp at a yaw, and the preferred grasps of the neighboring poses.
        let at = |step: usize| {
            let pose = [0.6, 0.0, OVERLAP_YAW * step as f32];
            let post = PoseTask {
                config: &config,
                name: "bleach",
                grasps: PoseGrasps { grasps: &grasps, order: None, ratings: &[] },
                placed: [(); LOWERINGS.len()].map(|()| {
                    anywhere.at_pose(&robot.config.object_pose(pose[0], pose[1], pose[2]))
                }),
                pose,
                index: step,
                rng: &|_, _| ChaCha8Rng::from_seed([0; 32]),
            };
            let first = post.placed[0].reachable(&grasps).next().map(|(way, _)| way);
            (first, post.neighbor_branches().collect::<BTreeSet<GraspBranch>>())
        };
        let found: Vec<_> = (0..21).map(at).collect();
        let firsts: BTreeSet<_> = found.iter().filter_map(|(first, _)| *first).collect();
        assert!(firsts.len() > 1, "one grasp covers every yaw: {firsts:?}");
        for pair in found.windows(2) {
            let [(one, near_one), (other, near_other)] = pair else { continue };
            assert!(other.is_none_or(|grasp| near_one.contains(&grasp)), "{pair:?}");
            assert!(one.is_none_or(|grasp| near_other.contains(&grasp)), "{pair:?}");
        }
    }

    #[test]
    fn check_rows_fails_when_row_violates_eq6() {
        let state = JointState::at_rest(JointVector::from_element(0.1));
        let qdd = JointVector::from_element(2.0);
        let mut found = Demonstration {
            states: vec![state, integrator::step(&state, &qdd, CONTROL_DT)],
            accelerations: vec![qdd],
            contact_row: 1,
            clearance: 0.0,
            num_restarts: 0,
            goal_error: GoalError::default(),
        };
        check_rows(&found).unwrap();
        found.states[1].q[3] += 1e-8;
        assert!(check_rows(&found).unwrap_err().to_string().contains("row 0 violates"));
    }
}
