//! How an attempt begins: by who acts, or by grasps that a search found.

use super::{Stage, broken};
use crate::likeness;
use crate::protocol::{Cloud, Failure, Found, PlanarPose, Played};
use crate::upload::Loaded;
use geometry::Vec3;
use grasps::grasp::Grasp;
use grasps::search::{SearchConfig, search};
use js_sys::Float32Array;
use rollout::{Attempt, Controller, RolloutError};
use std::sync::Arc;

impl Stage {
    /// Begins an attempt: by the policy, or while there is none by the planner.
    pub(crate) fn begin(&mut self, seed: u32) -> Result<Cloud, Failure> {
        let PlanarPose { x, y, yaw } = self.pose;
        let attempt =
            self.attempt(Some([x, y, yaw]), seed).map_err(|error| cannot_begin(&error))?;
        (self.played, self.seed) = (None, seed);
        Ok(self.set_off(attempt))
    }

    /// An attempt with what stands there, where the seed puts it unless that is told.
    pub(crate) fn attempt(
        &self,
        pose: Option<[f32; 3]>,
        seed: u32,
    ) -> Result<Attempt, RolloutError> {
        let has_policy = self.workcell.model.is_some();
        let controller = if has_policy { Controller::Policy } else { Controller::Planner };
        let Loaded { object, name, label, .. } = &self.loaded;
        let name = name.as_ref().unwrap_or(label);
        Attempt::begin(&self.workcell, object, name, pose, u64::from(seed), controller)
    }

    /// Searches grasps of what stands there, in physics.
    pub(crate) fn search(&self, seed: u32, progress: impl FnMut(f32)) -> Result<Found, Failure> {
        let robot = &self.workcell.robot;
        let config = SearchConfig::quick(robot);
        let found = search(robot, &self.loaded.object, &config, u64::from(seed), progress);
        let (set, _) = found.map_err(|error| broken(&error))?;
        let (tried, reliable) = (set.tried, set.reliable);
        let words = match set.grasps.len() {
            0 => format!("{tried} grasps were tried; none lifts it reliably."),
            _ => format!("{tried} grasps were tried; {reliable} lift it reliably."),
        };
        let grasps = serde_json::to_string(&set.grasps).map_err(|error| broken(&error))?;
        Ok(Found { words, grasps, object: self.object.clone(), count: set.grasps.len() })
    }

    /// Begins an attempt with grasps that a search found, if it is this object that they are of.
    pub(crate) fn follow(
        &mut self,
        seed: u32,
        grasps: &str,
        object: &str,
    ) -> Result<Cloud, Failure> {
        if object != self.object {
            return Err(of_another());
        }
        let grasps: Vec<Grasp> = serde_json::from_str(grasps).map_err(|error| broken(&error))?;
        let PlanarPose { x, y, yaw } = self.pose;
        let Loaded { object, name, label, .. } = &self.loaded;
        let known = name.as_ref().unwrap_or(label);
        let (pose, controller) = (Some([x, y, yaw]), Controller::Found(Arc::new(grasps)));
        let attempt =
            Attempt::begin(&self.workcell, object, known, pose, u64::from(seed), controller)
                .map_err(|error| cannot_begin(&error))?;
        self.seed = seed;
        let what = format!("Grasp searched for {label}");
        self.played = Some(Played { what, closes: "A searched grasp closes the hand", end: None });
        Ok(self.set_off(attempt))
    }

    pub(super) fn set_off(&mut self, attempt: Attempt) -> Cloud {
        let array = |points: &[Vec3]| {
            let numbers: Vec<f32> = points.iter().flat_map(|p| p.to_array()).collect();
            Float32Array::from(numbers.as_slice())
        };
        let points = array(attempt.cloud());
        let reconstruction = array(&attempt.reconstruction(&self.workcell).unwrap_or_default());
        let likeness = attempt.likeness(&self.workcell).as_ref().map(likeness::words);
        self.attempt = Some(attempt);
        self.is_told = false;
        self.settling = 0;
        self.history.clear();
        self.record();
        Cloud { points, reconstruction, likeness }
    }
}

fn of_another() -> Failure {
    Failure {
        code: "grasps_of_another",
        cause: "The grasps that were searched are of another object.".into(),
        cure: "Search again, for what stands there now.".into(),
    }
}

/// Why an attempt cannot begin.
pub(crate) fn cannot_begin(error: &RolloutError) -> Failure {
    let (code, cure) = match error {
        RolloutError::NoGrasps(_) | RolloutError::NoModel => (
            "policy_missing",
            "Search a grasp for it, which needs no policy; choose the sugar box; or load the page again for the policy.",
        ),
        _ => ("attempt_impossible", "Choose another object."),
    };
    Failure { code, cause: format!("The attempt cannot begin: {error}."), cure: cure.into() }
}
