//! Session state: robot, object and current attempt.

mod attempts;
mod frames;
mod grasp_search;
mod playback;

pub(crate) use attempts::start_failure;

use crate::fetch::ModelFiles;
use crate::history::History;
use crate::object_import::{self, LoadedObject};
use crate::outcome_text;
use crate::protocol::{
    BatchAttempt, BuiltIn, DepthCamera, Drag, Failure, Joint, Link, ObjectLoaded, Outcome,
    PlanarPose, PlaybackInfo, Ready, Rectangle, SavedFile, Shape, Table,
};
use crate::robot_visuals;
use crate::statistics::{AttemptStatistics, Tally};
use geometry::Vec3;
use grasps::search::GraspSearch;
use rollout::{Attempt, RolloutContext};
use scene::config::CONTROL_DT;
use scene::scene_hash;
use serde_bytes::ByteBuf;
use std::collections::BTreeMap;

/// Robot, table and object, with or without an attempt.
pub(crate) struct Session {
    pub(crate) context: RolloutContext,
    /// Id and hash of the loaded model; `None` for the planner.
    model: Option<(String, String)>,
    loaded: LoadedObject,
    /// Hash of the current object, from [`objects::object::Object::hash`].
    object_hash: String,
    pose: PlanarPose,
    /// Seed from which the pose was sampled; `None` for a custom pose.
    pose_seed: Option<u32>,
    attempt: Option<Attempt>,
    /// Remaining ticks of simulation after the outcome. They show a released object that settles, and the
    /// consequence of a failure; they are not part of the attempt.
    settle_ticks: usize,
    history: History,
    /// Whether telemetry is recorded with each tick.
    streams_telemetry: bool,
    /// Whether the outcome has been posted.
    is_outcome_posted: bool,
    /// Search for grasps of the current object, while it runs.
    search: Option<GraspSearch>,
    /// Replayed file or grasp search of the current attempt.
    playback: Option<PlaybackInfo>,
    seed: u32,
    /// By the hashes of model and object.
    statistics: BTreeMap<(Option<String>, String), AttemptStatistics>,
}

/// Ticks (1.5 s) in which a dropped object settles.
const SETTLE_TICKS: usize = 45;

/// Ticks (1 s) that show the consequence of a failure.
const FAILURE_TICKS: usize = 30;

impl Session {
    /// Default scene with the first built-in object at the pose of seed 0.
    pub(crate) fn new() -> Result<Self, Failure> {
        let context = RolloutContext::new().map_err(|error| worker_failed(&error))?;
        let first = object_import::built_in_names().next().unwrap_or_default();
        let pose = sample_pose(&context, 0);
        let loaded = object_import::load_built_in(first)?;
        Ok(Self {
            context,
            model: None,
            object_hash: loaded.object.hash(),
            loaded,
            pose,
            pose_seed: Some(0),
            attempt: None,
            history: History::default(),
            streams_telemetry: false,
            is_outcome_posted: false,
            settle_ticks: 0,
            search: None,
            playback: None,
            seed: 0,
            statistics: BTreeMap::new(),
        })
    }

    /// First event of the worker, with the static data of the scene.
    pub(crate) fn ready_event(&self) -> Result<Ready, Failure> {
        let config = &self.context.robot.config;
        let tree = &self.context.robot.tree;
        let parts = robot_visuals::link_visuals(tree).map_err(|error| worker_failed(&error))?;
        let link = |part: robot_visuals::LinkVisual| Link {
            body: part.body,
            color: part.color,
            shape: Shape::from_mesh(&part.mesh),
        };
        let built_in = |name| {
            let shape = Shape::from_mesh(&object_import::load_built_in(name)?.object.mesh);
            Ok(BuiltIn { name, label: object_import::display_name(name), shape })
        };
        let objects: Result<_, Failure> = object_import::built_in_names().map(built_in).collect();
        Ok(Ready {
            links: parts.into_iter().map(link).collect(),
            table: Table { center: config.table.center, half: config.table.half_extents },
            workspace: Rectangle { x: config.workspace.x, y: config.workspace.y },
            camera: DepthCamera {
                position: config.camera.position,
                target: config.camera.target,
                hfov_deg: config.camera.hfov_deg,
                aspect: config.camera.width as f32 / config.camera.height as f32,
            },
            objects: objects?,
            joints: self.joints(),
            scene_hash: scene_hash(),
            max_mesh_bytes: mesh::MAX_BYTES,
        })
    }

