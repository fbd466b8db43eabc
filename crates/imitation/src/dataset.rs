//! The dataset on disk: grasps, demonstrations by object pose, clouds for the encoder.
//!
//! Every file depends on the configuration and the seed alone and is written atomically, so that a
//! killed run resumes by making what is missing.

use crate::poses::{common_target, draw_turn, spread_pose, turned};
use crate::store;
use anyhow::{Context, Result, bail};
use geometry::object::Object;
use grasps::demonstration::{self, Demonstration, TrajectoryConfig};
use grasps::search::{GraspSet, SearchConfig, search};
use grasps::trial::HOLD_SECONDS;
use grasps::{Posture, Robot};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use scene::cloud::Eye;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Counts the changes of what a configuration makes: 2, demonstrations begin at common places.
pub const VERSION: u32 = 2;

/// What a dataset holds.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DatasetConfig {
    /// [`VERSION`] of the program that makes it.
    pub version: u32,
    /// Objects with demonstrations.
    pub objects: Vec<String>,
    /// Poses of each of them on the table (the paper's grid G).
    pub poses: usize,
    /// Demonstrations of each pose (the paper's M).
    pub trajectories: usize,
    /// Bearings at which each pose is seen: demonstrations are as good when they turn, with the object,
    /// about the robot's vertical axis.
    pub turns: usize,
    /// Noisy clouds at each bearing.
    pub clouds: usize,
    /// Objects of the encoder's data.
    pub encoder_objects: Vec<String>,
    /// Clouds of each of them.
    pub encoder_clouds: usize,
    /// Seed of everything.
    pub seed: u64,
}

impl DatasetConfig {
    /// A configuration by name: `tiny` (seconds), `small` (minutes), `shipped` (a quarter of an hour on two
    /// cores).
    pub fn preset(name: &str, seed: u64) -> Option<Self> {
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let (objects, encoder) = (
            names(&["sugar_box", "bleach"]),
            names(&["sugar_box", "bleach", "cracker_box", "soup_can"]),
        );
        let sized = |poses, trajectories, encoder_clouds| Self {
            version: VERSION,
            objects,
            poses,
            trajectories,
            turns: 4,
            clouds: 4,
            encoder_objects: encoder,
            encoder_clouds,
            seed,
        };
        match name {
            "tiny" => Some(Self { objects: names(&["sugar_box"]), ..sized(2, 2, 20) }),
            "small" => Some(sized(48, 32, 1000)),
            "shipped" => Some(Self { turns: 8, ..sized(800, 2, 6000) }),
            _ => None,
        }
    }
}

/// The demonstrations of one object pose.
#[derive(Clone, Debug)]
pub struct PoseRecord {
    /// x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// Joint positions and velocities, rows of 46, all trajectories one after another.
    pub states: Vec<f32>,
    /// First row of each trajectory, and the number of rows at the end.
    pub offsets: Vec<usize>,
    /// Angles (rad) by which object and demonstrations are turned about the robot's vertical axis; the
    /// first one is 0.
    pub turns: Vec<f32>,
    /// Noisy clouds, each 512 x 3; as many at each of these bearings, one bearing after another.
    pub clouds: Vec<Vec<f32>>,
    /// Attempts by what became of them.
    pub counts: BTreeMap<String, usize>,
}

impl PoseRecord {
    fn push(&mut self, demonstration: &Demonstration) {
        for state in &demonstration.states {
            self.states.extend(state.q.iter().chain(state.qd.iter()).map(|x| *x as f32));
        }
        self.offsets.push(self.states.len() / (2 * robot::DOF));
    }
}

/// A dataset folder.
pub struct Dataset {
    /// Where it lies.
    pub dir: PathBuf,
    /// What it holds.
    pub config: DatasetConfig,
}

/// Object poses that are worked on in order before the next ones.
const BLOCK: usize = 16;

/// Attempts without success after which the next grasp is tried.
const HOPELESS: usize = 3;

/// Clouds in one file of the encoder's data.
const CLOUDS_PER_FILE: usize = 100;

impl Dataset {
    /// Opens a folder for `config`, or makes it; refuses a folder of another configuration.
    pub fn create(dir: &Path, config: DatasetConfig) -> Result<Self> {
        std::fs::create_dir_all(dir).with_context(|| format!("cannot make {}", dir.display()))?;
        let manifest = dir.join("config.json");
        let wanted = serde_json::to_string_pretty(&config)?;
        if manifest.exists() {
            let found = std::fs::read_to_string(&manifest)?;
            if found != wanted {
                bail!(
                    "{} holds a dataset of another configuration; choose another folder",
                    dir.display()
                );
            }
        } else {
            store::write(&manifest, wanted.as_bytes())?;
        }
        Ok(Self { dir: dir.to_owned(), config })
    }

