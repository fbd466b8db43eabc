//! Grasp search: decides which candidates are closed and tried, until robust grasps cover the workspace.
//!
//! Sampling and trials alternate. A trial goes to the candidate that may add most object poses, repeats go to
//! those that lifted. Only the selected grasps are tried in all repeats and shaken.

use crate::RobotContext;
use crate::search::SearchConfig;
use crate::search::candidate_pool::CandidatePool;
use crate::search::candidates::{NearMiss, Rejections};
use crate::search::task::{Region, Task, TaskResult};
use crate::search::tested_candidate::TestedCandidate;
use crate::search::tester::Trial;
use crate::set::clusters::{self, HALF_TURN_TOLERANCE, ScoredGrasp, half_turn};
use crate::set::grasp::Grasp;
use crate::set::grasp_set::GraspSet;
use crate::set::k_medoids::palm_distance;
use objects::object::Object;

/// A running search. It proposes batches of independent [`Task`]s and decides on their results; the caller
/// executes them where it wants. [`search`](super::search) uses all cores, a page its workers.
///
/// The decisions depend on the results alone, so the number of threads or workers does not change the grasps.
pub struct GraspSearch {
    pool: CandidatePool,
    stage: Stage,
    /// Number of finished rounds of sampling; each samples twice as many closed candidates as the one before.
    round: u32,
    /// Whether there is nothing left to try.
    is_exhausted: bool,
    /// Whether the limits of the configuration are extended, because grasps lift but none is robust.
    is_extended: bool,
    /// Number of covered poses, and of tested candidates when it last changed.
    last_coverage: (usize, usize),
    /// The best rejected candidates, best first.
    near_misses: Vec<NearMiss>,
    /// For each task of the current batch, what its result belongs to.
    pending: Vec<Purpose>,
    /// Candidates whose half turn has been sampled.
    turned: Vec<usize>,
    selected: Vec<Grasp>,
    counts: SearchCounts,
}

/// Counts of a search so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SearchCounts {
    /// TestedCandidate palm poses.
    pub candidates: usize,
    /// Candidates with balanced contact forces.
    pub closed: usize,
    /// The other candidates.
    pub rejections: Rejections,
    /// Closed candidates without a motion into the grasp.
    pub unapproachable: usize,
    /// Closed candidates that were tried in physics.
    pub tried: usize,
    /// Tried grasps that lifted the object.
    pub lifted: usize,
    /// Grasps that also lifted it in repeats.
    pub robust: usize,
    /// Estimated completed fraction, 0 to 1; does not decrease.
    pub fraction: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Sampling,
    Trying,
    /// Determines the reach of robust grasps.
    Reaching,
    /// Selects grasps, and tries them in the missing repeats.
    Confirming,
    Finished,
}

#[derive(Clone, Copy, Debug)]
enum Purpose {
    /// Sample candidates, near the half turn of this one.
    Sample {
        counterpart_of: Option<usize>,
    },
    Try(usize, Trial),
    Approach(usize),
    Reach(usize),
}

/// Number of closed candidates of the first round.
const FIRST_ROUND: usize = 24;

/// Number of candidates per closing task, of closing tasks per batch, and of trials per batch. Larger batches
/// occupy more threads and waste more work.
const CANDIDATES_PER_TASK: usize = 8;
const CLOSINGS_PER_BATCH: usize = 8;
const TRIALS_PER_BATCH: usize = 8;

/// Number of closing tasks near the half turn of a robust grasp.
const COUNTERPART_CLOSINGS: usize = 3;

/// Sampling evolves where closed candidates are rare: among this many candidates, fewer than this share. Each batch
/// then samples around the best near misses, and in some tasks everywhere.
const MIN_SAMPLE: usize = 2000;
const RARE: f64 = 0.005;
const MAX_NEAR_MISSES: usize = 12;
const NUM_EVERYWHERE: usize = 4;

/// Sampling also evolves where grasps lift but none is robust: around this many that lifted most often.
const MAX_LIFTED_REGIONS: usize = 4;