    fn joints(&self) -> Vec<Joint> {
        let tree = &self.context.robot.tree;
        let joint = |(i, joint): (usize, &robot::tree::Joint)| Joint {
            name: joint.name.clone(),
            body: i + 1,
            lower: tree.limits.lower[i] as f32,
            upper: tree.limits.upper[i] as f32,
        };
        tree.joints.iter().enumerate().map(joint).collect()
    }

    /// Replaces the object.
    pub(crate) fn load(&mut self, loaded: LoadedObject) {
        self.object_hash = loaded.object.hash();
        self.loaded = loaded;
        self.search = None;
        self.reset();
    }

    /// Event about the current object.
    pub(crate) fn object_event(&self) -> ObjectLoaded {
        self.loaded.to_event(self.tally())
    }

    /// Attempts of the current model with the current object.
    pub(crate) fn tally(&self) -> Tally {
        self.statistics
            .get(&self.statistics_key())
            .map(AttemptStatistics::tally)
            .unwrap_or_default()
    }

    fn statistics_key(&self) -> (Option<String>, String) {
        (self.model.as_ref().map(|(_, hash)| hash.clone()), self.object_hash.clone())
    }

    /// Id and hash of the loaded model; `None` for the planner.
    pub(crate) fn model(&self) -> Option<&(String, String)> {
        self.model.as_ref()
    }

    /// Discards the attempt: the robot returns to its home configuration, the object to its start pose.
    pub(crate) fn reset(&mut self) {
        (self.attempt, self.playback, self.settle_ticks) = (None, None, 0);
        self.history.clear();
    }

    /// Moves the object to the nearest pose in the workspace and discards the attempt. Poses that are not
    /// finite are ignored.
    pub(crate) fn place(&mut self, pose: PlanarPose) {
        if ![pose.x, pose.y, pose.yaw].iter().all(|number| number.is_finite()) {
            return;
        }
        let workspace = &self.context.robot.config.workspace;
        let full_turn = std::f32::consts::TAU;
        self.pose = PlanarPose {
            x: pose.x.clamp(workspace.x[0], workspace.x[1]),
            y: pose.y.clamp(workspace.y[0], workspace.y[1]),
            yaw: pose.yaw - full_turn * (pose.yaw / full_turn).round(),
        };
        self.pose_seed = None;
        self.reset();
    }

    /// Moves the object to the pose that an attempt with this seed samples.
    pub(crate) fn place_by_seed(&mut self, seed: u32) {
        self.pose = sample_pose(&self.context, seed);
        self.pose_seed = Some(seed);
        self.reset();
    }

    /// Loads a model and discards the attempt. If the files are invalid, the previous model stays. A playback
    /// does not depend on the model and continues.
    pub(crate) fn load_model(&mut self, id: &str, files: &ModelFiles) -> Result<(), Failure> {
        let ModelFiles { weights, start_configurations, config } = files;
        let loaded = self.context.load_model(weights, start_configurations, config);
        let hash = loaded.map_err(|error| Failure {
            code: "invalid_model",
            message: format!("Policy \"{id}\" cannot be loaded: {error}."),
            hint: "Retrain it with this version of the program, or download a matching model."
                .into(),
        })?;
        self.model = Some((id.into(), hash));
        if self.playback.is_none() {
            self.reset();
        }
        Ok(())
    }

    /// Whether an attempt or a playback from the history is running.
    pub(crate) fn is_busy(&self) -> bool {
        let is_unfinished =
            |attempt: &Attempt| attempt.outcome().is_none() || self.settle_ticks > 0;
        let is_running = self.attempt.as_ref().is_some_and(is_unfinished);
        is_running || self.history.is_scrubbing()
    }

    /// Advances by one control period.
    pub(crate) fn tick(&mut self) {
        if self.history.is_scrubbing() {
            self.history.advance();
        } else if let Some(attempt) = &mut self.attempt {
            let is_running = attempt.outcome().is_none();
            match is_running {
                true => attempt.step(&self.context),
                false => attempt.step_after_outcome(),
            }
            let has_failed = attempt.outcome().is_some_and(|outcome| !outcome.is_lifted());
            // A simulation that diverged has no evidence and does not continue.
            let has_just_failed = is_running && has_failed && attempt.evidence().is_some();
            self.settle_ticks = match (attempt.is_disturbed(), has_just_failed) {
                (true, _) => SETTLE_TICKS,
                (false, true) => FAILURE_TICKS,
                (false, false) => self.settle_ticks.saturating_sub(1),
            };
            self.push_snapshot();
        }
    }

