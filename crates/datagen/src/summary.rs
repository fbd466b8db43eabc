//! Statistics of the shards of an object.

use configs::DatasetConfig;
use dataset::shard::{DemoOutcome, DemoTrial, PoseShard};
use dataset_manifest::Summary;
use grasps::plan::demonstration::GoalError;
use std::collections::BTreeMap;

/// Counts the shards of one object.
pub(crate) fn summarize(shards: &[PoseShard], config: &DatasetConfig) -> Summary {
    let min_kept = config.trajectories.div_ceil(4);
    let is_covered = |shard: &PoseShard| shard.kept().count() >= min_kept;
    let trials = || shards.iter().flat_map(|shard| &shard.trials);
    let kept = || shards.iter().flat_map(PoseShard::kept);
    let mut outcomes = BTreeMap::new();
    for trial in trials() {
        *outcomes.entry(trial.outcome.name().to_owned()).or_insert(0) += 1;
    }
    let mut grasps = BTreeMap::new();
    for grasp in shards.iter().filter_map(|shard| shard.kept().next()).map(|kept| kept.grasp) {
        *grasps.entry(grasp).or_insert(0) += 1;
    }
    let lifted_of = |outcomes: Vec<DemoOutcome>| {
        [outcomes.iter().filter(|outcome| **outcome == DemoOutcome::Kept).count(), outcomes.len()]
    };
    let [center_x, center_y] = [0, 1].map(|axis| {
        let mut values: Vec<f32> = shards.iter().map(|shard| shard.pose[axis]).collect();
        quantile(&mut values, 0.5)
    });
    let sector = |shard: &PoseShard| {
        let eighth = std::f32::consts::FRAC_PI_4;
        shard.pose[2].div_euclid(eighth).rem_euclid(8.0) as usize
    };
    let quarter = |shard: &PoseShard| {
        usize::from(shard.pose[0] > center_x) + 2 * usize::from(shard.pose[1] > center_y)
    };
    let quantiles = |of: &dyn Fn(&DemoTrial) -> f32, levels: [f32; 2]| {
        let mut values: Vec<f32> = kept().map(of).collect();
        levels.map(|level| quantile(&mut values, level))
    };
    Summary {
        poses: shards.len(),
        unreachable: shards.iter().filter(|shard| shard.trials.is_empty()).count(),
        well_covered: shards.iter().filter(|shard| is_covered(shard)).count(),
        min_yaw_coverage: min_fraction(shards, sector, is_covered),
        min_area_coverage: min_fraction(shards, quarter, is_covered),
        grasps,
        outcomes,
        survived_shaking: lifted_of(trials().filter_map(|trial| trial.shaken).collect()),
        lifted_perturbed: lifted_of(trials().filter_map(|trial| trial.perturbed).collect()),
        duration: quantiles(&|a| a.num_frames as f32 / 30.0, [0.5, 0.9]),
        jerk: quantiles(&|a| a.jerk, [0.5, 0.9]),
        clearance: quantiles(&|a| a.clearance, [0.0, 0.5]),
        slip: quantiles(&|a| a.slip, [0.5, 0.9]),
        goals_reached: {
            let targets = || trials().filter(|trial| trial.is_reachable);
            [targets().filter(|target| reached_goal(target)).count(), targets().count()]
        },
        max_restarts: kept().map(|trial| trial.restarts).max().unwrap_or(0),
        max_joint_jump: shards.iter().map(|shard| shard.max_joint_jump).fold(0.0, f32::max),
    }
}

/// Minimum fraction of shards with a property, over the groups that are not empty.
fn min_fraction(
    shards: &[PoseShard],
    group: impl Fn(&PoseShard) -> usize,
    has: impl Fn(&PoseShard) -> bool,
) -> f32 {
    let mut counts: BTreeMap<usize, [usize; 2]> = BTreeMap::new();
    for shard in shards {
        let count = counts.entry(group(shard)).or_default();
        count[0] += usize::from(has(shard));
        count[1] += 1;
    }
    counts.values().map(|[has, all]| *has as f32 / *all as f32).fold(1.0, f32::min)
}

/// Whether the motion of a trial converged at the target.
fn reached_goal(trial: &DemoTrial) -> bool {
    let [distance, angle] = trial.goal_error.map(f64::from);
    trial.num_frames > 0 && GoalError { distance, angle }.is_reached()
}

/// Quantile of the values; 0 if there are none.
fn quantile(values: &mut [f32], level: f32) -> f32 {
    values.sort_by(f32::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get(libm::ceilf(last as f32 * level) as usize).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(fate: DemoOutcome, shaken: Option<DemoOutcome>) -> DemoTrial {
        DemoTrial {
            target: 0,
            grasp: 2,
            outcome: fate,
            shaken,
            perturbed: None,
            num_frames: 60,
            contact_row: 35,
            restarts: 1,
            clearance: 0.003,
            jerk: 5.0,
            slip: 0.001,
            is_reachable: fate != DemoOutcome::Slipped,
            goal_error: [if fate == DemoOutcome::NotConverged { 0.05 } else { 0.01 }, 0.05],
        }
    }

    fn shard(pose: [f32; 3], trials: Vec<DemoTrial>) -> PoseShard {
        PoseShard { pose, max_joint_jump: 0.1, trials, ..PoseShard::default() }
    }

    #[test]
    fn summary_counts_match_trials() {
        let config =
            DatasetConfig { trajectories: 4, ..DatasetConfig::preset("smoke", 0).unwrap() };
        let shards = [
            shard(
                [0.5, -0.1, 0.1],
                vec![
                    trial(DemoOutcome::Kept, Some(DemoOutcome::Kept)),
                    trial(DemoOutcome::Slipped, Some(DemoOutcome::Slipped)),
                    trial(DemoOutcome::NotConverged, None),
                ],
            ),
            shard([0.7, 0.1, 0.2], vec![]),
            shard([0.6, 0.2, 3.0], vec![trial(DemoOutcome::Kept, None)]),
        ];
        let summary = summarize(&shards, &config);
        assert_eq!((summary.poses, summary.unreachable, summary.well_covered), (3, 1, 2));
        assert_eq!((summary.trials(), summary.kept()), (4, 2));
        assert_eq!(summary.survived_shaking, [1, 2]);
        assert_eq!(summary.grasps, BTreeMap::from([(2, 2)]));
        assert_eq!(summary.goals_reached, [2, 3]);
        assert_eq!(summary.min_yaw_coverage, 0.5);
        assert_eq!((summary.duration[0], summary.max_restarts), (2.0, 1));
    }

    #[test]
    fn summary_is_zero_when_no_shards_exist() {
        let config = DatasetConfig::preset("smoke", 0).unwrap();
        assert_eq!(summarize(&[], &config).kept(), 0);
    }
}