/// Share of the completed fraction that the trials before the confirmation get.
const TRYING_SHARE: f64 = 0.75;

impl GraspSearch {
    /// Starts a search.
    pub fn new(config: SearchConfig) -> Self {
        Self {
            pool: CandidatePool::new(config),
            stage: Stage::Sampling,
            round: 0,
            is_exhausted: false,
            is_extended: false,
            last_coverage: (0, 0),
            near_misses: Vec::new(),
            pending: Vec::new(),
            turned: Vec::new(),
            selected: Vec::new(),
            counts: SearchCounts::default(),
        }
    }

    /// The next tasks, in a fixed order; empty when the search has ended. [`complete`](Self::complete) takes
    /// their results.
    pub fn next_batch(&mut self, robot: &RobotContext, object: &Object) -> Vec<Task> {
        loop {
            let batch = match self.stage {
                Stage::Sampling => self.closing_batch(),
                Stage::Trying => self.trial_batch(robot, object),
                Stage::Reaching => self.reach_batch(),
                Stage::Confirming => self.confirmation_batch(robot, object),
                Stage::Finished => return Vec::new(),
            };
            if !batch.is_empty() {
                let (pending, tasks) = batch.into_iter().unzip();
                self.pending = pending;
                return tasks;
            }
            self.stage = self.next_stage();
        }
    }

    /// Takes the results of the current batch, in the order of its tasks.
    ///
    /// # Panics
    /// A result belongs to another kind of task.
    pub fn complete(&mut self, results: Vec<TaskResult>) {
        for (purpose, result) in std::mem::take(&mut self.pending).into_iter().zip(results) {
            match (purpose, result) {
                (
                    Purpose::Sample { counterpart_of },
                    TaskResult::Closed { candidates, rejections, near_miss },
                ) => {
                    self.counts.rejections += rejections;
                    self.counts.closed += candidates.len();
                    let new =
                        candidates.into_iter().map(|one| TestedCandidate::new(one, counterpart_of));
                    self.pool.candidates.extend(new);
                    self.near_misses.extend(near_miss);
                }
                (Purpose::Try(index, trial), TaskResult::Tried(result)) => {
                    let candidate = &mut self.pool.candidates[index];
                    candidate.yaw = result.map(|result| result.yaw);
                    candidate.record(trial, result.and_then(|result| result.slip));
                    if trial == Trial::Screening {
                        self.counts.tried += usize::from(result.is_some());
                        self.counts.lifted += usize::from(candidate.has_lifted());
                    }
                }
                (Purpose::Approach(index), TaskResult::Approached(is_approachable)) => {
                    self.pool.candidates[index].is_approachable = Some(is_approachable);
                    self.counts.unapproachable += usize::from(!is_approachable);
                }
                (Purpose::Reach(index), TaskResult::Reached(reach)) => {
                    self.pool.candidates[index].reach = Some(reach);
                }
                _ => panic!("the result of another task"),
            }
        }
        self.near_misses.sort_by(|a, b| a.error.total_cmp(&b.error));
        self.near_misses.truncate(MAX_NEAR_MISSES);
        self.counts.robust = self.pool.robust().count();
        let [covered, _] = self.pool.coverage();
        // Coverage decreases when a robust grasp fails later.
        if covered != self.last_coverage.0 {
            self.last_coverage = (covered, self.pool.num_tested());
        }
        self.counts.fraction = self.counts.fraction.max(self.fraction());
    }

    /// Counts so far.
    pub fn counts(&self) -> SearchCounts {
        self.counts
    }

    /// Robust grasps so far, in the order in which they were sampled.
    pub fn robust_grasps(&self) -> impl Iterator<Item = &Grasp> {
        self.pool.robust().map(|(_, candidate)| &candidate.grasp)
    }

