//! Searches on all cores.

use crate::plan::object_poses::{coverage_poses, reachability};
use crate::search::grasp_search::GraspSearch;
use crate::search::task::{Region, Task, TaskResult};
use crate::search::tester::GraspTester;
use crate::search::{SearchConfig, SearchCounts, parallel};
use crate::set::clusters::{self, ScoredGrasp};
use crate::set::grasp::Grasp;
use crate::set::import::ImportedGrasp;
use crate::{GraspSet, RobotContext};
use objects::object::Object;
use progress::Progress;
use robot::Isometry;
use scene::SceneError;

/// Stage of searches and imports in their progress reports.
pub const STAGE: &str = "grasps";

/// Searches for grasps of `object` on all cores; also returns all robust grasps. `on_batch` receives the counts
/// after each batch of tasks.
pub fn search(
    robot: &RobotContext,
    object: &Object,
    config: &SearchConfig,
    seed: u64,
    on_batch: &dyn Fn(&SearchCounts),
) -> Result<(GraspSet, Vec<ScoredGrasp>), SceneError> {
    let tester = GraspTester::new(robot, object, config, seed);
    let mut search = GraspSearch::new(config.clone());
    loop {
        let batch = search.next_batch(robot, object);
        if batch.is_empty() {
            return Ok(search.finish());
        }
        let results = parallel::map(&batch, |task| tester.execute(task));
        search.complete(results.into_iter().collect::<Result<_, _>>()?);
        on_batch(&search.counts());
    }
}

/// Searches for robust grasps around a palm pose (object frame). All repeats of each are tried.
pub fn refine_around(
    robot: &RobotContext,
    object: &Object,
    config: &SearchConfig,
    palm: Isometry,
    seed: u64,
) -> Result<Vec<ScoredGrasp>, SceneError> {
    let tester = GraspTester::new(robot, object, config, seed);
    let mut found = Vec::new();
    for first in (0..config.max_perturbations).step_by(CLOSING_BATCH) {
        if found.len() >= config.target_per_seed {
            break;
        }
        let task = Task::Close { first, count: CLOSING_BATCH, region: Region::Around(palm) };
        let TaskResult::Closed { candidates: closed, .. } = tester.execute(&task)? else {
            continue;
        };
        let grasps: Vec<Grasp> = closed.into_iter().map(|closed| closed.grasp).collect();
        found.extend(tester.score_grasps(&grasps)?.into_iter().flatten());
    }
    found.retain(|found| found.repeat_successes >= config.min_repeat_successes);
    Ok(found)
}

/// Number of candidates that [`refine_around`] closes before it tries them.
const CLOSING_BATCH: usize = 16;

/// Number of imported grasps that are tried between two progress reports.
const IMPORT_BATCH: usize = 4;

/// Closes the hand at the palm poses of imported grasps, tries them in all repeats and clusters the robust
/// ones. `progress` receives the number of tried grasps, as the stage [`STAGE`].
pub fn try_imported(
    robot: &RobotContext,
    object: &Object,
    config: &SearchConfig,
    imported: &[ImportedGrasp],
    seed: u64,
    progress: &dyn Progress,
) -> Result<(GraspSet, Vec<ScoredGrasp>), SceneError> {
    let tester = GraspTester::new(robot, object, config, seed);
    let rows: Vec<(usize, &ImportedGrasp)> = imported.iter().enumerate().collect();
    let closed = parallel::map(&rows, |(i, row)| {
        let proposal = row.candidate_config(&config.candidate);
        tester.close_at(row.object_from_palm, &proposal, &mut tester.candidate_rng(*i))
    });
    let closed: Vec<Grasp> = closed.into_iter().flatten().map(|(grasp, _)| grasp).collect();
    let (mut num_tried, mut scored) = (0, Vec::new());
    for (i, batch) in closed.chunks(IMPORT_BATCH).enumerate() {
        progress.update(STAGE, i * IMPORT_BATCH, closed.len());
        let results = tester.score_grasps(batch)?;
        num_tried += results.len();
        scored.extend(results.into_iter().flatten());
    }
    let num_lifted = scored.len();
    scored.retain(|found| found.repeat_successes >= config.min_repeat_successes);
    let poses = coverage_poses(robot);
    let reach =
        parallel::map(&scored, |found| reachability(&tester.at_origin, &poses, &found.grasp));
    let hand = &robot.tree.hand;
    let selected = clusters::cluster_grasps(hand, object, &scored, &reach, config.num_clusters);
    let grasp = |(cluster, index): (usize, usize)| Grasp { cluster, ..scored[index].grasp.clone() };
    let set = GraspSet {
        grasps: selected.into_iter().map(grasp).collect(),
        num_candidates: imported.len(),
        num_closed: closed.len(),
        num_tried,
        num_lifted,
        num_robust: scored.len(),
    };
    Ok((set, scored))
}