    /// Opens an existing dataset.
    pub fn open(dir: &Path) -> Result<Self> {
        let path = dir.join("config.json");
        let text = std::fs::read_to_string(&path)
            .with_context(|| format!("{} is no dataset: it has no config.json", dir.display()))?;
        let config: DatasetConfig = serde_json::from_str(&text).with_context(|| {
            format!("{} is not of version {VERSION}: make the dataset again", path.display())
        })?;
        if config.version != VERSION {
            let version = config.version;
            bail!("{} is of version {version}, not {VERSION}: make it again", path.display());
        }
        Ok(Self { dir: dir.to_owned(), config })
    }

    /// Makes everything that is not there yet; `progress` gets stage, done, total.
    pub fn generate(
        &self,
        robot: &Robot,
        progress: &(dyn Fn(&str, usize, usize) + Sync),
    ) -> Result<()> {
        let eye = Eye::new(&robot.config, &robot.tree);
        self.generate_clouds(&eye, robot, progress)?;
        let mut subjects = Vec::new();
        for name in &self.config.objects {
            let object = built_in(name)?;
            let grasps = self.grasps(robot, name, &object, progress)?;
            subjects.push((name, object, grasps));
        }
        // All objects at one pose after another: what is there of an unfinished dataset is balanced.
        let (done, total) = (AtomicUsize::new(0), self.config.poses * subjects.len());
        let work: Vec<usize> = (0..total).collect();
        work.par_iter().by_uniform_blocks(BLOCK).try_for_each(|i| -> Result<()> {
            let (name, object, grasps) = &subjects[i % subjects.len()];
            let index = i / subjects.len();
            let path = self.pose_path(name, index);
            if !path.exists() {
                let record = self.make_pose(robot, &eye, name, object, grasps, index)?;
                store::write(&path, &store::encode_pose(&record)?)?;
            }
            progress("demonstrations", done.fetch_add(1, Ordering::Relaxed) + 1, total);
            Ok(())
        })
    }

    /// The grasps of an object: those of the project, or found by search and kept.
    fn grasps(
        &self,
        robot: &Robot,
        name: &str,
        object: &Object,
        progress: &(dyn Fn(&str, usize, usize) + Sync),
    ) -> Result<GraspSet> {
        if let Some(set) = rollout::workcell::built_in_grasps(name)? {
            return Ok(set);
        }
        let path = self.dir.join("grasps").join(format!("{name}.json"));
        if path.exists() {
            return Ok(serde_json::from_slice(&std::fs::read(&path)?)?);
        }
        let stage = format!("{name}: grasps");
        let config = SearchConfig::paper(robot);
        let seed = self.config.seed;
        let (set, _) = search(robot, object, &config, seed, |share| {
            progress(&stage, (share * 100.0) as usize, 100)
        })?;
        store::write(&path, &serde_json::to_vec_pretty(&set)?)?;
        Ok(set)
    }

    fn generate_clouds(
        &self,
        eye: &Eye,
        robot: &Robot,
        progress: &(dyn Fn(&str, usize, usize) + Sync),
    ) -> Result<()> {
        for name in &self.config.encoder_objects {
            let object = built_in(name)?;
            let files = self.config.encoder_clouds.div_ceil(CLOUDS_PER_FILE);
            let done = AtomicUsize::new(0);
            (0..files).into_par_iter().try_for_each(|file| -> Result<()> {
                let path = self.cloud_path(name, file);
                if !path.exists() {
                    let mut rng = self.rng("cloud", name, file);
                    let first = file * CLOUDS_PER_FILE;
                    let count = CLOUDS_PER_FILE.min(self.config.encoder_clouds - first);
                    let mut clouds = Vec::new();
                    for _ in 0..count {
                        let [x, y, yaw] = grasps::search::random_pose(robot, &mut rng);
                        let pose = robot.config.upright(x, y, yaw);
                        let frame = eye.frame(&object.mesh, &pose, &mut rng);
                        clouds.push(flat(&eye.cloud(&frame)));
                    }
                    store::write(&path, &store::encode_clouds(&clouds)?)?;
                }
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                progress(&format!("{name}: clouds"), done, files);
                Ok(())
            })?;
        }
        Ok(())
    }

