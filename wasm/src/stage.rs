//! What stands on the table, and the attempt to lift it: all that the worker knows of the robot.

use crate::look;
use crate::protocol::{
    BuiltIn, Cloud, DepthCamera, Failure, Frame, Link, ObjectLoaded, Phase, PlanarPose, Ready,
    Rectangle, Shape, Table, Verdict,
};
use crate::statistics::{Attempts, Tally};
use crate::upload::{self, Loaded};
use geometry::Pose;
use js_sys::Float32Array;
use robot::rotation;
use rollout::{Attempt, Controller, Demonstration, RolloutError, Workcell};
use scene::Simulation;
use scene::config::CONTROL_PERIOD;
use std::collections::BTreeMap;

/// Robot, table and object, with an attempt or without.
pub(crate) struct Stage {
    workcell: Workcell,
    loaded: Loaded,
    /// Of what stands there, from [`geometry::object::Object::hash`].
    object: String,
    pose: PlanarPose,
    /// The seed that the pose was drawn from, unless the object was placed by hand.
    pose_seed: Option<u32>,
    attempt: Option<Attempt>,
    /// Which demonstration is played, if one is.
    played: Option<String>,
    seed: u32,
    /// By the object's hash.
    attempts: BTreeMap<String, Attempts>,
}

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
        let (attempt, played, seed) = (None, None, 0);
        Ok(Self { workcell, loaded, object, pose, pose_seed, attempt, played, seed, attempts })
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
        let objects = upload::names().map(|name| BuiltIn { name, label: upload::label(name) });
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
            objects: objects.collect(),
        })
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

    fn tally(&self) -> Tally {
        self.attempts.get(&self.object).map(Attempts::tally).unwrap_or_default()
    }

    /// Ends the attempt, if there is one: the robot is home, the object where it was.
    pub(crate) fn reset(&mut self) {
        (self.attempt, self.played) = (None, None);
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

    /// Takes a model's three files.
    pub(crate) fn load_model(
        &mut self,
        weights: &[u8],
        starts: &[u8],
        config: &[u8],
    ) -> Result<(), Failure> {
        self.workcell.load_model(weights, starts, config).map_err(|error| Failure {
            code: "model_unusable",
            cause: format!("The policy cannot be used: {error}."),
            cure: "Train it again with this version of the program, or fetch its own model.".into(),
        })
    }

    /// Begins an attempt: by the policy, or while there is none by the planner.
    pub(crate) fn begin(&mut self, seed: u32) -> Result<Cloud, Failure> {
        let PlanarPose { x, y, yaw } = self.pose;
        let has_policy = self.workcell.model.is_some();
        let controller = if has_policy { Controller::Policy } else { Controller::Planner };
        let Loaded { object, name, label, .. } = &self.loaded;
        let name = name.as_ref().unwrap_or(label);
        let pose = Some([x, y, yaw]);
        let attempt =
            Attempt::begin(&self.workcell, object, name, pose, u64::from(seed), controller)
                .map_err(|error| cannot_begin(&error))?;
        (self.played, self.seed) = (None, seed);
        Ok(self.set_off(attempt))
    }

    fn set_off(&mut self, attempt: Attempt) -> Cloud {
        let points: Vec<f32> = attempt.cloud().iter().flat_map(|p| p.to_array()).collect();
        self.attempt = Some(attempt);
        Cloud { points: Float32Array::from(points.as_slice()) }
    }

    /// Begins to play a demonstration from a file, with the object that stands there or a built-in one.
    pub(crate) fn play(&mut self, file_name: &str, bytes: &[u8]) -> Result<Cloud, Failure> {
        let unusable = |cause: String, cure: &str| Failure {
            code: "demonstration_unusable",
            cause: format!("{file_name} cannot be played: {cause}."),
            cure: cure.into(),
        };
        let file: Demonstration = serde_json::from_slice(bytes).map_err(|error| {
            unusable(error.to_string(), "Write one with `ngf dataset episode DIR N --out FILE`.")
        })?;
        let loaded = if self.object == file.object {
            None
        } else {
            Some(upload::built_in(&file.name).map_err(|_| {
                let cause = format!("it was made with \"{}\", which is not here", file.name);
                unusable(cause, "Load that object's mesh first; its mass must be the one it was made with, too.")
            })?)
        };
        let object = loaded.as_ref().map_or(&self.loaded.object, |loaded| &loaded.object);
        let attempt = file.begin(&self.workcell, object).map_err(|error| {
            let cure =
                "Make the dataset with this version of the program, and objects as they are.";
            unusable(error.to_string(), cure)
        })?;
        if let Some(loaded) = loaded {
            self.load(loaded);
        }
        let [x, y, yaw] = file.pose;
        (self.pose, self.pose_seed) = (PlanarPose { x, y, yaw }, None);
        self.played = Some(file.demonstration);
        Ok(self.set_off(attempt))
    }

    /// Whether an attempt is under way.
    pub(crate) fn is_busy(&self) -> bool {
        self.attempt.as_ref().is_some_and(|attempt| attempt.verdict().is_none())
    }

    /// One control period.
    pub(crate) fn tick(&mut self) {
        if let Some(attempt) = &mut self.attempt {
            attempt.tick(&self.workcell);
        }
    }

    /// How the attempt ended, if it has; asking counts it, so ask once.
    pub(crate) fn count_verdict(&mut self) -> Option<Verdict> {
        let attempt = self.attempt.as_ref()?;
        let verdict = attempt.verdict()?;
        let hash = attempt.state_hash();
        let attempts = self.attempts.entry(self.object.clone()).or_default();
        let PlanarPose { x, y, yaw } = self.pose;
        if self.played.is_none() {
            attempts.count(self.seed, [x, y, yaw], verdict.is_lifted());
        }
        Some(Verdict {
            lifted: verdict.is_lifted(),
            words: verdict.words().to_owned(),
            seed: self.seed,
            pose: self.pose,
            placed: self.pose_seed != Some(self.seed),
            played: self.played.clone(),
            hash,
            tally: attempts.tally(),
        })
    }

    /// What is to be drawn; the clock's figures are filled in by its owner.
    pub(crate) fn frame(&self) -> Frame {
        let poses: Vec<f32> = self.poses().iter().flat_map(seven).collect();
        Frame {
            poses: Float32Array::from(poses.as_slice()),
            pose: self.pose,
            played: self.played.clone(),
            phase: self.attempt.as_ref().map_or(Phase::Idle, |attempt| attempt.phase().into()),
            time: self.attempt.as_ref().map_or(0.0, |a| a.ticks() as f64 * CONTROL_PERIOD),
            running: true,
            factor: 1.0,
            measured: None,
        }
    }

    fn poses(&self) -> Vec<Pose> {
        if let Some(attempt) = &self.attempt {
            let scene = attempt.scene();
            return scene.body_poses().chain([scene.object_pose()]).collect();
        }
        let robot = &self.workcell.robot;
        let home = robot.tree.kinematics(&robot.config.home());
        let object = robot.config.upright(self.pose.x, self.pose.y, self.pose.yaw);
        home.world_from_body.iter().map(rotation::to_pose).chain([object]).collect()
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

/// Where an attempt from this seed finds the object.
fn draw_pose(workcell: &Workcell, seed: u32) -> PlanarPose {
    let [x, y, yaw] = rollout::pose_of_seed(&workcell.robot, u64::from(seed));
    PlanarPose { x, y, yaw }
}

/// Position and quaternion.
fn seven(pose: &Pose) -> [f32; 7] {
    let (p, q) = (pose.translation, pose.rotation);
    [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
}

fn cannot_begin(error: &RolloutError) -> Failure {
    let (code, cure) = match error {
        RolloutError::NoGrasps(_) | RolloutError::NoModel => {
            ("policy_missing", "Choose another object, or train a policy with `ngf train`.")
        }
        _ => ("attempt_impossible", "Choose another object."),
    };
    Failure { code, cause: format!("The attempt cannot begin: {error}."), cure: cure.into() }
}

fn broken(error: &dyn std::error::Error) -> Failure {
    Failure {
        code: "engine_broken",
        cause: format!("The scene cannot be set up: {error}."),
        cure: "Reload the page. If that does not help, this build is at fault.".into(),
    }
}