    /// The selected grasps, and all robust grasps with their scores.
    pub fn finish(self) -> (GraspSet, Vec<ScoredGrasp>) {
        let total = self.pool.config.num_repeats;
        let robust = self.pool.robust().map(|(_, candidate)| candidate.scored(total)).collect();
        let SearchCounts { candidates, closed, tried, lifted, robust: num_robust, .. } =
            self.counts;
        let set = GraspSet {
            grasps: self.selected,
            num_candidates: candidates,
            num_closed: closed,
            num_tried: tried,
            num_lifted: lifted,
            num_robust,
        };
        (set, robust)
    }

    /// The stage that follows one without tasks.
    fn next_stage(&mut self) -> Stage {
        let stage = self.stage;
        match stage {
            Stage::Sampling => Stage::Trying,
            Stage::Trying if self.is_enough() => Stage::Reaching,
            Stage::Trying if self.can_sample() && self.can_test() => {
                self.round += 1;
                Stage::Sampling
            }
            Stage::Trying if self.extend() => Stage::Trying,
            Stage::Trying => {
                self.is_exhausted = true;
                Stage::Reaching
            }
            Stage::Reaching => Stage::Confirming,
            // Selected grasps have failed in their repeats.
            Stage::Confirming if !self.is_exhausted && !self.is_enough() => Stage::Trying,
            Stage::Confirming if self.extend() => {
                self.is_exhausted = false;
                Stage::Trying
            }
            Stage::Confirming | Stage::Finished => Stage::Finished,
        }
    }

    /// Number of closed candidates at which a round of sampling ends.
    fn round_target(&self) -> usize {
        (FIRST_ROUND << self.round).min(self.max_closed())
    }

    fn max_closed(&self) -> usize {
        self.extension() * self.pool.config.max_closed
    }

    fn max_tested(&self) -> usize {
        self.extension() * self.pool.config.max_tested
    }

    /// Factor on the limits of the configuration.
    fn extension(&self) -> usize {
        if self.is_extended { self.pool.config.extension } else { 1 }
    }

    /// Extends a search that would end without a robust grasp, once. Returns whether it has.
    fn extend(&mut self) -> bool {
        let extends = !self.is_extended && self.counts.robust == 0 && self.counts.lifted > 0;
        self.is_extended |= extends;
        extends
    }

    fn can_sample(&self) -> bool {
        self.counts.candidates < self.pool.config.max_candidates
            && self.round_target() < self.max_closed()
    }

    /// Whether another new candidate may be tested.
    fn can_test(&self) -> bool {
        self.pool.num_tested() < self.max_tested()
    }

    fn closing_batch(&mut self) -> Vec<(Purpose, Task)> {
        let is_full = self.counts.closed >= self.round_target();
        if is_full || self.counts.candidates >= self.pool.config.max_candidates {
            return Vec::new();
        }
        let lifted = self.lifted_regions();
        if !lifted.is_empty() {
            let everywhere = std::iter::repeat_n(Region::Everywhere, NUM_EVERYWHERE);
            let regions = lifted.into_iter().chain(everywhere);
            return regions.flat_map(|region| self.sample(1, None, &region)).collect();
        }
        let is_rare = self.counts.candidates >= MIN_SAMPLE
            && (self.counts.closed as f64) < RARE * self.counts.candidates as f64;
        if !is_rare {
            return self.sample(CLOSINGS_PER_BATCH, None, &Region::Everywhere);
        }
        let near_misses = self.near_misses.iter();
        let around: Vec<Region> = near_misses
            .map(|near_miss| Region::around(&near_miss.object_from_palm, &near_miss.pinch))
            .collect();
        let everywhere = std::iter::repeat_n(Region::Everywhere, NUM_EVERYWHERE);
        let regions = around.into_iter().chain(everywhere);
        regions.flat_map(|region| self.sample(1, None, &region)).collect()
    }

