//! The demonstrations of one object pose: planned, reversed, every one replayed in physics.

use crate::config::DatasetConfig;
use crate::part::{Attempt, Fate, Part};
use crate::poses::common_target;
use anyhow::{Context, Result, ensure};
use geometry::object::Object;
use grasps::demonstration::{self, Demonstration, TrajectoryConfig};
use grasps::trial::{Endurance, Physics, TrialOutcome};
use grasps::{Grasp, Posture, Setting, Way, lift};
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use robot::{JointState, integrator};
use scene::config::CONTROL_PERIOD;
use std::collections::BTreeSet;

/// Attempts without success after which the next grasp is tried.
const HOPELESS: usize = 3;

/// Attempts at a pose, as many times the demonstrations that are wanted.
const PATIENCE: usize = 2;

/// More than the targets of any pose.
const MOST_TARGETS: usize = 1 << 20;

/// Greatest error of Eq. 6 and 7 in a row, before rounding to the disk's precision.
const ROW_ERROR: f64 = 1e-9;

/// How far beside a pose another grasp may come first (m, rad): about as far as the nearest of 400 object poses stands,
/// at whose start an attempt begins.
const OVERLAP_SHIFT: f32 = 0.03;
const OVERLAP_TURN: f32 = 0.3;

/// How far an object is off in a perturbed replay: along x and y (m), about the vertical (rad), and the share of
/// its friction.
const SHIFT: f32 = 0.002;
const TURN: f32 = 0.0349;
const FRICTION: f32 = 0.1;

/// An object with its grasps at one pose.
pub(crate) struct Post<'a> {
    pub(crate) config: &'a DatasetConfig,
    pub(crate) name: &'a str,
    pub(crate) grasps: &'a [Grasp],
    pub(crate) setting: Setting<'a>,
    pub(crate) pose: [f32; 3],
    /// Index of the pose.
    pub(crate) index: usize,
    /// A generator of its own for what is named by a word and an index.
    pub(crate) rng: &'a dyn Fn(&str, usize) -> ChaCha8Rng,
}

