//! The folder of a dataset: creating it, opening it, reading training data from it.

use crate::lerobot::data_file_path;
use crate::manifest::{self, SHARDS_DIR};
use crate::parquet_io;
use crate::shard::{CLOUD_POINTS, STATE_DIM};
use anyhow::{Context, Result, bail, ensure};
use configs::DatasetConfig;
use dataset_manifest::{CONFIG_FILE, MANIFEST_FILE, Manifest, Provenance, SUMMARY_FILE, Summary};
use files::atomic_file;
use files::tensors::read_f32;
use geometry::Vec3;
use safetensors::SafeTensors;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A dataset on disk.
pub struct Dataset {
    /// Root folder of the dataset.
    pub dir: PathBuf,
    /// Configuration that it was generated with.
    pub config: DatasetConfig,
}

/// Demonstrations and clouds of one object pose, as training data.
#[derive(Clone, Debug)]
pub struct PoseRecord {
    /// x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// Joint positions (rad) and velocities (rad/s), rows of [`STATE_DIM`], of all trajectories in sequence.
    pub states: Vec<f32>,
    /// First row of each trajectory, then the number of rows.
    pub offsets: Vec<usize>,
    /// Angles (rad) by which object and demonstrations are rotated about the vertical axis of the robot; the
    /// first is 0.
    pub azimuths: Vec<f32>,
    /// Noisy clouds, each 512 x 3, grouped by azimuth; every azimuth has the same number of clouds.
    pub clouds: Vec<Vec<f32>>,
}

impl PoseRecord {
    /// The first noisy cloud (m, base frame) of the pose as it is, not rotated about the robot. Empty for a pose without
    /// clouds.
    pub fn first_cloud(&self) -> Vec<Vec3> {
        self.clouds
            .first()
            .into_iter()
            .flat_map(|cloud| cloud.chunks_exact(3))
            .map(Vec3::from_slice)
            .collect()
    }
}

/// A training sample of the encoder.
#[derive(Clone, Debug)]
pub struct EncoderSample {
    /// Index into [`DatasetConfig::encoder_objects`].
    pub object: usize,
    /// Object pose: x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// Noisy cloud, 512 x 3, base frame.
    pub cloud: Vec<f32>,
}

/// Object poses per file of clouds.
pub const CLOUD_BLOCK: usize = 16;

/// Encoder clouds per file.
pub const CLOUDS_PER_FILE: usize = 100;

/// Approximate number of demonstrations per Parquet file.
const EPISODES_PER_FILE: usize = 4096;

impl Dataset {
    /// Creates a dataset with these inputs in a folder. The folder may be new or empty. With `may_resume`, it
    /// may also contain an unfinished dataset with the same inputs.
    pub fn create(dir: &Path, inputs: &Provenance, may_resume: bool) -> Result<Self> {
        std::fs::create_dir_all(dir).with_context(|| format!("cannot create {}", dir.display()))?;
        manifest::reject_foreign_files(dir)?;
        let path = dir.join(CONFIG_FILE);
        let wanted = serde_json::to_string_pretty(inputs)?;
        if path.exists() {
            let found = std::fs::read_to_string(&path)
                .with_context(|| format!("cannot read {}", path.display()))?;
            if found != wanted {
                bail!(
                    "{} contains a dataset of another configuration, scene or object (mesh, mass, \
                     friction); choose another folder",
                    dir.display()
                );
            }
            if !may_resume && !dir.join(MANIFEST_FILE).exists() {
                bail!(
                    "{} contains an unfinished dataset; complete it with --resume",
                    dir.display()
                );
            }
            manifest::delete_partial_files(dir)?;
        } else {
            atomic_file::write(&path, wanted.as_bytes())?;
        }
        Ok(Self { dir: dir.to_owned(), config: inputs.config.clone() })
    }

    /// Hash of the manifest, which identifies the dataset.
    pub fn hash(&self) -> Result<String> {
        Ok(Manifest::read(&self.dir)?.hash)
    }

    /// Opens a complete dataset.
    pub fn open(dir: &Path) -> Result<Self> {
        let config = dataset_manifest::open(dir)?.config;
        Ok(Self { dir: dir.to_owned(), config })
    }

    /// Deletes the shards, which a complete dataset does not need.
    pub fn delete_shards(&self) -> Result<()> {
        let folder = self.dir.join(SHARDS_DIR);
        if folder.exists() {
            std::fs::remove_dir_all(&folder)
                .with_context(|| format!("cannot delete {}", folder.display()))?;
        }
        Ok(())
    }

    /// Counts and statistics by object name.
    pub fn summary(&self) -> Result<BTreeMap<String, Summary>> {
        let path = self.dir.join(SUMMARY_FILE);
        let bytes = atomic_file::read(&path)?;
        serde_json::from_slice(&bytes).with_context(|| format!("{} is damaged", path.display()))
    }

