//! A dataset's folder: making it, opening it, reading what a learner needs.

use crate::config::{DatasetConfig, VERSION};
use crate::generate::Objects;
use crate::lerobot::data_path;
use crate::manifest::{self, MANIFEST, Manifest, PARTS};
use crate::part::{CLOUD, STATE};
use crate::store::{self, values};
use crate::summary::Summary;
use crate::table;
use anyhow::{Context, Result, bail, ensure};
use geometry::Vec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use safetensors::SafeTensors;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A dataset folder.
pub struct Dataset {
    /// Where it lies.
    pub dir: PathBuf,
    /// What it holds.
    pub config: DatasetConfig,
}

/// The demonstrations of one object pose, for learning.
#[derive(Clone, Debug)]
pub struct PoseRecord {
    /// x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// Joint positions and velocities, rows of [`STATE`], all trajectories one after another.
    pub states: Vec<f32>,
    /// First row of each trajectory, and the number of rows at the end.
    pub offsets: Vec<usize>,
    /// Angles (rad) by which object and demonstrations are turned about the robot's vertical axis; the
    /// first one is 0.
    pub turns: Vec<f32>,
    /// Noisy clouds, each 512 x 3; as many at each of these bearings, one bearing after another.
    pub clouds: Vec<Vec<f32>>,
}

/// A cloud for the encoder.
#[derive(Clone, Debug)]
pub struct View {
    /// Index of the object among the encoder's.
    pub object: usize,
    /// Where it stands: x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// Its noisy cloud, 512 x 3, base frame.
    pub cloud: Vec<f32>,
}

/// All that decides the bytes of a dataset, but for the program.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Inputs {
    /// What it is asked for.
    pub config: DatasetConfig,
    /// BLAKE3 of scene file and robot description, hex.
    pub scene: String,
    /// BLAKE3 of each object's shape, mass and friction, hex.
    pub objects: BTreeMap<String, String>,
}

impl Inputs {
    pub(crate) fn of(config: &DatasetConfig, objects: &Objects) -> Self {
        let hashes = objects.iter().map(|(name, object)| (name.clone(), object.hash()));
        let scene = scene::config::scene_hash();
        Self { config: config.clone(), scene, objects: hashes.collect() }
    }
}

/// Object poses whose clouds stand in one file.
pub(crate) const CLOUD_BLOCK: usize = 16;

/// Clouds in one file of the encoder's data.
pub(crate) const CLOUDS_PER_FILE: usize = 100;

/// Demonstrations in one file of rows, about.
const EPISODES_PER_FILE: usize = 4096;

impl Dataset {
    /// Opens a folder in which to make the dataset of these objects; it may be new, empty, or hold a part of
    /// this very dataset if `may_resume`.
    pub fn create(
        dir: &Path,
        config: DatasetConfig,
        objects: &Objects,
        may_resume: bool,
    ) -> Result<Self> {
        std::fs::create_dir_all(dir).with_context(|| format!("cannot make {}", dir.display()))?;
        manifest::refuse_foreign(dir)?;
        let path = dir.join("config.json");
        let inputs = Inputs::of(&config, objects);
        let wanted = serde_json::to_string_pretty(&inputs)?;
        if path.exists() {
            let found = std::fs::read_to_string(&path)
                .with_context(|| format!("cannot read {}", path.display()))?;
            if found != wanted {
                bail!(
                    "{} holds a dataset of another configuration, scene or object (mesh, mass, \
                     friction); choose another folder",
                    dir.display()
                );
            }
            if !may_resume && !dir.join(MANIFEST).exists() {
                bail!("{} holds an unfinished dataset; complete it with --resume", dir.display());
            }
            manifest::remove_half_written(dir)?;
        } else {
            store::write(&path, wanted.as_bytes())?;
        }
        Ok(Self { dir: dir.to_owned(), config })
    }

    /// The hash that names the whole of it.
    pub fn hash(&self) -> Result<String> {
        Ok(Manifest::read(&self.dir)?.hash)
    }