impl Post<'_> {
    /// Adds the attempts with the first grasp that works, and what went before, to `part`; then, if the configuration
    /// says so, those by the ways that come first beside the pose.
    pub(crate) fn demonstrate(&self, part: &mut Part) -> Result<()> {
        part.offsets.push(0);
        let mut tried = BTreeSet::new();
        for (way, posture) in self.setting.options(self.grasps) {
            tried.insert(way);
            if self.try_posture(way.grasp, &posture, part)? > 0 {
                part.jump = self.jump(way, &posture);
                break;
            }
        }
        if self.config.overlap {
            let beside: BTreeSet<Way> = self.first_beside().collect();
            for &way in beside.difference(&tried) {
                if let Some(posture) = self.setting.reach_by(way, self.grasps) {
                    self.try_posture(way.grasp, &posture, part)?;
                }
            }
        }
        Ok(())
    }

    /// The ways that come first at the poses beside this one.
    fn first_beside(&self) -> impl Iterator<Item = Way> {
        let ([x, y, yaw], config) = (self.pose, &self.setting.robot.config);
        let [shift, turn] = [OVERLAP_SHIFT, OVERLAP_TURN];
        [[shift, 0.0, 0.0], [0.0, shift, 0.0], [0.0, 0.0, turn]]
            .into_iter()
            .flat_map(|step| [1.0, -1.0].map(|sign| step.map(|along: f32| sign * along)))
            .filter_map(move |[dx, dy, dyaw]| {
                let beside = self.setting.elsewhere(&config.upright(x + dx, y + dy, yaw + dyaw));
                beside.options(self.grasps).next().map(|(way, _)| way)
            })
    }

    /// Demonstrations of one posture; gives up on one that does not work at once. Gives the number kept.
    fn try_posture(&self, grasp: usize, posture: &Posture, part: &mut Part) -> Result<usize> {
        let robot = self.setting.robot;
        let lift = lift::plan_after(&self.setting, posture)?;
        let lift = lift.filter(|lift| lift::rises_enough(robot, lift));
        let Some(lift) = lift else { return Ok(0) };
        let palm = robot.tree.kinematics(&posture.touch).palm();
        let trajectories = TrajectoryConfig::standard();
        let mut kept = 0;
        let mut audited = part.attempts.iter().filter(|before| before.full.is_some()).count();
        for target in 0..PATIENCE * self.config.trajectories {
            if kept == self.config.trajectories || (kept == 0 && target == HOPELESS) {
                break;
            }
            // The same beginnings at every pose of the object.
            let mut rng = (self.rng)("target", target);
            let object = self.setting.object;
            let above = common_target(robot, object, self.pose, &palm, &mut rng);
            let planned = demonstration::demonstrate(&self.setting, posture, &above, &trajectories);
            let mut attempt = Attempt::planned(target, grasp, planned.as_ref());
            attempt.in_reach = robot.reaches(&above, posture);
            if let Ok(found) = planned {
                check_rows(&found).with_context(|| format!("{} at {:?}", self.name, self.pose))?;
                let brief = Endurance::BRIEF;
                let outcome = found.replay(Physics::Hand, &self.setting, &lift, brief)?;
                attempt.fate = Fate::of_outcome(outcome);
                if let TrialOutcome::Lifted { slip } = outcome {
                    attempt.slip = slip;
                }
                if audited < self.config.audits {
                    audited += 1;
                    self.audit(&found, &lift, &mut attempt)?;
                }
                if attempt.fate == Fate::Kept {
                    kept += 1;
                    part.push(&found);
                    if kept <= self.config.perturbed {
                        let mut rng = (self.rng)("perturbed", self.index * MOST_TARGETS + target);
                        attempt.perturbed = Some(self.perturbed(&found, &lift, &mut rng)?);
                    }
                }
            }
            part.attempts.push(attempt);
        }
        Ok(kept)
    }

    /// Replays with arm and hand, briefly and as long as the protocol.
    fn audit(
        &self,
        found: &Demonstration,
        lift: &[JointState],
        attempt: &mut Attempt,
    ) -> Result<()> {
        let fate = |endurance| -> Result<Fate> {
            let outcome = found.replay(Physics::Full, &self.setting, lift, endurance)?;
            Ok(Fate::of_outcome(outcome))
        };
        let endured = fate(Endurance::FULL)?;
        // What bears the long trial has passed the short one on the way.
        let full = if endured == Fate::Kept { endured } else { fate(Endurance::BRIEF)? };
        (attempt.endured, attempt.full) = (Some(endured), Some(full));
        Ok(())
    }

    /// Replays with arm and hand while the object stands a little beside its place and is a little smoother or
    /// rougher.
    fn perturbed(
        &self,
        found: &Demonstration,
        lift: &[JointState],
        rng: &mut impl Rng,
    ) -> Result<Fate> {
        let Setting { robot, object, .. } = self.setting;
        let mut draw = |most: f32| rng.random_range(-most..=most);
        let [x, y, yaw] = self.pose;
        let here = robot.config.upright(x + draw(SHIFT), y + draw(SHIFT), yaw + draw(TURN));
        let friction = object.friction * (1.0 + draw(FRICTION));
        let object: Object = object.clone().with_friction(friction);
        let setting = Setting { object: &object, ..self.setting.elsewhere(&here) };
        let outcome = found.replay(Physics::Full, &setting, lift, Endurance::BRIEF)?;
        Ok(Fate::of_outcome(outcome))
    }

    /// Greatest difference (rad) of a joint between this posture and that for the object a little beside.
    fn jump(&self, way: Way, posture: &Posture) -> f32 {
        let [x, y, yaw] = self.pose;
        let config = &self.setting.robot.config;
        let beside = [[x + 0.02, y, yaw], [x, y + 0.02, yaw], [x, y, yaw + 0.1]];
        let postures = beside.iter().filter_map(|&[x, y, yaw]| {
            self.setting.elsewhere(&config.upright(x, y, yaw)).reach_by(way, self.grasps)
        });
        postures.map(|other| (other.touch - posture.touch).amax() as f32).fold(0.0, f32::max)
    }
}

