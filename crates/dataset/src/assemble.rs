//! Putting the parts of a dataset together: rows and episodes, attempts and poses, summary and manifest.

use crate::folder::{CLOUD_BLOCK, Dataset};
use crate::generate::{Objects, Observer, Stage};
use crate::lerobot::{self, ACTION, Episode, Moments, data_path};
use crate::manifest::{Manifest, PARTS};
use crate::part::{Attempt, CLOUD, Fate, Part, STATE};
use crate::store;
use crate::summary::Summary;
use crate::table::{self, Column, Columns};
use anyhow::{Context, Result};
use grasps::Robot;
use robot::DOF;
use std::collections::BTreeMap;

impl Dataset {
    /// Writes all files but those of the parts, the manifest last.
    pub(crate) fn put_together(
        &self,
        robot: &Robot,
        objects: &Objects,
        observer: &dyn Observer,
    ) -> Result<()> {
        let names = &self.config.objects;
        let mut stats = [Moments::new(STATE), Moments::new(ACTION)];
        // What the tables need of each part; its rows stay on disk.
        let mut parts = Vec::new();
        for name in names {
            for index in 0..self.config.poses {
                let mut part = self.part(name, index)?;
                stats[0].add(&part.states, STATE, 0);
                stats[1].add(&part.accelerations, DOF, 0);
                stats[1].add(&part.targets, DOF, DOF);
                (part.states, part.accelerations, part.targets) = Default::default();
                (part.noisy, part.clean) = Default::default();
                parts.push(part);
            }
        }
        let episodes = self.episodes(&parts);
        self.write_rows(&episodes, observer)?;
        self.write_clouds()?;
        lerobot::write_meta(&self.dir, &robot.tree, names, &episodes, &stats)?;
        let by_object = || names.iter().zip(parts.chunks(self.config.poses));
        let attempts = by_object().map(|(name, parts)| Ok(attempt_columns(name, parts)));
        table::write(&self.dir.join("attempts.parquet"), attempts, None)?;
        let poses = by_object().map(|(name, parts)| Ok(pose_columns(name, parts)));
        table::write(&self.dir.join("poses.parquet"), poses, None)?;
        let summary: BTreeMap<&String, Summary> =
            by_object().map(|(name, parts)| (name, Summary::of(parts, &self.config))).collect();
        store::write(&self.dir.join("summary.json"), &serde_json::to_vec_pretty(&summary)?)?;
        Manifest::of(&self.dir, &self.config, objects)?.write(&self.dir)
    }

    fn part(&self, name: &str, index: usize) -> Result<Part> {
        let path = self.part_path(name, index);
        let bytes = store::read(&path)?;
        let cure = "remove it and resume";
        Part::decode(&bytes).with_context(|| format!("{} is damaged; {cure}", path.display()))
    }

    /// All episodes in their order.
    fn episodes<'a>(&self, parts: &'a [Part]) -> Vec<Episode<'a>> {
        let (mut episodes, mut row) = (Vec::new(), 0);
        for (i, part) in parts.iter().enumerate() {
            let (object, pose) = (i / self.config.poses, i % self.config.poses);
            let file = self.file_of(object, pose);
            for (span, attempt) in part.offsets.windows(2).zip(part.kept()) {
                let rows = [row, span[1] - span[0]];
                episodes.push(Episode { object, pose, part, attempt, file, rows });
                row += rows[1];
            }
        }
        episodes
    }

    /// Writes the rows of all demonstrations, one file after another and one row group for each pose.
    fn write_rows(&self, episodes: &[Episode], observer: &dyn Observer) -> Result<()> {
        let mut files: BTreeMap<usize, Vec<[usize; 4]>> = BTreeMap::new();
        for (number, episode) in episodes.iter().enumerate() {
            // One group for each pose begins with its first episode.
            let groups = files.entry(episode.file).or_default();
            let place = [episode.object, episode.pose];
            if groups.last().is_none_or(|group| group[..2] != place) {
                groups.push([episode.object, episode.pose, number, episode.rows[0]]);
            }
        }
        let files: Vec<_> = files.into_iter().collect();
        let path = |i: usize| data_path(&self.dir, files[i].0);
        Stage::new("files of rows", files.len(), observer, path).write(|i, path| {
            let groups = files[i].1.iter().map(|&[object, pose, episode, row]| {
                let part = self.part(&self.config.objects[object], pose)?;
                Ok(lerobot::rows(&part, object, episode, row))
            });
            table::write(path, groups, None)
        })
    }

    /// Writes the clouds of the object poses.
    fn write_clouds(&self) -> Result<()> {
        let (turns, clouds) = (self.config.turns, self.config.clouds);
        for name in &self.config.objects {
            for block in 0..self.config.poses.div_ceil(CLOUD_BLOCK) {
                let path = self.pose_clouds_path(name, block);
                if path.exists() {
                    continue;
                }
                let first = block * CLOUD_BLOCK;
                let last = (first + CLOUD_BLOCK).min(self.config.poses);
                let (mut noisy, mut clean, mut bearings, mut poses) = Default::default();
                for index in first..last {
                    let part = self.part(name, index)?;
                    Vec::extend(&mut noisy, part.noisy);
                    Vec::extend(&mut clean, part.clean);
                    Vec::extend(&mut bearings, part.turns);
                    Vec::extend(&mut poses, part.pose);
                }
                let count = last - first;
                let bytes = store::encode(
                    &[
                        ("noisy", vec![count, turns, clouds, CLOUD, 3], &noisy),
                        ("clean", vec![count, turns, CLOUD, 3], &clean),
                        ("turns", vec![count, turns], &bearings),
                        ("poses", vec![count, 3], &poses),
                    ],
                    None,
                )?;
                store::write(&path, &bytes)?;
            }
        }
        Ok(())
    }

    /// Removes what a complete dataset does not need any more.
    pub(crate) fn remove_parts(&self) -> Result<()> {
        let parts = self.dir.join(PARTS);
        if parts.exists() {
            std::fs::remove_dir_all(&parts)
                .with_context(|| format!("cannot remove {}", parts.display()))?;
        }
        Ok(())
    }
}