    /// Opens a complete dataset.
    pub fn open(dir: &Path) -> Result<Self> {
        let path = dir.join("config.json");
        let text = std::fs::read_to_string(&path)
            .with_context(|| format!("{} is no dataset: it has no config.json", dir.display()))?;
        let inputs: Inputs = serde_json::from_str(&text).with_context(|| {
            format!("{} is not of version {VERSION}: make the dataset again", path.display())
        })?;
        let config = inputs.config;
        if config.version != VERSION {
            let version = config.version;
            bail!("{} is of version {version}, not {VERSION}: make it again", path.display());
        }
        Manifest::read(dir)?;
        Ok(Self { dir: dir.to_owned(), config })
    }

    /// What was counted, by object.
    pub fn summary(&self) -> Result<BTreeMap<String, Summary>> {
        let path = self.dir.join("summary.json");
        let bytes = store::read(&path)?;
        serde_json::from_slice(&bytes).with_context(|| format!("{} is damaged", path.display()))
    }

    /// Reads the demonstrations of every pose of an object, by its index.
    pub fn poses(&self, object: usize) -> Result<Vec<PoseRecord>> {
        let name = &self.config.objects[object];
        let kept = self.kept(object)?;
        let mut records = Vec::new();
        for block in 0..self.config.poses.div_ceil(CLOUD_BLOCK) {
            records.extend(self.seen(name, block)?);
        }
        for (index, record) in records.iter_mut().enumerate() {
            self.read_rows(object, index, &kept, record)?;
        }
        Ok(records)
    }

    /// Reads the demonstrations of one pose of an object, by its index.
    pub fn pose(&self, object: usize, index: usize) -> Result<PoseRecord> {
        let mut block = self.seen(&self.config.objects[object], index / CLOUD_BLOCK)?;
        let mut record = block.swap_remove(index % CLOUD_BLOCK);
        self.read_rows(object, index, &self.kept(object)?, &mut record)?;
        Ok(record)
    }

    /// Reads the rows of a pose's demonstrations; poses without any have none.
    fn read_rows(
        &self,
        object: usize,
        index: usize,
        kept: &[i64],
        record: &mut PoseRecord,
    ) -> Result<()> {
        if kept[index] > 0 {
            let first = index - index % self.poses_per_file();
            let group = kept[first..index].iter().filter(|count| **count > 0).count();
            (record.states, record.offsets) = self.rows(self.file_of(object, index), group)?;
        }
        Ok(())
    }

    /// Demonstrations of each pose of an object.
    pub(crate) fn kept(&self, object: usize) -> Result<Vec<i64>> {
        let path = self.dir.join("poses.parquet");
        let kept = table::integers(&table::read_group(&path, object)?, "kept")?.to_vec();
        ensure!(kept.len() == self.config.poses, "{} is damaged", path.display());
        Ok(kept)
    }

    /// States and first rows of the demonstrations in a row group.
    fn rows(&self, file: usize, group: usize) -> Result<(Vec<f32>, Vec<usize>)> {
        let path = data_path(&self.dir, file);
        let batch = table::read_group(&path, group)?;
        let states = table::floats(&batch, "observation.state")?.to_vec();
        let frames = table::integers(&batch, "frame_index")?;
        let starts = frames.iter().enumerate().filter(|(_, frame)| **frame == 0).map(|(i, _)| i);
        let mut offsets: Vec<usize> = starts.collect();
        offsets.push(frames.len());
        ensure!(
            offsets[0] == 0 && states.len() == frames.len() * STATE,
            "{} is damaged: row group {group} does not begin with an episode",
            path.display()
        );
        Ok((states, offsets))
    }

    /// Pose, bearings and clouds of a block of poses.
    fn seen(&self, name: &str, block: usize) -> Result<Vec<PoseRecord>> {
        let path = self.pose_clouds_path(name, block);
        let bytes = store::read(&path)?;
        let damaged = || format!("{} is damaged", path.display());
        let tensors = SafeTensors::deserialize(&bytes).with_context(damaged)?;
        let count = (self.config.poses - block * CLOUD_BLOCK).min(CLOUD_BLOCK);
        let read = |name: &str, size: usize| -> Result<Vec<f32>> {
            let all = values(&tensors, name).with_context(damaged)?;
            ensure!(all.len() == count * size, "{}: {name} has {} numbers", damaged(), all.len());
            Ok(all)
        };
        let clouds = self.config.turns * self.config.clouds * 3 * CLOUD;
        let (poses, turns) = (read("poses", 3)?, read("turns", self.config.turns)?);
        let noisy = read("noisy", clouds)?;
        let record = |i: usize| PoseRecord {
            pose: [poses[3 * i], poses[3 * i + 1], poses[3 * i + 2]],
            states: Vec::new(),
            offsets: vec![0],
            turns: turns[i * self.config.turns..(i + 1) * self.config.turns].to_vec(),
            clouds: noisy[i * clouds..(i + 1) * clouds]
                .chunks_exact(3 * CLOUD)
                .map(<[f32]>::to_vec)
                .collect(),
        };
        Ok((0..count).map(record).collect())
    }

