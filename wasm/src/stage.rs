//! What stands on the table, and the attempt to lift it: all that the worker knows of the robot.

mod begin;
mod play;
mod show;

pub(crate) use begin::cannot_begin;

use crate::fetch::ModelFiles;
use crate::history::History;
use crate::look;
use crate::protocol::{
    Attempted, BuiltIn, DepthCamera, Failure, File, Joint, Link, ObjectLoaded, PlanarPose, Played,
    Pull, Ready, Rectangle, Shape, Table, Verdict,
};
use crate::statistics::{Attempts, Tally};
use crate::upload::{self, Loaded};
use geometry::Vec3;
use rollout::{Attempt, Workcell};
use scene::config::{CONTROL_PERIOD, scene_hash};
use std::collections::BTreeMap;

/// Robot, table and object, with an attempt or without.
pub(crate) struct Stage {
    pub(crate) workcell: Workcell,
    /// Id and hash of the model that acts, if one does.
    model: Option<(String, String)>,
    loaded: Loaded,
    /// Of what stands there, from [`geometry::object::Object::hash`].
    object: String,
    pose: PlanarPose,
    /// The seed that the pose was drawn from, unless the object was placed by hand.
    pose_seed: Option<u32>,
    attempt: Option<Attempt>,
    /// Control periods that the world still goes on for: what was let go after the verdict comes to rest.
    settling: usize,
    history: History,
    /// Whether the moments are wanted.
    is_watched: bool,
    /// Whether the verdict has been told.
    is_told: bool,
    /// What is played, if something is.
    played: Option<Played>,
    seed: u32,
    /// By the hashes of model and object.
    attempts: BTreeMap<(Option<String>, String), Attempts>,
}

/// Control periods, a second and a half, in which what falls from the hand comes to rest.
const SETTLING: usize = 45;

impl Stage {
    /// The standard scene with the first built-in object, where seed 0 puts it.
    pub(crate) fn new() -> Result<Self, Failure> {
        let workcell = Workcell::new().map_err(|error| broken(&error))?;
        let first = upload::names().next().unwrap_or_default();
        let pose = draw_pose(&workcell, 0);
        let loaded = upload::built_in(first)?;
        let object = loaded.object.hash();
        let attempts = BTreeMap::new();
        let pose_seed = Some(0);
        let (model, attempt, played, seed) = (None, None, None, 0);
        let (history, is_watched, is_told) = (History::default(), false, false);
        Ok(Self {
            workcell,
            model,
            loaded,
            object,
            pose,
            pose_seed,
            attempt,
            history,
            is_watched,
            is_told,
            settling: 0,
            played,
            seed,
            attempts,
        })
    }

    /// What the page needs once.
    pub(crate) fn ready(&self) -> Result<Ready, Failure> {
        let config = &self.workcell.robot.config;
        let tree = &self.workcell.robot.tree;
        let parts = look::parts(tree).map_err(|error| broken(&error))?;
        let link = |part: look::Part| Link {
            body: part.body,
            color: part.color,
            shape: Shape::of(&part.mesh),
        };
        let built_in = |name| {
            let shape = Shape::of(&upload::built_in(name)?.object.mesh);
            Ok(BuiltIn { name, label: upload::label(name), shape })
        };
        let objects: Result<_, Failure> = upload::names().map(built_in).collect();
        Ok(Ready {
            links: parts.into_iter().map(link).collect(),
            table: Table { center: config.table.center, half: config.table.half },
            workspace: Rectangle { x: config.workspace.x, y: config.workspace.y },
            camera: DepthCamera {
                position: config.camera.position,
                target: config.camera.target,
                hfov_deg: config.camera.hfov_deg,
                aspect: config.camera.width as f32 / config.camera.height as f32,
            },
            objects: objects?,
            joints: self.joints(),
            scene: scene_hash(),
            most_bytes: geometry::mesh::MAX_BYTES,
        })
    }

    fn joints(&self) -> Vec<Joint> {
        let tree = &self.workcell.robot.tree;
        let joint = |(i, joint): (usize, &robot::tree::Joint)| Joint {
            name: joint.name.clone(),
            body: i + 1,
            lower: tree.limits.lower[i] as f32,
            upper: tree.limits.upper[i] as f32,
        };
        tree.joints.iter().enumerate().map(joint).collect()
    }

    /// Puts another object there.
    pub(crate) fn load(&mut self, loaded: Loaded) {
        self.object = loaded.object.hash();
        self.loaded = loaded;
        self.reset();
    }

    /// What the page shows of it.
    pub(crate) fn object(&self) -> ObjectLoaded {
        self.loaded.message(self.tally())
    }

    /// Attempts so far with this object by who acts now.
    pub(crate) fn tally(&self) -> Tally {
        self.attempts.get(&self.actors()).map(Attempts::tally).unwrap_or_default()
    }

    fn actors(&self) -> (Option<String>, String) {
        (self.model.as_ref().map(|(_, hash)| hash.clone()), self.object.clone())
    }

    /// Id and hash of the model that acts, if one does.
    pub(crate) fn model(&self) -> Option<&(String, String)> {
        self.model.as_ref()
    }

    /// Ends the attempt, if there is one: the robot is home, the object where it was.
    pub(crate) fn reset(&mut self) {
        (self.attempt, self.played, self.settling) = (None, None, 0);
        self.history.clear();
    }

