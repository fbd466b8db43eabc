//! Assembles the shards of a dataset into rows, episodes, tables of trials and poses, summary and manifest.

use crate::generate::{FileBatch, Generator, provenance};
use crate::summary::summarize;
use anyhow::{Context, Result};
use dataset::dataset::CLOUD_BLOCK;
use dataset::lerobot::{self, ACTION_DIM, ColumnStats, EpisodeIndex, data_file_path};
use dataset::manifest;
use dataset::parquet_io::{self, Column, Columns};
use dataset::shard::{CLOUD_POINTS, DemoOutcome, DemoTrial, PoseShard, STATE_DIM};
use dataset_manifest::{SUMMARY_FILE, Summary};
use files::{atomic_file, tensors};
use robot::DOF;
use std::collections::BTreeMap;

impl Generator<'_> {
    /// Writes all files except the shards, the manifest last.
    pub(crate) fn assemble(&self) -> Result<()> {
        let (dir, config) = (&self.dataset.dir, &self.dataset.config);
        let names = &config.objects;
        let mut stats = [ColumnStats::new(STATE_DIM), ColumnStats::new(ACTION_DIM)];
        // Shards without rows and clouds, as needed for the tables; the rows stay on disk.
        let mut shards = Vec::new();
        for name in names {
            for index in 0..config.poses {
                let mut shard = self.read_shard(name, index)?;
                stats[0].add(&shard.states, STATE_DIM, 0);
                stats[1].add(&shard.accelerations, DOF, 0);
                stats[1].add(&shard.targets, DOF, DOF);
                (shard.states, shard.accelerations, shard.targets) = Default::default();
                (shard.noisy, shard.clean) = Default::default();
                shards.push(shard);
            }
        }
        let episodes = self.index_episodes(&shards);
        self.write_rows(&episodes)?;
        self.write_clouds()?;
        lerobot::write_meta(dir, &self.robot.tree, names, &episodes, &stats)?;
        let by_object = || names.iter().zip(shards.chunks(config.poses));
        let trials = by_object().map(|(name, shards)| Ok(trial_columns(name, shards)));
        parquet_io::write(&dir.join("attempts.parquet"), trials, None)?;
        let poses = by_object().map(|(name, shards)| Ok(pose_columns(name, shards)));
        parquet_io::write(&dir.join("poses.parquet"), poses, None)?;
        let summary: BTreeMap<&String, Summary> =
            by_object().map(|(name, shards)| (name, summarize(shards, config))).collect();
        atomic_file::write(&dir.join(SUMMARY_FILE), &serde_json::to_vec_pretty(&summary)?)?;
        let manifest = manifest::build(dir, provenance(config, self.objects))?;
        manifest::write(&manifest, dir)
    }

    fn read_shard(&self, name: &str, index: usize) -> Result<PoseShard> {
        let path = self.dataset.shard_path(name, index);
        let bytes = atomic_file::read(&path)?;
        let hint = "delete it and resume";
        PoseShard::decode(&bytes).with_context(|| format!("{} is damaged; {hint}", path.display()))
    }

    /// Index of all episodes, in order.
    fn index_episodes<'a>(&self, shards: &'a [PoseShard]) -> Vec<EpisodeIndex<'a>> {
        let (mut episodes, mut row) = (Vec::new(), 0);
        for (i, shard) in shards.iter().enumerate() {
            let (object, pose) = (i / self.dataset.config.poses, i % self.dataset.config.poses);
            let file = self.dataset.file_index(object, pose);
            for (span, trial) in shard.offsets.windows(2).zip(shard.kept()) {
                let rows = [row, span[1] - span[0]];
                episodes.push(EpisodeIndex { object, pose, shard, trial, file, rows });
                row += rows[1];
            }
        }
        episodes
    }

    /// Writes the rows of all demonstrations, with one row group per pose.
    fn write_rows(&self, episodes: &[EpisodeIndex]) -> Result<()> {
        let mut files: BTreeMap<usize, Vec<[usize; 4]>> = BTreeMap::new();
        for (number, episode) in episodes.iter().enumerate() {
            // The row group of a pose starts with its first episode.
            let groups = files.entry(episode.file).or_default();
            let key = [episode.object, episode.pose];
            if groups.last().is_none_or(|group| group[..2] != key) {
                groups.push([episode.object, episode.pose, number, episode.rows[0]]);
            }
        }
        let files: Vec<_> = files.into_iter().collect();
        let path = |i: usize| data_file_path(&self.dataset.dir, files[i].0);
        FileBatch::new("Parquet files", files.len(), self.progress, path).write_files(|i, path| {
            let groups = files[i].1.iter().map(|&[object, pose, episode, row]| {
                let shard = self.read_shard(&self.dataset.config.objects[object], pose)?;
                Ok(lerobot::frame_columns(&shard, object, episode, row))
            });
            parquet_io::write(path, groups, None)
        })
    }

    /// Writes the clouds of all object poses.
    fn write_clouds(&self) -> Result<()> {
        let (turns, clouds) = (self.dataset.config.num_azimuths, self.dataset.config.clouds);
        for name in &self.dataset.config.objects {
            for block in 0..self.dataset.config.poses.div_ceil(CLOUD_BLOCK) {
                let path = self.dataset.pose_clouds_path(name, block);
                if path.exists() {
                    continue;
                }
                let first = block * CLOUD_BLOCK;
                let last = (first + CLOUD_BLOCK).min(self.dataset.config.poses);
                let (mut noisy, mut clean, mut azimuths, mut poses) = Default::default();
                for index in first..last {
                    let shard = self.read_shard(name, index)?;
                    Vec::extend(&mut noisy, shard.noisy);
                    Vec::extend(&mut clean, shard.clean);
                    Vec::extend(&mut azimuths, shard.azimuths);
                    Vec::extend(&mut poses, shard.pose);
                }
                let count = last - first;
                let bytes = tensors::encode(
                    &[
                        ("noisy", vec![count, turns, clouds, CLOUD_POINTS, 3], &noisy),
                        ("clean", vec![count, turns, CLOUD_POINTS, 3], &clean),
                        ("azimuths", vec![count, turns], &azimuths),
                        ("poses", vec![count, 3], &poses),
                    ],
                    None,
                )?;
                atomic_file::write(&path, &bytes)?;
            }
        }
        Ok(())
    }
}