    /// Reads the demonstrations of every pose of an object, by its index.
    pub fn read_poses(&self, object: usize) -> Result<Vec<PoseRecord>> {
        let name = &self.config.objects[object];
        let kept = self.kept_per_pose(object)?;
        let mut records = Vec::new();
        for block in 0..self.config.poses.div_ceil(CLOUD_BLOCK) {
            records.extend(self.read_pose_clouds(name, block)?);
        }
        for (index, record) in records.iter_mut().enumerate() {
            self.read_rows(object, index, &kept, record)?;
        }
        Ok(records)
    }

    /// Reads the demonstrations of one pose of an object, by its index.
    pub fn read_pose(&self, object: usize, index: usize) -> Result<PoseRecord> {
        let mut block = self.read_pose_clouds(&self.config.objects[object], index / CLOUD_BLOCK)?;
        let mut record = block.swap_remove(index % CLOUD_BLOCK);
        self.read_rows(object, index, &self.kept_per_pose(object)?, &mut record)?;
        Ok(record)
    }

    /// Reads the rows of the demonstrations of a pose, if it has any.
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
            (record.states, record.offsets) =
                self.read_row_group(self.file_index(object, index), group)?;
        }
        Ok(())
    }

    /// Index of the grasp that is demonstrated at each pose of an object, if any: that of the first kept demonstration.
    pub fn demonstrated_grasps(&self, object: usize) -> Result<Vec<Option<usize>>> {
        let poses = parquet_io::read_group(&self.dir.join("poses.parquet"), object)?;
        let grasps = parquet_io::integers(&poses, "grasp")?;
        Ok(grasps.iter().map(|grasp| usize::try_from(*grasp).ok()).collect())
    }

    /// Number of kept demonstrations of each pose of an object.
    fn kept_per_pose(&self, object: usize) -> Result<Vec<i64>> {
        let path = self.dir.join("poses.parquet");
        let kept =
            parquet_io::integers(&parquet_io::read_group(&path, object)?, "num_kept")?.to_vec();
        ensure!(kept.len() == self.config.poses, "{} is damaged", path.display());
        Ok(kept)
    }

    /// States and first rows of the demonstrations in a row group.
    fn read_row_group(&self, file: usize, group: usize) -> Result<(Vec<f32>, Vec<usize>)> {
        let path = data_file_path(&self.dir, file);
        let batch = parquet_io::read_group(&path, group)?;
        let states = parquet_io::floats(&batch, "observation.state")?.to_vec();
        let frames = parquet_io::integers(&batch, "frame_index")?;
        let starts = frames.iter().enumerate().filter(|(_, frame)| **frame == 0).map(|(i, _)| i);
        let mut offsets: Vec<usize> = starts.collect();
        offsets.push(frames.len());
        ensure!(
            offsets[0] == 0 && states.len() == frames.len() * STATE_DIM,
            "{} is damaged: row group {group} does not start with an episode",
            path.display()
        );
        Ok((states, offsets))
    }

    /// Reads poses, azimuths and clouds of a block of poses.
    fn read_pose_clouds(&self, name: &str, block: usize) -> Result<Vec<PoseRecord>> {
        let path = self.pose_clouds_path(name, block);
        let bytes = atomic_file::read(&path)?;
        let damaged = || format!("{} is damaged", path.display());
        let tensors = SafeTensors::deserialize(&bytes).with_context(damaged)?;
        let count = (self.config.poses - block * CLOUD_BLOCK).min(CLOUD_BLOCK);
        let read = |name: &str, size: usize| -> Result<Vec<f32>> {
            let all = read_f32(&tensors, name).with_context(damaged)?;
            ensure!(all.len() == count * size, "{}: {name} has {} values", damaged(), all.len());
            Ok(all)
        };
        let clouds = self.config.num_azimuths * self.config.clouds * 3 * CLOUD_POINTS;
        let (poses, turns) = (read("poses", 3)?, read("azimuths", self.config.num_azimuths)?);
        let noisy = read("noisy", clouds)?;
        let record = |i: usize| PoseRecord {
            pose: [poses[3 * i], poses[3 * i + 1], poses[3 * i + 2]],
            states: Vec::new(),
            offsets: vec![0],
            azimuths: turns[i * self.config.num_azimuths..(i + 1) * self.config.num_azimuths]
                .to_vec(),
            clouds: noisy[i * clouds..(i + 1) * clouds]
                .chunks_exact(3 * CLOUD_POINTS)
                .map(<[f32]>::to_vec)
                .collect(),
        };
        Ok((0..count).map(record).collect())
    }

    /// Reads the training data of the encoder.
    pub fn encoder_samples(&self) -> Result<Vec<EncoderSample>> {
        let mut views = Vec::new();
        for (object, name) in self.config.encoder_objects.iter().enumerate() {
            for file in 0..self.cloud_files() {
                let path = self.cloud_path(name, file);
                let bytes = atomic_file::read(&path)?;
                let damaged = || format!("{} is damaged", path.display());
                let tensors = SafeTensors::deserialize(&bytes).with_context(damaged)?;
                let noisy = read_f32(&tensors, "noisy").with_context(damaged)?;
                let poses = read_f32(&tensors, "poses").with_context(damaged)?;
                let clouds = noisy.chunks_exact(3 * CLOUD_POINTS).zip(poses.chunks_exact(3));
                views.extend(clouds.map(|(cloud, pose)| EncoderSample {
                    object,
                    pose: [pose[0], pose[1], pose[2]],
                    cloud: cloud.to_vec(),
                }));
            }
        }
        Ok(views)
    }

    /// Points on the whole surface of each object of the encoder, in the object frame.
    pub fn surfaces(&self) -> Result<Vec<Vec<Vec3>>> {
        let path = self.surfaces_path();
        let bytes = atomic_file::read(&path)?;
        let damaged = || format!("{} is damaged", path.display());
        let tensors = SafeTensors::deserialize(&bytes).with_context(damaged)?;
        let surface = |name: &String| -> Result<Vec<Vec3>> {
            let points = read_f32(&tensors, name).with_context(damaged)?;
            Ok(points.chunks_exact(3).map(Vec3::from_slice).collect())
        };
        self.config.encoder_objects.iter().map(surface).collect()
    }

    /// File of the surface points of the encoder's objects.
    pub fn surfaces_path(&self) -> PathBuf {
        self.dir.join("clouds/surfaces.safetensors")
    }

    /// Number of encoder cloud files per object.
    pub fn cloud_files(&self) -> usize {
        self.config.encoder_clouds.div_ceil(CLOUDS_PER_FILE)
    }

    /// Object poses per Parquet file of demonstrations.
    fn poses_per_file(&self) -> usize {
        (EPISODES_PER_FILE / self.config.trajectories.max(1)).max(1)
    }

    /// Index of the Parquet file with the demonstrations of a pose.
    pub fn file_index(&self, object: usize, pose: usize) -> usize {
        object * self.config.poses.div_ceil(self.poses_per_file()) + pose / self.poses_per_file()
    }

    /// File of the shard of a pose, until the dataset is assembled.
    pub fn shard_path(&self, name: &str, index: usize) -> PathBuf {
        self.dir.join(SHARDS_DIR).join(name).join(format!("{index:05}.safetensors"))
    }

    /// File of the grasps of an object after some rounds in which similar objects share grasps.
    pub fn shared_grasps_path(&self, name: &str, rounds: usize) -> PathBuf {
        self.dir.join(SHARDS_DIR).join(name).join(format!("grasps-{rounds}.json"))
    }

    /// File of the reachable grasps of all poses of an object after some rounds.
    pub fn options_path(&self, name: &str, rounds: usize) -> PathBuf {
        self.dir.join(SHARDS_DIR).join(name).join(format!("options-{rounds}.safetensors"))
    }

    /// File of the ratings of an object's grasps after some rounds, before the last one.
    pub fn shared_ratings_path(&self, name: &str, rounds: usize) -> PathBuf {
        self.dir.join(SHARDS_DIR).join(name).join(format!("ratings-{rounds}.json"))
    }

    /// File of the grasps of an object that are adapted to a policy.
    pub fn adapted_grasps_path(&self, name: &str) -> PathBuf {
        self.dir.join(SHARDS_DIR).join(name).join("adapted-grasps.json")
    }

    /// File of the ratings of an object's grasps, in datasets with consistent grasps.
    pub fn ratings_path(&self, name: &str) -> PathBuf {
        self.dir.join("ratings").join(format!("{name}.json"))
    }

    /// File of the grasps of an object.
    pub fn grasps_path(&self, name: &str) -> PathBuf {
        self.dir.join("grasps").join(format!("{name}.json"))
    }

    /// File of encoder clouds of an object.
    pub fn cloud_path(&self, name: &str, file: usize) -> PathBuf {
        self.dir.join("clouds/objects").join(name).join(format!("{file:05}.safetensors"))
    }

    /// File of the clouds of a block of [`CLOUD_BLOCK`] poses.
    pub fn pose_clouds_path(&self, name: &str, block: usize) -> PathBuf {
        self.dir.join("clouds/poses").join(name).join(format!("{block:05}.safetensors"))
    }
}
