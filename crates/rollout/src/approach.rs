//! Everything before the policy acts: the look, the start configuration, and a quintic spline in joint
//! space that leads there (paper §IV).

use crate::controller::Controller;
use crate::library::Library;
use crate::verdict::Failure;
use crate::workcell::{RolloutError, Workcell};
use geometry::object::Object;
use geometry::{Pose, Vec3};
use grasps::built_in::built_in;
use grasps::demonstration::{self, TrajectoryConfig};
use grasps::grasp::Grasp;
use grasps::sides::all_sides;
use grasps::{Setting, lift, place};
use policy::{Encoding, Model};
use rand_chacha::ChaCha8Rng;
use robot::{Isometry, JointState, JointVector, spline};
use scene::config::CONTROL_PERIOD;

/// What is known when the approach is planned.
pub(crate) struct Sight<'a> {
    /// Where it happens.
    pub(crate) workcell: &'a Workcell,
    /// The object, of which a policy knows the cloud alone.
    pub(crate) object: &'a Object,
    /// Its name.
    pub(crate) name: &'a str,
    /// Where it stands.
    pub(crate) world_from_object: Pose,
    /// What the camera saw, base frame.
    pub(crate) cloud: &'a [Vec3],
    /// Where the palm of the start configuration should be.
    pub(crate) target: Isometry,
    /// Where the robot is (rad).
    pub(crate) home: JointVector,
}

/// A planned approach.
pub(crate) struct Approach {
    /// States from home on; those of the planner lead into the grasp.
    pub(crate) rows: Vec<JointState>,
    /// How many of them come before the grasp.
    pub(crate) ticks: usize,
    /// What the policy is told of the object.
    pub(crate) encoding: Option<Encoding>,
}

impl Sight<'_> {
    /// Plans the approach from `home`, or says why there is none.
    pub(crate) fn plan(
        &self,
        controller: &Controller,
        rng: &mut ChaCha8Rng,
    ) -> Result<Result<Approach, Failure>, RolloutError> {
        match controller {
            Controller::Replay(recording) => {
                let rows: Vec<JointState> = recording.rows.iter().skip(1).copied().collect();
                let ticks = recording.marks.policy.unwrap_or(rows.len());
                Ok(Ok(Approach { rows, ticks, encoding: None }))
            }
            Controller::Planner => {
                let unknown = || RolloutError::NoGrasps(self.name.to_owned());
                let set = built_in(self.name).ok_or_else(unknown)?;
                self.demonstrated(&set.grasps, rng)
            }
            Controller::Found(grasps) => self.demonstrated(grasps, rng),
            Controller::Demonstration(states) if states.is_empty() => Err(RolloutError::NoStates),
            Controller::Demonstration(states) => Ok(Ok(self.starting_at_home(states))),
            Controller::Nearest(library) => self.played_back(library),
            _ => self.looked_up(controller, rng),
        }
    }

    /// The first demonstration that can be planned with one of these grasps.
    fn demonstrated(
        &self,
        grasps: &[Grasp],
        rng: &mut ChaCha8Rng,
    ) -> Result<Result<Approach, Failure>, RolloutError> {
        let (robot, object, place) = (&self.workcell.robot, self.object, &self.world_from_object);
        let config = TrajectoryConfig::standard();
        let setting = Setting::new(robot, object, place);
        for (_, posture) in setting.options(&all_sides(object, grasps)) {
            let lift = lift::plan_after(&setting, &posture)?;
            if !lift.is_some_and(|lift| lift::rises_enough(robot, &lift)) {
                continue;
            }
            let palm = robot.tree.kinematics(&posture.touch).palm();
            let region = &robot.config.target;
            let above = demonstration::draw_target(region, &object.bounds, place, &palm, rng);
            let found = demonstration::demonstrate(&setting, &posture, &above, &config);
            let Ok(found) = found else { continue };
            return Ok(Ok(self.starting_at_home(&found.states)));
        }
        Ok(Err(Failure::Unreachable))
    }

    /// A spline to the first state of a demonstration, and then the demonstration.
    fn starting_at_home(&self, states: &[JointState]) -> Approach {
        let limits = &self.workcell.robot.tree.limits;
        let mut rows = spline::quintic(&self.home, &states[0].q, limits, CONTROL_PERIOD);
        let ticks = rows.len();
        rows.extend(&states[1..]);
        Approach { rows, ticks, encoding: None }
    }

    /// What is seen, and the start configuration that the model looks up for it (paper §III-F).
    fn start(&self) -> Result<Result<(&Model, Encoding, JointVector), Failure>, RolloutError> {
        let model = self.workcell.model.as_ref().ok_or(RolloutError::NoModel)?;
        let Some(seen) = model.observe(self.cloud) else { return Ok(Err(Failure::Unseen)) };
        let start = model.starts.find(&seen, &self.target);
        Ok(start.map(|start| (model, seen, start)).ok_or(Failure::Unreachable))
    }

    /// The demonstration that begins there.
    fn played_back(&self, library: &Library) -> Result<Result<Approach, Failure>, RolloutError> {
        Ok(self.start()?.and_then(|(_, seen, start)| {
            let states = library.from(&start, &seen).ok_or(Failure::Unreachable)?;
            Ok(self.starting_at_home(&states))
        }))
    }

    /// A spline to the start configuration, where the policy takes over.
    fn looked_up(
        &self,
        controller: &Controller,
        rng: &mut ChaCha8Rng,
    ) -> Result<Result<Approach, Failure>, RolloutError> {
        let robot = &self.workcell.robot;
        let (model, seen, start) = match self.start()? {
            Ok(found) => found,
            Err(failure) => return Ok(Err(failure)),
        };
        let zero = || vec![0.0; model.observation.size()];
        let encoding = match controller {
            Controller::ZeroLatent => Encoding { z: zero(), ..seen },
            Controller::ShuffledLatent => {
                let [x, y, yaw] = place::random_pose(robot, rng);
                let other = robot.config.upright(x, y, yaw);
                let cloud = look(self.workcell, self.object, &other, rng);
                let z = model.observe(&cloud).map_or_else(zero, |other| other.z);
                Encoding { z, ..seen }
            }
            _ => seen,
        };
        let rows = spline::quintic(&self.home, &start, &robot.tree.limits, CONTROL_PERIOD);
        Ok(Ok(Approach { ticks: rows.len(), rows, encoding: Some(encoding) }))
    }
}

/// One noisy frame as a cloud.
pub(crate) fn look(
    workcell: &Workcell,
    object: &Object,
    world_from_object: &Pose,
    rng: &mut ChaCha8Rng,
) -> Vec<Vec3> {
    let frame = workcell.eye.frame(&object.mesh, world_from_object, rng);
    workcell.eye.cloud(&frame)
}

/// Fingers closed as far as they go, where the hand is.
pub(crate) fn script(q: &JointVector, workcell: &Workcell) -> Vec<JointState> {
    let limits = &workcell.robot.tree.limits;
    let mut closed = *q;
    for finger in 0..robot::FINGERS {
        for joint in 1..4 {
            let i = robot::ARM + 4 * finger + joint;
            closed[i] = (q[i] + 0.9).min(limits.upper[i]);
        }
    }
    spline::quintic(q, &closed, limits, CONTROL_PERIOD)
}
