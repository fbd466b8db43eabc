//! What a dataset is worth, counted object by object.

use crate::config::DatasetConfig;
use crate::part::{Attempt, Fate, Part};
use std::collections::BTreeMap;

/// Counts of one object; shares are left to the reader.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Summary {
    /// Poses of the object.
    pub poses: usize,
    /// Of these, without any attempt: no grasp is within reach, or there is none at all.
    pub out_of_reach: usize,
    /// Poses with enough kept demonstrations: a quarter of those that are wanted.
    pub enough: usize,
    /// Least share of poses with enough, over eight sectors of yaw.
    pub least_sector: f32,
    /// The same over the quarters of the workspace.
    pub least_quarter: f32,
    /// Poses by the grasp that serves them.
    pub grasps: BTreeMap<usize, usize>,
    /// Attempts at a demonstration by what became of them.
    pub fates: BTreeMap<String, usize>,
    /// Of the attempts that arm and hand replayed, before any filter: lifted, replayed.
    pub unfiltered: [usize; 2],
    /// Replayed with the hand alone (row) and with arm and hand (column): lost, lifted.
    pub agreement: [[usize; 2]; 2],
    /// The same with arm and hand for 2 s and shaken.
    pub endurance: [[usize; 2]; 2],
    /// Of the kept ones replayed with arm and hand beside their place: lifted, replayed.
    pub perturbed: [usize; 2],
    /// Duration (s) of the kept ones: median, 9 of 10.
    pub seconds: [f32; 2],
    /// Root mean square of their jerk (rad/s³) before `touch`: median, 9 of 10.
    pub jerk: [f32; 2],
    /// Least gap (m) of the robot from object and table up to `touch`, where the fingers come close: least,
    /// median.
    pub clearance: [f32; 2],
    /// Slip (m) of the object in the hand: median, 9 of 10.
    pub slip: [f32; 2],
    /// Restarts of the planner at most.
    pub restarts: usize,
    /// Of the targets that the arm reaches: arrived at, all.
    pub arrived: [usize; 2],
    /// Greatest difference (rad) of a joint between postures of a grasp for neighbouring poses.
    pub jump: f32,
}

impl Summary {
    /// Counts the parts of one object.
    pub fn of(parts: &[Part], config: &DatasetConfig) -> Self {
        let least_kept = config.trajectories.div_ceil(4);
        let is_enough = |part: &Part| part.kept().count() >= least_kept;
        let attempts = || parts.iter().flat_map(|part| &part.attempts);
        let kept = || parts.iter().flat_map(Part::kept);
        let mut fates = BTreeMap::new();
        for attempt in attempts() {
            *fates.entry(attempt.fate.name().to_owned()).or_insert(0) += 1;
        }
        let mut grasps = BTreeMap::new();
        for grasp in parts.iter().filter_map(|part| part.kept().next()).map(|kept| kept.grasp) {
            *grasps.entry(grasp).or_insert(0) += 1;
        }
        let lifted_of = |fates: Vec<Fate>| {
            [fates.iter().filter(|fate| **fate == Fate::Kept).count(), fates.len()]
        };
        let [center_x, center_y] = [0, 1].map(|axis| {
            let mut places: Vec<f32> = parts.iter().map(|part| part.pose[axis]).collect();
            quantile(&mut places, 0.5)
        });
        let sector = |part: &Part| {
            let eighth = std::f32::consts::FRAC_PI_4;
            part.pose[2].div_euclid(eighth).rem_euclid(8.0) as usize
        };
        let quarter = |part: &Part| {
            usize::from(part.pose[0] > center_x) + 2 * usize::from(part.pose[1] > center_y)
        };
        let two = |of: &dyn Fn(&Attempt) -> f32, shares: [f32; 2]| {
            let mut values: Vec<f32> = kept().map(of).collect();
            shares.map(|share| quantile(&mut values, share))
        };
        Self {
            poses: parts.len(),
            out_of_reach: parts.iter().filter(|part| part.attempts.is_empty()).count(),
            enough: parts.iter().filter(|part| is_enough(part)).count(),
            least_sector: least_share(parts, sector, is_enough),
            least_quarter: least_share(parts, quarter, is_enough),
            grasps,
            fates,
            unfiltered: lifted_of(attempts().filter_map(|attempt| attempt.full).collect()),
            agreement: table(attempts().filter_map(|a| Some([a.fate, a.full?]))),
            endurance: table(attempts().filter_map(|a| Some([a.fate, a.endured?]))),
            perturbed: lifted_of(attempts().filter_map(|attempt| attempt.perturbed).collect()),
            seconds: two(&|a| a.rows as f32 / 30.0, [0.5, 0.9]),
            jerk: two(&|a| a.jerk, [0.5, 0.9]),
            clearance: two(&|a| a.clearance, [0.0, 0.5]),
            slip: two(&|a| a.slip, [0.5, 0.9]),
            arrived: {
                let targets = || attempts().filter(|attempt| attempt.in_reach);
                [targets().filter(|target| target.is_arrival()).count(), targets().count()]
            },
            restarts: kept().map(|attempt| attempt.restarts).max().unwrap_or(0),
            jump: parts.iter().map(|part| part.jump).fold(0.0, f32::max),
        }
    }