    /// Grasp, demonstrations, replays and clouds of one object pose.
    fn make_pose(
        &self,
        robot: &Robot,
        eye: &Eye,
        name: &str,
        object: &Object,
        grasps: &GraspSet,
        index: usize,
    ) -> Result<PoseRecord> {
        let mut rng = self.rng("pose", name, index);
        let pose = spread_pose(robot, index);
        let world_from_object = robot.config.upright(pose[0], pose[1], pose[2]);
        let turns: Vec<f32> = std::iter::once(0.0)
            .chain((1..self.config.turns).map(|_| draw_turn(robot, pose, &mut rng)))
            .collect();
        let mut clouds = Vec::new();
        for turn in &turns {
            let [x, y, yaw] = turned(pose, *turn);
            let place = robot.config.upright(x, y, yaw);
            let mut see = || flat(&eye.cloud(&eye.frame(&object.mesh, &place, &mut rng)));
            clouds.extend((0..self.config.clouds).map(|_| see()));
        }
        let (states, offsets, counts) = (vec![], vec![0], BTreeMap::new());
        let mut record = PoseRecord { pose, states, offsets, turns, clouds, counts };
        let options = robot.options(&grasps.grasps, object, &world_from_object);
        if options.is_empty() {
            record.counts.insert("no grasp in reach".into(), 1);
        }
        for (_, posture) in options {
            let kept = self.try_posture(robot, name, object, &posture, &mut record)?;
            if kept > 0 {
                break;
            }
        }
        Ok(record)
    }

    /// Demonstrations of one posture, each replayed by physics; gives up on a posture that does not
    /// work at once. Gives the number kept.
    fn try_posture(
        &self,
        robot: &Robot,
        name: &str,
        object: &Object,
        posture: &Posture,
        record: &mut PoseRecord,
    ) -> Result<usize> {
        let [x, y, yaw] = record.pose;
        let world_from_object = &robot.config.upright(x, y, yaw);
        let palm = robot.tree.kinematics(&posture.touch).palm();
        let config = TrajectoryConfig::standard();
        let mut kept = 0;
        for attempt in 0..2 * self.config.trajectories {
            if kept == self.config.trajectories || (kept == 0 && attempt == HOPELESS) {
                break;
            }
            let mut rng = self.rng("target", name, attempt);
            let target = common_target(robot, object, record.pose, &palm, &mut rng);
            let found = demonstration::demonstrate(
                robot,
                object,
                world_from_object,
                posture,
                &target,
                &config,
            );
            let what = match found {
                Err(flaw) => format!("{flaw:?}"),
                Ok(found) => {
                    if demonstration::replays(
                        robot,
                        object,
                        world_from_object,
                        &found,
                        HOLD_SECONDS,
                    )? {
                        record.push(&found);
                        kept += 1;
                        "lifted".into()
                    } else {
                        "NotLifted".into()
                    }
                }
            };
            *record.counts.entry(what).or_insert(0) += 1;
        }
        Ok(kept)
    }

    /// Whether the record of one pose has been made.
    pub fn has_pose(&self, name: &str, index: usize) -> bool {
        self.pose_path(name, index).exists()
    }

    /// Reads the record of one pose.
    pub fn pose(&self, name: &str, index: usize) -> Result<PoseRecord> {
        let path = self.pose_path(name, index);
        let bytes = std::fs::read(&path).with_context(|| {
            format!("{} is missing; run `ngf dataset` again to complete it", path.display())
        })?;
        store::decode_pose(&bytes).with_context(|| format!("{} is damaged", path.display()))
    }

    /// Reads all clouds of the encoder's data, each 512 x 3.
    pub fn encoder_clouds(&self) -> Result<Vec<Vec<f32>>> {
        let mut clouds = Vec::new();
        for name in &self.config.encoder_objects {
            for file in 0..self.config.encoder_clouds.div_ceil(CLOUDS_PER_FILE) {
                let path = self.cloud_path(name, file);
                let bytes = std::fs::read(&path)
                    .with_context(|| format!("{} is missing", path.display()))?;
                clouds.extend(store::decode_clouds(&bytes)?);
            }
        }
        Ok(clouds)
    }

    fn pose_path(&self, name: &str, index: usize) -> PathBuf {
        self.dir.join("demonstrations").join(name).join(format!("{index:05}.safetensors"))
    }

    fn cloud_path(&self, name: &str, file: usize) -> PathBuf {
        self.dir.join("clouds").join(name).join(format!("{file:05}.safetensors"))
    }

    /// A generator of its own for each file: the order of the work does not matter.
    fn rng(&self, kind: &str, name: &str, index: usize) -> ChaCha8Rng {
        let key = format!("{} {kind} {name} {index}", self.config.seed);
        ChaCha8Rng::from_seed(*blake3::hash(key.as_bytes()).as_bytes())
    }
}

/// A built-in object, or an error that names those there are.
pub fn built_in(name: &str) -> Result<Object> {
    let known: Vec<&str> = geometry::object::BUILT_IN.iter().map(|(name, _)| *name).collect();
    Object::built_in(name)
        .with_context(|| format!("there is no object named {name}; known are {}", known.join(", ")))
}

/// Points as numbers, one after another.
pub fn flat(cloud: &[geometry::Vec3]) -> Vec<f32> {
    cloud.iter().flat_map(|p| p.to_array()).collect()
}
