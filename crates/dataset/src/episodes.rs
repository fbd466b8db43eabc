//! The demonstrations of a dataset that were kept, counted through: episode 0 is the first of the first object.

use crate::part::STATE;
use crate::table;
use crate::{Dataset, Manifest};
use anyhow::{Context, Result, ensure};
use serde_json::{Value, json};

/// A demonstration.
#[derive(Clone, Debug)]
pub struct Episode {
    /// What it is of.
    pub entry: Entry,
    /// Joint positions and velocities, rows of [`STATE`].
    pub states: Vec<f32>,
}

/// A demonstration in a list.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Entry {
    /// Its number in the dataset.
    pub index: usize,
    /// Name of the object.
    pub object: String,
    /// Index of the object's pose among those of this object.
    pub pose_index: usize,
    /// x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// Its number among those of this pose.
    pub nth: usize,
}

impl Dataset {
    /// Episodes from one on, at most `limit`, of one object or of all.
    pub fn listed(&self, first: usize, limit: usize, of: Option<&str>) -> Result<Vec<Entry>> {
        let path = self.dir.join("poses.parquet");
        let mut entries = Vec::new();
        let mut before = 0;
        for (group, object) in self.config.objects.iter().enumerate() {
            let poses = table::read_group(&path, group)?;
            let place = ["x", "y", "yaw"].map(|name| table::floats(&poses, name));
            let [x, y, yaw] = place.map(|column| column.map(<[f32]>::to_vec));
            let (x, y, yaw) = (x?, y?, yaw?);
            let kept = table::integers(&poses, "kept")?;
            ensure!(kept.len() == self.config.poses, "{} is damaged", path.display());
            for (pose_index, kept) in kept.iter().enumerate() {
                for nth in 0..*kept as usize {
                    let index = before + nth;
                    if entries.len() == limit {
                        return Ok(entries);
                    }
                    if index >= first && of.is_none_or(|name| name == object) {
                        let pose = [x[pose_index], y[pose_index], yaw[pose_index]];
                        entries.push(Entry {
                            index,
                            object: object.clone(),
                            pose_index,
                            pose,
                            nth,
                        });
                    }
                }
                before += *kept as usize;
            }
        }
        Ok(entries)
    }

    /// Reads one episode.
    pub fn episode(&self, index: usize) -> Result<Episode> {
        let entry = self.listed(index, 1, None)?.pop();
        let entry = entry.with_context(|| {
            format!("{} has no episode {index}: the list says which", self.dir.display())
        })?;
        let object = self.config.objects.iter().position(|name| *name == entry.object);
        let record = self.pose(object.unwrap_or_default(), entry.pose_index)?;
        let span = &record.offsets[entry.nth..entry.nth + 2];
        Ok(Episode { states: record.states[STATE * span[0]..STATE * span[1]].to_vec(), entry })
    }

    /// One episode as a file that `rollout::Demonstration` reads and the page plays.
    pub fn demonstration(&self, index: usize) -> Result<Value> {
        let manifest = Manifest::read(&self.dir)?;
        let Episode { entry, states } = self.episode(index)?;
        let Entry { object, pose_index, pose, .. } = entry;
        let hash = manifest.inputs.objects.get(&object).context("the manifest lacks its object")?;
        let (kind, dataset) = (object.replace('_', " "), &manifest.hash[..8]);
        Ok(json!({
            "demonstration": format!("episode {index}, {kind} at pose {pose_index}, of dataset {dataset}"),
            "scene": manifest.inputs.scene,
            "object": hash,
            "name": object,
            "pose": pose,
            "states": states.chunks_exact(STATE).collect::<Vec<_>>(),
        }))
    }
}
