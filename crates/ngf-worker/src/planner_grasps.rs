//! Grasps of the planner: of a built-in object, from a file, or from a search.

use crate::object_selection::SelectedObject;
use crate::progress_bar::Bar;
use anyhow::{Context, Result, bail};
use grasps::search::{STAGE, SearchConfig, SearchCounts, search};
use grasps::set::catalog::catalog_grasps;
use grasps::{GraspSet, RobotContext};
use rollout::Controller;
use std::path::Path;
use std::sync::Arc;

/// The planner for an object. Its grasps are those of `file`, as written by `ngf grasps`; without a file those of
/// the built-in object, or of a search with the seed `seed`.
pub(crate) fn planner(
    robot: &RobotContext,
    selected: &SelectedObject,
    file: Option<&Path>,
    seed: u64,
) -> Result<Controller> {
    let SelectedObject { name, object, .. } = selected;
    let set = match file {
        Some(path) => read(path)?,
        None if catalog_grasps(name).is_some() => return Ok(Controller::Planner),
        None => {
            let bar = Bar::new(STAGE, 100);
            let show = |counts: &SearchCounts| bar.set((100.0 * counts.fraction) as usize);
            let (set, _) = search(robot, object, &SearchConfig::paper(robot), seed, &show)?;
            bar.clear();
            let (tried, robust) = (set.num_tried, set.num_robust);
            println!(
                "{name}: {tried} grasps tried, {robust} robust; --grasps FILE would use others"
            );
            set
        }
    };
    Ok(Controller::PlannedGrasps(Arc::new(set.grasps)))
}

/// Reads a grasp file.
fn read(path: &Path) -> Result<GraspSet> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let set: GraspSet = serde_json::from_slice(&bytes).with_context(|| {
        format!("{} contains no grasps; write it by `ngf grasps --out FILE`", path.display())
    })?;
    if set.grasps.is_empty() {
        bail!("{} has an empty list of grasps", path.display());
    }
    Ok(set)
}
