//! What is drawn: how things stand, kept from tick to tick.

use super::Stage;
use crate::history::Picture;
use crate::protocol::{Frame, Phase};
use geometry::Pose;
use js_sys::Float32Array;
use robot::{JointVector, rotation};
use rollout::Moment;
use scene::config::CONTROL_PERIOD;
use scene::{Contact, Simulation};
use std::borrow::Cow;

impl Stage {
    /// Keeps how things stand.
    pub(super) fn record(&mut self) {
        let Some(attempt) = &self.attempt else { return };
        let scene = attempt.scene();
        let poses = scene.body_poses().chain([scene.object_pose()]);
        let now = self.history.len();
        let moment = self.is_watched.then(|| attempt.moment(&self.workcell, now));
        self.history.push(Picture {
            poses: poses.flat_map(|pose| seven(&pose)).collect(),
            joints: attempt.commanded().q.iter().map(|q| *q as f32).collect(),
            contacts: attempt.contacts().iter().flat_map(six).collect(),
            phase: attempt.phase().into(),
            moment,
        });
    }

    /// Whether the moments are wanted from now on; if so, those so far.
    pub(crate) fn watch(&mut self, on: bool) -> Option<Vec<Moment>> {
        self.is_watched = on;
        let attempt = self.attempt.as_ref().filter(|_| on)?;
        Some(self.history.moments(|tick| attempt.moment(&self.workcell, tick)))
    }

    /// What is to be drawn; the clock's figures are filled in by its owner.
    pub(crate) fn frame(&self) -> Frame {
        let picture = match self.history.shown() {
            Some(picture) => Cow::Borrowed(picture),
            None => Cow::Owned(self.at_home()),
        };
        Frame {
            poses: Float32Array::from(picture.poses.as_slice()),
            pose: self.pose,
            drawn: self.pose_seed,
            played: self.played.clone(),
            phase: picture.phase,
            tick: self.history.tick(),
            ticks: self.history.last(),
            marks: self.history.marks(),
            joints: Float32Array::from(picture.joints.as_slice()),
            target: Float32Array::from(self.target(&picture.joints).as_slice()),
            contacts: Float32Array::from(picture.contacts.as_slice()),
            moment: picture.moment,
            time: self.history.tick() as f64 * CONTROL_PERIOD,
            running: true,
            factor: 1.0,
            measured: None,
        }
    }

    /// Where these positions (rad) of all joints have the robot's bodies, seven numbers each.
    fn target(&self, joints: &[f32]) -> Vec<f32> {
        let q = JointVector::from_iterator(joints.iter().map(|q| f64::from(*q)));
        let links = self.workcell.robot.tree.kinematics(&q);
        links.world_from_body.iter().flat_map(|pose| seven(&rotation::to_pose(pose))).collect()
    }

    /// How things stand before an attempt.
    fn at_home(&self) -> Picture {
        let robot = &self.workcell.robot;
        let home = robot.config.home();
        let joints: Vec<f32> = home.iter().map(|q| *q as f32).collect();
        let object = robot.config.upright(self.pose.x, self.pose.y, self.pose.yaw);
        Picture {
            poses: self.target(&joints).into_iter().chain(seven(&object)).collect(),
            joints,
            contacts: Vec::new(),
            phase: Phase::Idle,
            moment: None,
        }
    }
}

impl From<rollout::Phase> for Phase {
    fn from(phase: rollout::Phase) -> Self {
        match phase {
            rollout::Phase::Approach => Self::Approach,
            rollout::Phase::Policy => Self::Policy,
            rollout::Phase::Lift => Self::Lift,
            rollout::Phase::Hold => Self::Hold,
            rollout::Phase::Done => Self::Verdict,
        }
    }
}

/// Where something presses, and with what force.
fn six(contact: &Contact) -> [f32; 6] {
    let (p, f) = (contact.point, contact.force);
    [p.x, p.y, p.z, f.x, f.y, f.z]
}

/// Position and quaternion.
fn seven(pose: &Pose) -> [f32; 7] {
    let (p, q) = (pose.translation, pose.rotation);
    [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
}