    /// Regions around the grasps that lifted most often, while none is robust.
    fn lifted_regions(&self) -> Vec<Region> {
        if self.counts.robust > 0 {
            return Vec::new();
        }
        let lifted = self.pool.candidates.iter().filter(|one| one.num_lifted() > 0);
        let mut lifted: Vec<&TestedCandidate> = lifted.collect();
        lifted.sort_by_key(|one| std::cmp::Reverse(one.num_lifted()));
        let region =
            |one: &&TestedCandidate| Region::around(&one.grasp.object_from_palm, &one.pinch);
        lifted.iter().take(MAX_LIFTED_REGIONS).map(region).collect()
    }

    fn sample(
        &mut self,
        num_tasks: usize,
        counterpart_of: Option<usize>,
        region: &Region,
    ) -> Vec<(Purpose, Task)> {
        let close = |_| {
            let first = self.counts.candidates;
            self.counts.candidates += CANDIDATES_PER_TASK;
            let task = Task::Close { first, count: CANDIDATES_PER_TASK, region: region.clone() };
            (Purpose::Sample { counterpart_of }, task)
        };
        (0..num_tasks).map(close).collect()
    }

    /// Next tests of the candidates in progress and of half turns; then the most valuable new candidates.
    fn trial_batch(&mut self, robot: &RobotContext, object: &Object) -> Vec<(Purpose, Task)> {
        let mut batch = self.missing_half_turns(robot, object);
        for (index, candidate) in self.pool.candidates.iter().enumerate() {
            if candidate.is_approachable == Some(true) && candidate.is_untried() {
                batch.push(self.try_task(index, Trial::Screening));
            } else if self.pool.is_promising(candidate) {
                let missing = candidate.num_repeats()..self.pool.config.num_screening_repeats;
                let missing = missing.map(Trial::ShortRepeat);
                batch.extend(missing.map(|trial| self.try_task(index, trial)));
            }
        }
        let counterparts = self.pool.counterparts_to_test(&self.turned);
        batch.extend(counterparts.into_iter().map(|index| self.approach_task(index)));
        if !self.is_enough() {
            let max = self.max_tested().saturating_sub(self.pool.num_tested());
            let count = TRIALS_PER_BATCH.saturating_sub(batch.len()).min(max);
            let new = self.pool.most_valuable(count);
            batch.extend(new.into_iter().map(|index| self.approach_task(index)));
        }
        batch
    }

    fn approach_task(&self, index: usize) -> (Purpose, Task) {
        let grasp = self.pool.candidates[index].grasp.clone();
        (Purpose::Approach(index), Task::Approach { grasp })
    }

    fn try_task(&self, index: usize, trial: Trial) -> (Purpose, Task) {
        let TestedCandidate { grasp, yaw, .. } = &self.pool.candidates[index];
        (Purpose::Try(index, trial), Task::Try { grasp: grasp.clone(), yaw: *yaw, trial })
    }

    /// Samples near the half turns of robust grasps that have no counterpart.
    fn missing_half_turns(
        &mut self,
        robot: &RobotContext,
        object: &Object,
    ) -> Vec<(Purpose, Task)> {
        let palms: Vec<_> = self
            .pool
            .robust()
            .map(|(index, candidate)| (index, candidate.grasp.object_from_palm))
            .collect();
        let mut batch = Vec::new();
        for (index, palm) in &palms {
            let is_counterpart = self.pool.candidates[*index].counterpart_of.is_some();
            if is_counterpart || self.turned.contains(index) {
                continue;
            }
            self.turned.push(*index);
            let turned = half_turn(&robot.tree.hand, object, palm);
            if palms.iter().all(|(_, other)| palm_distance(&turned, other) > HALF_TURN_TOLERANCE) {
                let region = Region::AroundHalfTurn(*palm);
                batch.extend(self.sample(COUNTERPART_CLOSINGS, Some(*index), &region));
            }
        }
        batch
    }

    /// Reach of the robust grasps.
    fn reach_batch(&self) -> Vec<(Purpose, Task)> {
        let unknown = self.pool.robust().filter(|(_, candidate)| candidate.reach.is_none());
        let reach = |(index, candidate): (usize, &TestedCandidate)| {
            (Purpose::Reach(index), Task::Reach { grasp: candidate.grasp.clone() })
        };
        unknown.map(reach).collect()
    }

