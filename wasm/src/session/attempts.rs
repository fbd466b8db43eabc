//! Start of attempts, with the policy, the planner or the grasps of a search.

use super::{Session, worker_failed};
use crate::familiarity_text;
use crate::object_import::LoadedObject;
use crate::protocol::{Cloud, Failure, PlanarPose, PlaybackInfo};
use geometry::Vec3;
use grasps::set::grasp::Grasp;
use js_sys::Float32Array;
use rollout::{Attempt, Controller, RolloutError};
use serde_bytes::ByteBuf;
use std::sync::Arc;

impl Session {
    /// Starts an attempt with the policy, or without one with the planner.
    pub(crate) fn start_grasp(&mut self, seed: u32) -> Result<Cloud, Failure> {
        let PlanarPose { x, y, yaw } = self.pose;
        let attempt =
            self.new_attempt(Some([x, y, yaw]), seed).map_err(|error| start_failure(&error))?;
        (self.playback, self.seed) = (None, seed);
        Ok(self.start_attempt(attempt))
    }

    /// Attempt with the current object at this pose; `None` samples the pose from the seed.
    pub(crate) fn new_attempt(
        &self,
        pose: Option<[f32; 3]>,
        seed: u32,
    ) -> Result<Attempt, RolloutError> {
        let has_policy = self.context.model.is_some();
        let controller = if has_policy { Controller::Policy } else { Controller::Planner };
        let LoadedObject { object, name, label, .. } = &self.loaded;
        let name = name.as_ref().unwrap_or(label);
        Attempt::new(&self.context, object, name, pose, u64::from(seed), controller)
    }

    /// Starts an attempt with the grasps of a search, if they belong to the current object.
    pub(crate) fn start_with_grasps(
        &mut self,
        seed: u32,
        grasps: &[ByteBuf],
        object_hash: &str,
    ) -> Result<Cloud, Failure> {
        if object_hash != self.object_hash {
            return Err(grasp_object_mismatch());
        }
        let grasps = grasps.iter().map(|grasp| Grasp::from_bytes(grasp));
        let grasps: Vec<Grasp> =
            grasps.collect::<Result<_, _>>().map_err(|error| worker_failed(&error))?;
        let PlanarPose { x, y, yaw } = self.pose;
        let LoadedObject { object, name, label, .. } = &self.loaded;
        let name = name.as_ref().unwrap_or(label);
        let (pose, controller) = (Some([x, y, yaw]), Controller::PlannedGrasps(Arc::new(grasps)));
        let attempt = Attempt::new(&self.context, object, name, pose, u64::from(seed), controller)
            .map_err(|error| start_failure(&error))?;
        self.seed = seed;
        let description = format!("Grasp from search ({label})");
        let closing_label = "Executing a grasp from the search";
        self.playback = Some(PlaybackInfo { description, closing_label, final_state_hash: None });
        Ok(self.start_attempt(attempt))
    }

    pub(super) fn start_attempt(&mut self, attempt: Attempt) -> Cloud {
        let array = |points: &[Vec3]| {
            let numbers: Vec<f32> = points.iter().flat_map(|p| p.to_array()).collect();
            Float32Array::from(numbers.as_slice())
        };
        let points = array(attempt.cloud());
        let reconstruction = array(&attempt.reconstruction(&self.context).unwrap_or_default());
        let familiarity =
            attempt.familiarity(&self.context).as_ref().map(familiarity_text::describe);
        self.attempt = Some(attempt);
        self.is_outcome_posted = false;
        self.settle_ticks = 0;
        self.history.clear();
        self.push_snapshot();
        Cloud { points, reconstruction, familiarity }
    }
}

fn grasp_object_mismatch() -> Failure {
    Failure {
        code: "grasp_object_mismatch",
        message: "The grasps of the search belong to another object.".into(),
        hint: "Search again for the current object.".into(),
    }
}

/// Failure of an attempt that cannot start.
pub(crate) fn start_failure(error: &RolloutError) -> Failure {
    let (code, hint) = match error {
        RolloutError::NoGrasps(_) | RolloutError::NoModel => (
            "no_policy",
            "Use the grasp search, which needs no policy; choose the sugar box; or reload the page to load the policy.",
        ),
        _ => ("attempt_start_failed", "Choose another object."),
    };
    Failure { code, message: format!("The attempt cannot start: {error}."), hint: hint.into() }
}