    /// Attempts at a demonstration.
    pub fn attempts(&self) -> usize {
        self.fates.values().sum()
    }

    /// Those that were kept.
    pub fn kept(&self) -> usize {
        self.fates.get(Fate::Kept.name()).copied().unwrap_or(0)
    }
}

/// Least share of parts with a property among the groups that have any.
fn least_share(parts: &[Part], group: impl Fn(&Part) -> usize, has: impl Fn(&Part) -> bool) -> f32 {
    let mut counts: BTreeMap<usize, [usize; 2]> = BTreeMap::new();
    for part in parts {
        let count = counts.entry(group(part)).or_default();
        count[0] += usize::from(has(part));
        count[1] += 1;
    }
    counts.values().map(|[has, all]| *has as f32 / *all as f32).fold(1.0, f32::min)
}

/// Counts pairs of verdicts by whether they lifted.
fn table(pairs: impl Iterator<Item = [Fate; 2]>) -> [[usize; 2]; 2] {
    let mut counts = [[0; 2]; 2];
    for pair in pairs {
        let [a, b] = pair.map(|fate| usize::from(fate == Fate::Kept));
        counts[a][b] += 1;
    }
    counts
}

/// The value below which a share of the values lies; 0 if there are none.
fn quantile(values: &mut [f32], share: f32) -> f32 {
    values.sort_by(f32::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get(libm::ceilf(last as f32 * share) as usize).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attempt(fate: Fate, full: Option<Fate>) -> Attempt {
        Attempt {
            target: 0,
            grasp: 2,
            fate,
            full,
            endured: full,
            perturbed: None,
            rows: 60,
            touch: 35,
            restarts: 1,
            clearance: 0.003,
            jerk: 5.0,
            slip: 0.001,
            in_reach: fate != Fate::Slipped,
            miss: [if fate == Fate::Stuck { 0.05 } else { 0.01 }, 0.05],
        }
    }

    fn part(pose: [f32; 3], attempts: Vec<Attempt>) -> Part {
        Part { pose, jump: 0.1, attempts, ..Part::default() }
    }

    #[test]
    fn counts_are_those_of_the_attempts() {
        let config =
            DatasetConfig { trajectories: 4, ..DatasetConfig::preset("smoke", 0).unwrap() };
        let parts = [
            part(
                [0.5, -0.1, 0.1],
                vec![
                    attempt(Fate::Kept, Some(Fate::Kept)),
                    attempt(Fate::Slipped, Some(Fate::Kept)),
                    attempt(Fate::Stuck, None),
                ],
            ),
            part([0.7, 0.1, 0.2], vec![]),
            part([0.6, 0.2, 3.0], vec![attempt(Fate::Kept, None)]),
        ];
        let summary = Summary::of(&parts, &config);
        assert_eq!((summary.poses, summary.out_of_reach, summary.enough), (3, 1, 2));
        assert_eq!((summary.attempts(), summary.kept()), (4, 2));
        assert_eq!(summary.unfiltered, [2, 2]);
        assert_eq!(summary.agreement, [[0, 1], [0, 1]]);
        assert_eq!(summary.grasps, BTreeMap::from([(2, 2)]));
        assert_eq!(summary.arrived, [2, 3]);
        assert_eq!(summary.least_sector, 0.5);
        assert_eq!((summary.seconds[0], summary.restarts), (2.0, 1));
    }

    #[test]
    fn nothing_made_is_nothing_counted() {
        let config = DatasetConfig::preset("smoke", 0).unwrap();
        assert_eq!(Summary::of(&[], &config).kept(), 0);
    }
}