    /// Selects grasps. Returns their missing repeats.
    fn confirmation_batch(
        &mut self,
        robot: &RobotContext,
        object: &Object,
    ) -> Vec<(Purpose, Task)> {
        let (total, min_successes) =
            (self.pool.config.num_repeats, self.pool.config.min_repeat_successes);
        let (indices, scored): (Vec<usize>, Vec<ScoredGrasp>) =
            self.pool.robust().map(|(index, candidate)| (index, candidate.scored(total))).unzip();
        let reach: Vec<Vec<bool>> =
            indices.iter().filter_map(|&index| self.pool.candidates[index].reach.clone()).collect();
        let (hand, count) = (&robot.tree.hand, self.pool.config.num_clusters);
        let selected = clusters::cluster_grasps(hand, object, &scored, &reach, count);
        let this = &*self;
        let missing = |&(_, selected): &(usize, usize)| {
            let index = indices[selected];
            let candidate = &self.pool.candidates[index];
            let trials = candidate.missing_trials(min_successes).into_iter();
            trials.map(|trial| this.try_task(index, trial)).collect::<Vec<_>>()
        };
        let batch: Vec<_> = selected.iter().flat_map(missing).collect();
        let grasp = |&(cluster, selected): &(usize, usize)| Grasp {
            cluster,
            ..scored[selected].grasp.clone()
        };
        self.selected = selected.iter().map(grasp).collect();
        batch
    }

    fn is_enough(&self) -> bool {
        let num_fruitless = self.pool.num_tested() - self.last_coverage.1;
        let is_fruitless =
            self.last_coverage.0 > 0 && num_fruitless >= self.pool.config.max_fruitless;
        if is_fruitless || self.counts.robust >= self.pool.config.target_robust {
            return true;
        }
        let [covered, coverable] = self.pool.coverage();
        self.counts.robust > 0
            && covered as f64 >= self.pool.config.target_coverage * coverable as f64
    }

