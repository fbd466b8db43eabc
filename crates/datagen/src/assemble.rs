//! Assembles the shards of a dataset into rows, episodes, tables of trials and poses, summary and manifest.

use crate::generate::{FileBatch, Generator, provenance};
use crate::summary::summarize;
use anyhow::{Context, Result};
use dataset::dataset::CLOUD_BLOCK;
use dataset::lerobot::{
    self, CARD_FILE, EpisodeIndex, FeatureRanges, FeatureStats, Metadata, PoseFrames,
    data_file_path,
};
use dataset::manifest;
use dataset::parquet_io::{self, Column, Columns};
use dataset::shard::{CLOUD_POINTS, DemoOutcome, DemoTrial, PoseShard};
use dataset_manifest::{SUMMARY_FILE, Summary};
use files::{atomic_file, tensors};
use objects::object::Object;
use std::collections::BTreeMap;

impl Generator<'_> {
    /// Writes all files except the shards, the manifest last.
    pub(crate) fn assemble(&self) -> Result<()> {
        let (dir, config) = (&self.dataset.dir, &self.dataset.config);
        let names = &config.objects;
        // Shards without rows and clouds, as needed for the tables; the rows stay on disk.
        let mut shards = Vec::new();
        for name in names {
            for index in 0..config.poses {
                let mut shard = self.read_shard(name, index)?;
                (shard.states, shard.accelerations, shard.targets) = Default::default();
                (shard.noisy, shard.clean) = Default::default();
                shards.push(shard);
            }
        }
        let episodes = self.index_episodes(&shards);
        let groups = row_groups(&episodes);
        self.write_rows(&groups)?;
        self.write_clouds()?;
        let stats = self.feature_stats(&groups)?;
        let metadata = Metadata {
            tree: &self.robot.tree,
            objects: names,
            episodes: &episodes,
            stats: &stats,
            has_point_cloud: config.point_cloud_column,
        };
        metadata.write(dir)?;
        let by_object = || names.iter().zip(shards.chunks(config.poses));
        let trials = by_object().map(|(name, shards)| Ok(trial_columns(name, shards)));
        parquet_io::write(&dir.join("attempts.parquet"), trials, None)?;
        let poses = by_object().map(|(name, shards)| Ok(pose_columns(name, shards)));
        parquet_io::write(&dir.join("poses.parquet"), poses, None)?;
        let summary: BTreeMap<&String, Summary> = by_object()
            .map(|(name, shards)| Ok((name, self.summarize(name, shards)?)))
            .collect::<Result<_>>()?;
        atomic_file::write(&dir.join(SUMMARY_FILE), &serde_json::to_vec_pretty(&summary)?)?;
        let provenance = provenance(config, self.objects);
        let card =
            lerobot::card(&provenance, self.is_built_in(), episodes.len(), metadata.num_rows());
        atomic_file::write(&dir.join(CARD_FILE), card.as_bytes())?;
        let manifest = manifest::build(dir, provenance)?;
        manifest::write(&manifest, dir)
    }

    /// Summary of the demonstrated poses of an object.
    fn summarize(&self, name: &str, shards: &[PoseShard]) -> Result<Summary> {
        let count = self.num_demonstrated_poses(self.object(name)?);
        Ok(summarize(&shards[..count], &self.dataset.config))
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

    /// Whether every object comes with this project.
    fn is_built_in(&self) -> bool {
        let is_built_in = |(name, object): (&String, &Object)| {
            Object::from_catalog(name).is_some_and(|built_in| built_in.hash() == object.hash())
        };
        self.objects.iter().all(is_built_in)
    }

    /// Columns of the rows at a pose.
    fn read_columns(&self, group: &RowGroup) -> Result<Columns> {
        let config = &self.dataset.config;
        let name = &config.objects[group.object];
        let shard = self.read_shard(name, group.pose)?;
        let frames = PoseFrames {
            shard: &shard,
            object: group.object,
            extents: self.object(name)?.size().to_array(),
            episode: group.episode,
            row: group.row,
            has_point_cloud: config.point_cloud_column,
        };
        Ok(frames.columns())
    }

    /// Statistics of all rows, in two passes.
    fn feature_stats(&self, groups: &[RowGroup]) -> Result<FeatureStats> {
        let mut ranges = FeatureRanges::default();
        for (i, group) in groups.iter().enumerate() {
            self.progress.update("statistics", i, 2 * groups.len());
            ranges.add(&self.read_columns(group)?);
        }
        let mut stats = ranges.into_stats();
        for (i, group) in groups.iter().enumerate() {
            self.progress.update("statistics", groups.len() + i, 2 * groups.len());
            stats.add(&self.read_columns(group)?);
        }
        Ok(stats)
    }

    /// Writes the rows of all demonstrations, with one row group per pose.
    fn write_rows(&self, groups: &[RowGroup]) -> Result<()> {
        let mut files: BTreeMap<usize, Vec<&RowGroup>> = BTreeMap::new();
        for group in groups {
            files.entry(group.file).or_default().push(group);
        }
        let files: Vec<_> = files.into_iter().collect();
        let path = |i: usize| data_file_path(&self.dataset.dir, files[i].0);
        FileBatch::new("Parquet files", files.len(), self.progress, path).write_files(|i, path| {
            parquet_io::write(path, files[i].1.iter().map(|group| self.read_columns(group)), None)
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

/// Rows of the demonstrations at one pose.
struct RowGroup {
    /// Index of the Parquet file.
    file: usize,
    object: usize,
    pose: usize,
    /// Index of the first episode.
    episode: usize,
    /// Index of the first row.
    row: usize,
}

/// Groups the episodes by pose.
fn row_groups(episodes: &[EpisodeIndex]) -> Vec<RowGroup> {
    let mut groups: Vec<RowGroup> = Vec::new();
    for (index, episode) in episodes.iter().enumerate() {
        let &EpisodeIndex { file, object, pose, rows, .. } = episode;
        if groups.last().is_none_or(|group| [group.object, group.pose] != [object, pose]) {
            groups.push(RowGroup { file, object, pose, episode: index, row: rows[0] });
        }
    }
    groups
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