    /// Reads the encoder's data.
    pub fn encoder_views(&self) -> Result<Vec<View>> {
        let mut views = Vec::new();
        for (object, name) in self.config.encoder_objects.iter().enumerate() {
            for file in 0..self.cloud_files() {
                let path = self.cloud_path(name, file);
                let bytes = store::read(&path)?;
                let damaged = || format!("{} is damaged", path.display());
                let tensors = SafeTensors::deserialize(&bytes).with_context(damaged)?;
                let noisy = values(&tensors, "noisy").with_context(damaged)?;
                let poses = values(&tensors, "poses").with_context(damaged)?;
                let clouds = noisy.chunks_exact(3 * CLOUD).zip(poses.chunks_exact(3));
                views.extend(clouds.map(|(cloud, pose)| View {
                    object,
                    pose: [pose[0], pose[1], pose[2]],
                    cloud: cloud.to_vec(),
                }));
            }
        }
        Ok(views)
    }

    /// Points on the whole surface of each of the encoder's objects, in the object's frame.
    pub fn surfaces(&self) -> Result<Vec<Vec<Vec3>>> {
        let path = self.surfaces_path();
        let bytes = store::read(&path)?;
        let damaged = || format!("{} is damaged", path.display());
        let tensors = SafeTensors::deserialize(&bytes).with_context(damaged)?;
        let surface = |name: &String| -> Result<Vec<Vec3>> {
            let points = values(&tensors, name).with_context(damaged)?;
            Ok(points.chunks_exact(3).map(Vec3::from_slice).collect())
        };
        self.config.encoder_objects.iter().map(surface).collect()
    }

    pub(crate) fn surfaces_path(&self) -> PathBuf {
        self.dir.join("clouds/surfaces.safetensors")
    }

    /// Files of the encoder's clouds of each object.
    pub(crate) fn cloud_files(&self) -> usize {
        self.config.encoder_clouds.div_ceil(CLOUDS_PER_FILE)
    }

    /// Object poses whose demonstrations stand in one file.
    pub(crate) fn poses_per_file(&self) -> usize {
        (EPISODES_PER_FILE / self.config.trajectories.max(1)).max(1)
    }

    /// The file of the demonstrations of a pose.
    pub(crate) fn file_of(&self, object: usize, pose: usize) -> usize {
        object * self.config.poses.div_ceil(self.poses_per_file()) + pose / self.poses_per_file()
    }

    pub(crate) fn part_path(&self, name: &str, index: usize) -> PathBuf {
        self.dir.join(PARTS).join(name).join(format!("{index:05}.safetensors"))
    }

    pub(crate) fn grasps_path(&self, name: &str) -> PathBuf {
        self.dir.join("grasps").join(format!("{name}.json"))
    }

    pub(crate) fn cloud_path(&self, name: &str, file: usize) -> PathBuf {
        self.dir.join("clouds/objects").join(name).join(format!("{file:05}.safetensors"))
    }

    pub(crate) fn pose_clouds_path(&self, name: &str, block: usize) -> PathBuf {
        self.dir.join("clouds/poses").join(name).join(format!("{block:05}.safetensors"))
    }

    /// A generator of its own for each thing that is made: the order of the work does not matter.
    pub(crate) fn rng(&self, kind: &str, name: &str, index: usize) -> ChaCha8Rng {
        let key = format!("{} {kind} {name} {index}", self.config.seed);
        ChaCha8Rng::from_seed(*blake3::hash(key.as_bytes()).as_bytes())
    }
}