/// Every attempt at a demonstration with an object, the failed ones too.
fn attempt_columns(name: &str, parts: &[Part]) -> Columns {
    let all: Vec<(usize, &Attempt)> = parts
        .iter()
        .enumerate()
        .flat_map(|(pose, part)| part.attempts.iter().map(move |attempt| (pose, attempt)))
        .collect();
    let integers = |of: &dyn Fn(&Attempt) -> usize| {
        Column::Integers(all.iter().map(|(_, attempt)| of(attempt) as i64).collect())
    };
    let floats = |of: &dyn Fn(&Attempt) -> f32| {
        Column::Floats(all.iter().map(|(_, attempt)| of(attempt)).collect())
    };
    let flags = |of: &dyn Fn(&Attempt) -> Option<Fate>| {
        let lifts = |attempt| of(attempt).map(|fate| fate == Fate::Kept);
        Column::Flags(all.iter().map(|(_, attempt)| lifts(attempt)).collect())
    };
    vec![
        ("object", Column::Texts(vec![name.to_owned(); all.len()])),
        ("pose_index", Column::Integers(all.iter().map(|(pose, _)| *pose as i64).collect())),
        ("target_seed", integers(&|a| a.target)),
        ("grasp", integers(&|a| a.grasp)),
        ("fate", Column::Texts(all.iter().map(|(_, a)| a.fate.name().to_owned()).collect())),
        ("lifts_with_arm", flags(&|a| a.full)),
        ("bears_shaking", flags(&|a| a.endured)),
        ("lifts_perturbed", flags(&|a| a.perturbed)),
        ("rows", integers(&|a| a.rows)),
        ("touch", integers(&|a| a.touch)),
        ("restarts", integers(&|a| a.restarts)),
        ("clearance", floats(&|a| a.clearance)),
        ("jerk", floats(&|a| a.jerk)),
        ("slip", floats(&|a| a.slip)),
        ("target_in_reach", Column::Flags(all.iter().map(|(_, a)| Some(a.in_reach)).collect())),
        ("miss_distance", floats(&|a| a.miss[0])),
        ("miss_angle", floats(&|a| a.miss[1])),
    ]
}

/// Every pose of an object.
fn pose_columns(name: &str, parts: &[Part]) -> Columns {
    let floats = |of: &dyn Fn(&Part) -> f32| Column::Floats(parts.iter().map(of).collect());
    let integers = |of: &dyn Fn(&Part) -> i64| Column::Integers(parts.iter().map(of).collect());
    let grasp = |part: &Part| part.kept().next().map_or(-1, |attempt| attempt.grasp as i64);
    vec![
        ("object", Column::Texts(vec![name.to_owned(); parts.len()])),
        ("pose_index", Column::Integers((0..parts.len() as i64).collect())),
        ("x", floats(&|part| part.pose[0])),
        ("y", floats(&|part| part.pose[1])),
        ("yaw", floats(&|part| part.pose[2])),
        ("grasp", integers(&grasp)),
        ("attempts", integers(&|part| part.attempts.len() as i64)),
        ("kept", integers(&|part| part.kept().count() as i64)),
        ("jump", floats(&|part| part.jump)),
    ]
}
