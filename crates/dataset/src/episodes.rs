//! Episodes of a dataset: the kept demonstrations, numbered from 0 in order of objects and poses.

use crate::Dataset;
use crate::parquet_io;
use crate::shard::STATE_DIM;
use anyhow::{Context, Result, ensure};
use dataset_manifest::Manifest;
use serde_json::{Value, json};

/// An episode with its states.
#[derive(Clone, Debug)]
pub struct Episode {
    /// Index, object and pose of the episode.
    pub entry: EpisodeEntry,
    /// Joint positions (rad) and velocities (rad/s), rows of [`STATE_DIM`].
    pub states: Vec<f32>,
}

/// List entry of an episode.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct EpisodeEntry {
    /// Index in the dataset.
    pub index: usize,
    /// Name of the object.
    pub object: String,
    /// Index of the pose among the poses of this object.
    pub pose_index: usize,
    /// x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// Index among the episodes of this pose.
    pub index_at_pose: usize,
}

impl Dataset {
    /// Lists up to `limit` episodes from index `first` on, of one object or of all objects.
    pub fn list_episodes(
        &self,
        first: usize,
        limit: usize,
        of: Option<&str>,
    ) -> Result<Vec<EpisodeEntry>> {
        let path = self.dir.join("poses.parquet");
        let mut entries = Vec::new();
        let mut before = 0;
        for (group, object) in self.config.objects.iter().enumerate() {
            let poses = parquet_io::read_group(&path, group)?;
            let place = ["x", "y", "yaw"].map(|name| parquet_io::floats(&poses, name));
            let [x, y, yaw] = place.map(|column| column.map(<[f32]>::to_vec));
            let (x, y, yaw) = (x?, y?, yaw?);
            let kept = parquet_io::integers(&poses, "num_kept")?;
            ensure!(kept.len() == self.config.poses, "{} is damaged", path.display());
            for (pose_index, kept) in kept.iter().enumerate() {
                for nth in 0..*kept as usize {
                    let index = before + nth;
                    if entries.len() == limit {
                        return Ok(entries);
                    }
                    if index >= first && of.is_none_or(|name| name == object) {
                        let pose = [x[pose_index], y[pose_index], yaw[pose_index]];
                        entries.push(EpisodeEntry {
                            index,
                            object: object.clone(),
                            pose_index,
                            pose,
                            index_at_pose: nth,
                        });
                    }
                }
                before += *kept as usize;
            }
        }
        Ok(entries)
    }

    /// Reads the episode with this index.
    pub fn read_episode(&self, index: usize) -> Result<Episode> {
        let entry = self.list_episodes(index, 1, None)?.pop();
        let entry = entry.with_context(|| {
            format!("{} has no episode {index}; `ngf dataset info` prints the number of kept demonstrations", self.dir.display())
        })?;
        let object = self.config.objects.iter().position(|name| *name == entry.object);
        let record = self.read_pose(object.unwrap_or_default(), entry.pose_index)?;
        let span = &record.offsets[entry.index_at_pose..entry.index_at_pose + 2];
        Ok(Episode {
            states: record.states[STATE_DIM * span[0]..STATE_DIM * span[1]].to_vec(),
            entry,
        })
    }

    /// Exports one episode as a file for `rollout::DemonstrationFile` and the page.
    pub fn export_demonstration(&self, index: usize) -> Result<Value> {
        let manifest = Manifest::read(&self.dir)?;
        let Episode { entry, states } = self.read_episode(index)?;
        let EpisodeEntry { object, pose_index, pose, .. } = entry;
        let hash = manifest
            .provenance
            .objects
            .get(&object)
            .context("the manifest does not list this object")?;
        let (title, dataset) = (object.replace('_', " "), &manifest.hash[..8]);
        Ok(json!({
            "description": format!("episode {index}: {title}, pose {pose_index}, dataset {dataset}"),
            "scene_hash": manifest.provenance.scene,
            "object_hash": hash,
            "object_name": object,
            "object_pose": pose,
            "states": states.chunks_exact(STATE_DIM).collect::<Vec<_>>(),
        }))
    }
}
