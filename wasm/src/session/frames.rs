//! Frames for display, and the history of the attempt.

use super::Session;
use crate::history::Snapshot;
use crate::protocol::{Frame, Phase};
use geometry::Pose;
use js_sys::Float32Array;
use robot::{JointVector, rotation};
use rollout::TelemetrySample;
use scene::ContactForce;
use scene::config::CONTROL_DT;
use std::borrow::Cow;

impl Session {
    /// Adds the current state to the history.
    pub(super) fn push_snapshot(&mut self) {
        let Some(attempt) = &self.attempt else { return };
        let scene = attempt.scene();
        let poses = scene.body_poses().chain([scene.object_pose()]);
        let tick = self.history.len();
        let telemetry = self.streams_telemetry.then(|| attempt.telemetry_at(&self.context, tick));
        self.history.push(Snapshot {
            poses: poses.flat_map(|pose| pose_values(&pose)).collect(),
            joints: attempt.commanded_state().q.iter().map(|q| *q as f32).collect(),
            contacts: attempt.contact_forces().iter().flat_map(contact_values).collect(),
            phase: attempt.phase().into(),
            telemetry,
        });
    }

    /// Turns the telemetry stream on or off. Returns the samples so far when it is turned on.
    pub(crate) fn stream_telemetry(&mut self, on: bool) -> Option<Vec<TelemetrySample>> {
        self.streams_telemetry = on;
        let attempt = self.attempt.as_ref().filter(|_| on)?;
        Some(self.history.telemetry(|tick| attempt.telemetry_at(&self.context, tick)))
    }

    /// Frame for display; the caller sets the clock's fields.
    pub(crate) fn frame(&self) -> Frame {
        let snapshot = match self.history.current() {
            Some(snapshot) => Cow::Borrowed(snapshot),
            None => Cow::Owned(self.home_snapshot()),
        };
        Frame {
            poses: Float32Array::from(snapshot.poses.as_slice()),
            pose: self.pose,
            pose_seed: self.pose_seed,
            playback: self.playback.clone(),
            phase: snapshot.phase,
            tick: self.history.tick(),
            ticks: self.history.last_tick(),
            phase_starts: self.history.phase_starts(),
            joints: Float32Array::from(snapshot.joints.as_slice()),
            commanded_poses: Float32Array::from(self.commanded_poses(&snapshot.joints).as_slice()),
            contacts: Float32Array::from(snapshot.contacts.as_slice()),
            telemetry: snapshot.telemetry.map(Into::into),
            time: self.history.tick() as f64 * CONTROL_DT,
            running: true,
            speed: 1.0,
            realtime_factor: None,
        }
    }

    /// Poses of the robot's bodies at these joint positions (rad), seven numbers per body.
    fn commanded_poses(&self, joints: &[f32]) -> Vec<f32> {
        let q = JointVector::from_iterator(joints.iter().map(|q| f64::from(*q)));
        let links = self.context.robot.tree.forward_kinematics(&q);
        links
            .world_from_body
            .iter()
            .flat_map(|pose| pose_values(&rotation::to_pose(pose)))
            .collect()
    }

    /// State before an attempt.
    fn home_snapshot(&self) -> Snapshot {
        let robot = &self.context.robot;
        let home = robot.config.home();
        let joints: Vec<f32> = home.iter().map(|q| *q as f32).collect();
        let object = robot.config.object_pose(self.pose.x, self.pose.y, self.pose.yaw);
        Snapshot {
            poses: self.commanded_poses(&joints).into_iter().chain(pose_values(&object)).collect(),
            joints,
            contacts: Vec::new(),
            phase: Phase::Idle,
            telemetry: None,
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
            rollout::Phase::Done => Self::Outcome,
        }
    }
}

/// Contact point (m) and force (N).
fn contact_values(contact: &ContactForce) -> [f32; 6] {
    let (p, f) = (contact.point, contact.force);
    [p.x, p.y, p.z, f.x, f.y, f.z]
}

/// Position (m) and quaternion (x, y, z, w).
fn pose_values(pose: &Pose) -> [f32; 7] {
    let (p, q) = (pose.translation, pose.rotation);
    [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
}