impl Attempt {
    fn planned(
        target: usize,
        grasp: usize,
        planned: Result<&Demonstration, &demonstration::Flaw>,
    ) -> Self {
        let none = Self {
            target,
            grasp,
            fate: Fate::Stuck,
            full: None,
            endured: None,
            perturbed: None,
            rows: 0,
            touch: 0,
            restarts: 0,
            clearance: 0.0,
            jerk: 0.0,
            slip: 0.0,
            in_reach: false,
            miss: [0.0; 2],
        };
        match planned {
            Err(flaw) => Self { fate: Fate::of_flaw(*flaw), ..none },
            Ok(found) => Self {
                rows: found.accelerations.len(),
                touch: found.touch,
                restarts: found.restarts,
                clearance: found.clearance,
                jerk: integrator::jerk(&found.accelerations[..found.touch], CONTROL_PERIOD) as f32,
                miss: [found.miss.distance as f32, found.miss.angle as f32],
                ..none
            },
        }
    }
}

/// Every row satisfies Eq. 6 and 7.
fn check_rows(found: &Demonstration) -> Result<()> {
    for (row, (pair, qdd)) in found.states.windows(2).zip(&found.accelerations).enumerate() {
        let next = integrator::step(&pair[0], qdd, CONTROL_PERIOD);
        let error = (next.q - pair[1].q).amax().max((next.qd - pair[1].qd).amax());
        ensure!(error < ROW_ERROR, "row {row} is off Eq. 6 and 7 by {error}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use grasps::demonstration::Miss;
    use rand::SeedableRng;
    use robot::JointVector;

    #[test]
    fn where_one_grasp_takes_over_from_another_both_come_first_nearby() {
        let robot = grasps::Robot::standard().unwrap();
        let object = Object::built_in("bleach").unwrap();
        let grasps = grasps::built_in::built_in("bleach").unwrap().grasps;
        let config = DatasetConfig::preset("variants", 0).unwrap();
        let anywhere = Setting::anywhere(&robot, &object);
        // The grasp that comes first at a yaw, and those that do nearby.
        let at = |step: usize| {
            let pose = [0.6, 0.0, OVERLAP_TURN * step as f32];
            let post = Post {
                config: &config,
                name: "bleach",
                grasps: &grasps,
                setting: anywhere.elsewhere(&robot.config.upright(pose[0], pose[1], pose[2])),
                pose,
                index: step,
                rng: &|_, _| ChaCha8Rng::from_seed([0; 32]),
            };
            let first = post.setting.options(&grasps).next().map(|(way, _)| way);
            (first, post.first_beside().collect::<BTreeSet<Way>>())
        };
        let found: Vec<_> = (0..21).map(at).collect();
        let firsts: BTreeSet<_> = found.iter().filter_map(|(first, _)| *first).collect();
        assert!(firsts.len() > 1, "one grasp serves every yaw: {firsts:?}");
        for pair in found.windows(2) {
            let [(one, near_one), (other, near_other)] = pair else { continue };
            assert!(other.is_none_or(|grasp| near_one.contains(&grasp)), "{pair:?}");
            assert!(one.is_none_or(|grasp| near_other.contains(&grasp)), "{pair:?}");
        }
    }

    #[test]
    fn a_row_that_breaks_eq6_is_found() {
        let state = JointState::at_rest(JointVector::from_element(0.1));
        let qdd = JointVector::from_element(2.0);
        let mut found = Demonstration {
            states: vec![state, integrator::step(&state, &qdd, CONTROL_PERIOD)],
            accelerations: vec![qdd],
            touch: 1,
            clearance: 0.0,
            restarts: 0,
            miss: Miss::default(),
        };
        check_rows(&found).unwrap();
        found.states[1].q[3] += 1e-8;
        assert!(check_rows(&found).unwrap_err().to_string().contains("row 0 is off"));
    }
}