    /// Moves the object to the nearest pose in the workspace, which ends an attempt. What is no pose
    /// moves nothing.
    pub(crate) fn place(&mut self, pose: PlanarPose) {
        if ![pose.x, pose.y, pose.yaw].iter().all(|number| number.is_finite()) {
            return;
        }
        let workspace = &self.workcell.robot.config.workspace;
        let turn = std::f32::consts::TAU;
        self.pose = PlanarPose {
            x: pose.x.clamp(workspace.x[0], workspace.x[1]),
            y: pose.y.clamp(workspace.y[0], workspace.y[1]),
            yaw: pose.yaw - turn * (pose.yaw / turn).round(),
        };
        self.pose_seed = None;
        self.reset();
    }

    /// Moves the object to where an attempt with this seed finds it when no pose is given.
    pub(crate) fn place_by_seed(&mut self, seed: u32) {
        self.pose = draw_pose(&self.workcell, seed);
        self.pose_seed = Some(seed);
        self.reset();
    }

    /// Takes a model's three files, which ends an attempt by another one; if they are unusable, that one stays. What is
    /// played asks no model, and goes on.
    pub(crate) fn load_model(&mut self, id: &str, files: &ModelFiles) -> Result<(), Failure> {
        let ModelFiles { weights, starts, config } = files;
        let loaded = self.workcell.load_model(weights, starts, config);
        let hash = loaded.map_err(|error| Failure {
            code: "model_unusable",
            cause: format!("The policy \"{id}\" cannot be used: {error}."),
            cure: "Train it again with this version of the program, or fetch its own model.".into(),
        })?;
        self.model = Some((id.into(), hash));
        if self.played.is_none() {
            self.reset();
        }
        Ok(())
    }

    /// Whether an attempt is under way, or is looked at again.
    pub(crate) fn is_busy(&self) -> bool {
        let goes_on = |attempt: &Attempt| attempt.verdict().is_none() || self.settling > 0;
        let is_under_way = self.attempt.as_ref().is_some_and(goes_on);
        is_under_way || self.history.is_behind()
    }

    /// One control period.
    pub(crate) fn tick(&mut self) {
        if self.history.is_behind() {
            self.history.advance();
        } else if let Some(attempt) = &mut self.attempt {
            match attempt.verdict() {
                None => attempt.tick(&self.workcell),
                Some(_) => attempt.linger(),
            }
            self.settling = match attempt.is_pulled() {
                true => SETTLING,
                false => self.settling.saturating_sub(1),
            };
            self.record();
        }
    }

    /// Pulls at the object, or lets go.
    pub(crate) fn pull(&mut self, pull: Option<Pull>) {
        let Some(attempt) = &mut self.attempt else { return };
        let vector = |numbers: [f32; 3]| Some(Vec3::from(numbers)).filter(|v| v.is_finite());
        let pull = pull.and_then(|Pull { point, towards }| vector(point).zip(vector(towards)));
        attempt.pull(pull);
        if pull.is_some() {
            self.settling = SETTLING;
            self.history.seek(usize::MAX);
        }
    }

    /// Shows how it was after this tick.
    pub(crate) fn seek(&mut self, tick: usize) {
        self.history.seek(tick);
    }

    /// How an attempt of a batch ended, which counts it.
    pub(crate) fn attempted(
        &mut self,
        run: u32,
        row: Tally,
        attempt: &Attempt,
        verdict: rollout::Verdict,
    ) -> Attempted {
        let [x, y, yaw] = attempt.pose();
        let seed = attempt.seed() as u32;
        let attempts = self.attempts.entry(self.actors()).or_default();
        attempts.count(seed, attempt.pose(), verdict.is_lifted());
        Attempted {
            run,
            seed,
            pose: PlanarPose { x, y, yaw },
            lifted: verdict.is_lifted(),
            words: verdict.words().to_owned(),
            time: attempt.ticks() as f64 * CONTROL_PERIOD,
            hash: attempt.state_hash(),
            row,
            tally: attempts.tally(),
        }
    }

    /// The attempt as a file that `ngf replay` plays; one at which somebody pulled would not end the same.
    pub(crate) fn episode(&self) -> Option<File> {
        let attempt = self.attempt.as_ref().filter(|attempt| !attempt.was_pulled())?;
        let text = serde_json::to_string(&attempt.episode()).ok()?;
        Some(File { name: format!("{}-{}.json", self.loaded.label, attempt.seed()), text })
    }

    /// How the attempt ended, if it has and that has not been told; asking counts it.
    pub(crate) fn count_verdict(&mut self) -> Option<Verdict> {
        let attempt = self.attempt.as_ref().filter(|_| !self.is_told)?;
        let verdict = attempt.verdict()?;
        self.is_told = true;
        let hash = attempt.state_hash();
        let attempts = self.attempts.entry(self.actors()).or_default();
        let PlanarPose { x, y, yaw } = self.pose;
        if self.played.is_none() && !attempt.was_pulled() {
            attempts.count(self.seed, [x, y, yaw], verdict.is_lifted());
        }
        Some(Verdict {
            lifted: verdict.is_lifted(),
            words: verdict.words().to_owned(),
            seed: self.seed,
            pose: self.pose,
            placed: self.pose_seed != Some(self.seed),
            played: self.played.clone(),
            pulled: attempt.was_pulled(),
            hash,
            tally: attempts.tally(),
        })
    }
}

/// Where an attempt from this seed finds the object.
fn draw_pose(workcell: &Workcell, seed: u32) -> PlanarPose {
    let [x, y, yaw] = rollout::pose_of_seed(&workcell.robot, u64::from(seed));
    PlanarPose { x, y, yaw }
}

fn broken(error: &dyn std::error::Error) -> Failure {
    Failure {
        code: "engine_broken",
        cause: format!("The scene cannot be set up: {error}."),
        cure: "Reload the page. If that does not help, this build is at fault.".into(),
    }
}