/// Columns of all trials with an object, including the failed trials.
fn trial_columns(name: &str, shards: &[PoseShard]) -> Columns {
    let all: Vec<(usize, &DemoTrial)> = shards
        .iter()
        .enumerate()
        .flat_map(|(pose, shard)| shard.trials.iter().map(move |trial| (pose, trial)))
        .collect();
    let integers = |of: &dyn Fn(&DemoTrial) -> usize| {
        Column::Integers(all.iter().map(|(_, trial)| of(trial) as i64).collect())
    };
    let floats = |of: &dyn Fn(&DemoTrial) -> f32| {
        Column::Floats(all.iter().map(|(_, trial)| of(trial)).collect())
    };
    let flags = |of: &dyn Fn(&DemoTrial) -> Option<DemoOutcome>| {
        let lifts = |trial| of(trial).map(|outcome| outcome == DemoOutcome::Kept);
        Column::Flags(all.iter().map(|(_, trial)| lifts(trial)).collect())
    };
    vec![
        ("object", Column::Texts(vec![name.to_owned(); all.len()])),
        ("pose_index", Column::Integers(all.iter().map(|(pose, _)| *pose as i64).collect())),
        ("target_seed", integers(&|a| a.target)),
        ("grasp", integers(&|a| a.grasp)),
        ("outcome", Column::Texts(all.iter().map(|(_, a)| a.outcome.name().to_owned()).collect())),
        ("lifted_full_robot", flags(&|a| a.full_robot)),
        ("survived_shaking", flags(&|a| a.shaken)),
        ("lifted_perturbed", flags(&|a| a.perturbed)),
        ("num_frames", integers(&|a| a.num_frames)),
        ("contact_row", integers(&|a| a.contact_row)),
        ("restarts", integers(&|a| a.restarts)),
        ("clearance", floats(&|a| a.clearance)),
        ("jerk", floats(&|a| a.jerk)),
        ("slip", floats(&|a| a.slip)),
        (
            "target_reachable",
            Column::Flags(all.iter().map(|(_, a)| Some(a.is_reachable)).collect()),
        ),
        ("goal_error_m", floats(&|a| a.goal_error[0])),
        ("goal_error_rad", floats(&|a| a.goal_error[1])),
    ]
}

/// Columns of all poses of an object.
fn pose_columns(name: &str, shards: &[PoseShard]) -> Columns {
    let floats = |of: &dyn Fn(&PoseShard) -> f32| Column::Floats(shards.iter().map(of).collect());
    let integers =
        |of: &dyn Fn(&PoseShard) -> i64| Column::Integers(shards.iter().map(of).collect());
    let grasp = |shard: &PoseShard| shard.kept().next().map_or(-1, |trial| trial.grasp as i64);
    vec![
        ("object", Column::Texts(vec![name.to_owned(); shards.len()])),
        ("pose_index", Column::Integers((0..shards.len() as i64).collect())),
        ("x", floats(&|shard| shard.pose[0])),
        ("y", floats(&|shard| shard.pose[1])),
        ("yaw", floats(&|shard| shard.pose[2])),
        ("grasp", integers(&grasp)),
        ("num_attempts", integers(&|shard| shard.trials.len() as i64)),
        ("num_kept", integers(&|shard| shard.kept().count() as i64)),
        ("max_joint_jump_rad", floats(&|shard| shard.max_joint_jump)),
    ]
}