    /// Pulls the object, or releases it.
    pub(crate) fn drag(&mut self, drag: Option<Drag>) {
        let Some(attempt) = &mut self.attempt else { return };
        let vector = |numbers: [f32; 3]| Some(Vec3::from(numbers)).filter(|v| v.is_finite());
        let drag = drag.and_then(|Drag { point, target }| vector(point).zip(vector(target)));
        attempt.drag(drag);
        if drag.is_some() {
            self.settle_ticks = SETTLE_TICKS;
            self.history.seek(usize::MAX);
        }
    }

    /// Displays the state after this tick.
    pub(crate) fn seek(&mut self, tick: usize) {
        self.history.seek(tick);
    }

    /// Counts an attempt of a batch. Returns the counts of the current policy with the object.
    pub(crate) fn count_batch_attempt(&mut self, attempt: &BatchAttempt) -> Tally {
        let PlanarPose { x, y, yaw } = attempt.pose;
        let statistics = self.statistics.entry(self.statistics_key()).or_default();
        statistics.count(attempt.seed, [x, y, yaw], attempt.lifted);
        statistics.tally()
    }

    /// The current object for another worker.
    pub(crate) fn object_bytes(&self) -> ByteBuf {
        ByteBuf::from(self.loaded.object.to_bytes())
    }

    /// The attempt as a file for `ngf replay`; `None` for disturbed attempts, which are not reproducible.
    pub(crate) fn recording_file(&self) -> Option<SavedFile> {
        let attempt = self.attempt.as_ref().filter(|attempt| !attempt.was_disturbed())?;
        let text = serde_json::to_string(&attempt.recording()).ok()?;
        Some(SavedFile { name: format!("{}-{}.json", self.loaded.label, attempt.seed()), text })
    }

    /// Outcome of the attempt if it has ended; counts it and returns it only once.
    pub(crate) fn take_outcome(&mut self) -> Option<Outcome> {
        let attempt = self.attempt.as_ref().filter(|_| !self.is_outcome_posted)?;
        let outcome = attempt.outcome()?;
        self.is_outcome_posted = true;
        let final_state_hash = attempt.state_hash();
        let statistics = self.statistics.entry(self.statistics_key()).or_default();
        let PlanarPose { x, y, yaw } = self.pose;
        if self.playback.is_none() && !attempt.was_disturbed() {
            statistics.count(self.seed, [x, y, yaw], outcome.is_lifted());
        }
        Some(Outcome {
            lifted: outcome.is_lifted(),
            text: outcome_text::headline(attempt, outcome).to_owned(),
            evidence: outcome_text::explanation(
                attempt,
                outcome,
                &self.context.robot.config.protocol,
            ),
            seed: self.seed,
            pose: self.pose,
            placed_by_hand: self.pose_seed != Some(self.seed),
            playback: self.playback.clone(),
            disturbed: attempt.was_disturbed(),
            final_state_hash,
            tally: statistics.tally(),
        })
    }
}

impl BatchAttempt {
    /// `None` before the outcome.
    pub(crate) fn of(attempt: &Attempt) -> Option<Self> {
        let outcome = attempt.outcome()?;
        let [x, y, yaw] = attempt.pose();
        Some(Self {
            seed: attempt.seed() as u32,
            pose: PlanarPose { x, y, yaw },
            lifted: outcome.is_lifted(),
            text: outcome_text::headline(attempt, outcome).to_owned(),
            time: attempt.ticks() as f64 * CONTROL_DT,
            final_state_hash: attempt.state_hash(),
        })
    }
}

/// Object pose that an attempt with this seed samples.
fn sample_pose(context: &RolloutContext, seed: u32) -> PlanarPose {
    let [x, y, yaw] = rollout::sample_object_pose(&context.robot, u64::from(seed));
    PlanarPose { x, y, yaw }
}

fn worker_failed(error: &dyn std::error::Error) -> Failure {
    Failure {
        code: "worker_failed",
        message: format!("The simulation failed: {error}."),
        hint: "Reload the page. If that does not help, report the error: this build is defective."
            .into(),
    }
}