    fn fraction(&self) -> f64 {
        let share = |count: usize, total: usize| (count as f64 / total.max(1) as f64).min(1.0);
        match self.stage {
            Stage::Sampling | Stage::Trying => {
                let [covered, coverable] = self.pool.coverage();
                let goals = [
                    share(covered, coverable),
                    share(self.counts.robust, self.pool.config.target_robust),
                    share(self.pool.num_tested(), self.pool.config.max_tested),
                    share(self.counts.candidates, self.pool.config.max_candidates),
                ];
                TRYING_SHARE * goals.into_iter().fold(0.0, f64::max)
            }
            Stage::Reaching => TRYING_SHARE,
            Stage::Confirming => 0.5 + 0.5 * TRYING_SHARE,
            Stage::Finished => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::object_poses::NUM_COVERAGE_POSES;
    use crate::search::task::{ClosedCandidate, SPARSE_STEP, TrialResult};
    use robot::Isometry;

    const NUM_SPARSE: usize = NUM_COVERAGE_POSES / SPARSE_STEP;

    /// Index of the first candidate of the task that closed this grasp.
    fn id(grasp: &Grasp) -> usize {
        (grasp.object_from_palm.translation.x / 0.1).round() as usize
    }

    /// Result of a task without physics: each closing task finds one grasp that reaches a twentieth of the poses.
    /// `holds` decides on the trials.
    fn execute(task: &Task, holds: &dyn Fn(usize, Trial) -> bool) -> TaskResult {
        let reaches =
            |id: usize, pose: usize| pose % NUM_SPARSE == (id / CANDIDATES_PER_TASK) % NUM_SPARSE;
        match task {
            Task::Close { first, .. } => {
                let hand = [0.0; robot::HAND_DOF];
                let object_from_palm = Isometry::translation(0.1 * *first as f64, 0.0, 0.2);
                let grasp = Grasp {
                    cluster: 0,
                    object_from_palm,
                    pregrasp: hand,
                    grasp: hand,
                    squeeze: hand,
                };
                let sparse_reach = (0..NUM_SPARSE).map(|pose| reaches(*first, pose)).collect();
                let candidates =
                    vec![ClosedCandidate { grasp, pinch: None, force_margin: 1.0, sparse_reach }];
                TaskResult::Closed {
                    candidates,
                    rejections: Rejections::default(),
                    near_miss: None,
                }
            }
            Task::Approach { .. } => TaskResult::Approached(true),
            Task::Try { grasp, trial, .. } => {
                let slip = holds(id(grasp), *trial).then_some(0.001);
                TaskResult::Tried(Some(TrialResult { yaw: 0, slip }))
            }
            Task::Reach { grasp } => TaskResult::Reached(
                (0..NUM_COVERAGE_POSES).map(|pose| reaches(id(grasp), pose)).collect(),
            ),
        }
    }

    /// Runs a search to its end. Returns the result, and the counts after each batch.
    fn run(
        config: SearchConfig,
        holds: &dyn Fn(usize, Trial) -> bool,
    ) -> (GraspSet, Vec<SearchCounts>) {
        let robot = RobotContext::standard().unwrap();
        let object = Object::from_catalog("sugar_box").unwrap();
        let (mut search, mut counts) = (GraspSearch::new(config), Vec::new());
        loop {
            let batch = search.next_batch(&robot, &object);
            if batch.is_empty() {
                return (search.finish().0, counts);
            }
            // Tasks and results pass through bytes, as between the workers of a page.
            let through_bytes = |task: &Task| {
                let result = execute(&Task::from_bytes(&task.to_bytes()).unwrap(), holds);
                TaskResult::from_bytes(&result.to_bytes()).unwrap()
            };
            search.complete(batch.iter().map(through_bytes).collect());
            counts.push(search.counts());
        }
    }

    fn config() -> SearchConfig {
        SearchConfig::paper(&RobotContext::standard().unwrap())
    }

    #[test]
    fn search_ends_when_robust_grasps_cover_all_reachable_poses() {
        let (set, counts) = run(config(), &|_, _| true);
        // A grasp for each pose, and the counterparts of some.
        assert!((NUM_SPARSE..=2 * NUM_SPARSE).contains(&set.num_robust), "{set:?}");
        assert!(set.num_tried < set.num_closed, "{set:?}");
        assert!(set.grasps.len() >= 2 && set.grasps.is_sorted_by_key(|grasp| grasp.cluster));
        assert!(counts.is_sorted_by_key(|counts| counts.fraction), "{counts:?}");
        assert!(counts.iter().all(|counts| (0.0..=1.0).contains(&counts.fraction)));
    }

    #[test]
    fn search_without_success_ends_at_its_limit() {
        let config = SearchConfig { max_tested: 30, ..config() };
        let (set, _) = run(config.clone(), &|_, _| false);
        assert!(set.grasps.is_empty() && set.num_robust == 0, "{set:?}");
        assert_eq!(set.num_tried, 30);
        // Repeats are as necessary as the first trial.
        for extension in [1, 3] {
            let config = SearchConfig { extension, ..config.clone() };
            let (set, _) = run(config, &|_, trial| trial == Trial::Screening);
            assert_eq!((set.num_lifted, set.num_robust), (extension * 30, 0), "{set:?}");
        }
    }

    #[test]
    fn grasp_that_fails_the_full_lift_is_replaced() {
        let is_bad = |id: usize| (id / CANDIDATES_PER_TASK).is_multiple_of(2);
        let (set, _) = run(config(), &|id, trial| trial != Trial::Lift || !is_bad(id));
        assert!(!set.grasps.is_empty());
        assert!(set.grasps.iter().all(|grasp| !is_bad(id(grasp))), "{set:?}");
    }
}
