//! Grasp search: many candidates; the best ones are tried in physics, perturbed, and clustered if robust.

use crate::plan::object_poses::{PlannedGrasp, coverage_poses, reachability};
use crate::search::SearchConfig;
use crate::search::candidates::{self, CandidateConfig, SearchTarget, evaluate_candidate};
use crate::search::contact_forces::Squeeze;
use crate::search::parallel;
use crate::search::trial::{TrialOutcome, TrialProtocol};
use crate::set::clusters::{self, ScoredGrasp, half_turn};
use crate::set::grasp::Grasp;
use crate::set::import::ImportedGrasp;
use crate::set::k_medoids;
use crate::{GraspSet, PlacedObject, RobotContext};
use objects::object::Object;
use progress::Progress;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::Isometry;
use scene::SceneError;

/// Stage of a search in its progress reports.
pub const STAGE: &str = "grasps";

/// Converts completed fractions (0..1) to reports in percent.
fn report_fraction(progress: &dyn Progress) -> impl Fn(f32) {
    |fraction| progress.update(STAGE, (100.0 * fraction) as usize, 100)
}

/// State of a running search.
pub(crate) struct Search<'a> {
    pub(crate) robot: &'a RobotContext,
    pub(crate) object: &'a Object,
    at_origin: PlacedObject<'a>,
    target: SearchTarget<'a>,
    pub(crate) config: &'a SearchConfig,
    /// Displacements of the object in the repeats, the same for every grasp: x, y (m), yaw (rad).
    perturbations: Vec<[f32; 3]>,
    seed: u64,
    pub(crate) num_candidates: usize,
    pub(crate) num_closed: usize,
    pub(crate) num_tried: usize,
}

/// Searches for grasps of `object`; also returns all robust grasps. `progress` receives percentages of the stage
/// [`STAGE`].
pub fn search(
    robot: &RobotContext,
    object: &Object,
    config: &SearchConfig,
    seed: u64,
    progress: &dyn Progress,
) -> Result<(GraspSet, Vec<ScoredGrasp>), SceneError> {
    let progress = report_fraction(progress);
    let mut search = Search::new(robot, object, config, seed);
    let mut scored = search.search_globally(&mut |fraction| progress(0.5 * fraction))?;
    for (round, is_turned) in [false, true].into_iter().enumerate() {
        let progress = &mut |fraction| progress(0.5 + 0.2 * (round as f32 + fraction));
        scored.extend(search.refine_best(&scored, is_turned, progress)?);
    }
    Ok(search.finish(scored))
}

/// Searches for robust grasps around a palm pose (object frame), as [`search`] does around its best grasps.
pub fn refine_around(
    robot: &RobotContext,
    object: &Object,
    config: &SearchConfig,
    palm: Isometry,
    seed: u64,
) -> Result<Vec<ScoredGrasp>, SceneError> {
    let mut search = Search::new(robot, object, config, seed);
    let scored = search.refine_seeds(&[palm], &mut |_| ())?;
    Ok(scored
        .into_iter()
        .filter(|found| found.repeat_successes >= config.min_repeat_successes)
        .collect())
}

/// Tries imported grasps as [`search`] tries its own candidates.
pub fn try_imported(
    robot: &RobotContext,
    object: &Object,
    config: &SearchConfig,
    imported: &[ImportedGrasp],
    seed: u64,
    progress: &dyn Progress,
) -> Result<(GraspSet, Vec<ScoredGrasp>), SceneError> {
    let progress = report_fraction(progress);
    let mut search = Search::new(robot, object, config, seed);
    let rows: Vec<(usize, &ImportedGrasp)> = imported.iter().enumerate().collect();
    let closed = parallel::map(&rows, |(i, row)| {
        let proposal = row.candidate_config(&config.candidate);
        search.close_at(row.object_from_palm, &proposal, &mut search.candidate_rng(*i))
    });
    let closed: Vec<Grasp> = closed.into_iter().flatten().map(|(grasp, _)| grasp).collect();
    (search.num_candidates, search.num_closed) = (imported.len(), closed.len());
    let mut scored = Vec::new();
    for (i, batch) in closed.chunks(TRIAL_BATCH).enumerate() {
        progress(0.9 * (i * TRIAL_BATCH) as f32 / closed.len() as f32);
        scored.extend(search.score_grasps(batch)?);
    }
    Ok(search.finish(scored))
}

impl<'a> Search<'a> {
    pub(crate) fn new(
        robot: &'a RobotContext,
        object: &'a Object,
        config: &'a SearchConfig,
        seed: u64,
    ) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |reach: f32| rng.random_range(-reach..=reach);
        let [shift, turn] = [config.object_shift, config.object_turn];
        let perturbations =
            (0..config.num_repeats).map(|_| [draw(shift), draw(shift), draw(turn)]).collect();
        Self {
            robot,
            object,
            at_origin: PlacedObject::at_origin(robot, object),
            target: SearchTarget::new(object, &robot.config),
            config,
            perturbations,
            seed,
            num_candidates: 0,
            num_closed: 0,
            num_tried: 0,
        }
    }

    /// Filters the robust grasps and clusters them.
    fn finish(&self, scored: Vec<ScoredGrasp>) -> (GraspSet, Vec<ScoredGrasp>) {
        let num_lifted = scored.len();
        let min = self.config.min_repeat_successes;
        let robust: Vec<_> =
            scored.into_iter().filter(|found| found.repeat_successes >= min).collect();
        let grasps = self.clusters(&robust);
        let set = GraspSet {
            grasps,
            num_candidates: self.num_candidates,
            num_closed: self.num_closed,
            num_tried: self.num_tried,
            num_lifted,
            num_robust: robust.len(),
        };
        (set, robust)
    }

    /// Samples palm poses all around the object and tries those with the strongest squeezes. Returns the
    /// grasps that lift, scored in repeats.
    fn search_globally(
        &mut self,
        progress: &mut dyn FnMut(f32),
    ) -> Result<Vec<ScoredGrasp>, SceneError> {
        let config = self.config;
        let mut found = Vec::new();
        while self.num_candidates < config.max_candidates && found.len() < config.max_closed {
            let object = self.object;
            let sample = |rng: &mut _| candidates::sample_palm(object, &config.candidate, rng);
            let closed = self.close_batch(sample);
            found.extend(closed);
            let fraction = found.len() as f32 / config.max_closed as f32;
            let fraction = fraction.max(self.num_candidates as f32 / config.max_candidates as f32);
            progress(0.5 * fraction.min(1.0));
        }
        // At similar force margins, the grasp that covers more poses comes first.
        let worth = parallel::map(&found, |(grasp, squeeze)| {
            squeeze.force_margin.min(SUFFICIENT_FORCE_MARGIN) * self.coverage(grasp) as f64
        });
        let mut order: Vec<usize> = (0..found.len()).collect();
        order.sort_by(|&a, &b| worth[b].total_cmp(&worth[a]));
        let grasps: Vec<Grasp> = order.into_iter().map(|i| found[i].0.clone()).collect();
        let mut scored: Vec<ScoredGrasp> = Vec::new();
        for (i, batch) in grasps.chunks(TRIAL_BATCH).enumerate() {
            progress(0.5 + 0.5 * (i * TRIAL_BATCH) as f32 / grasps.len() as f32);
            scored.extend(self.score_grasps(batch)?);
            let robust =
                scored.iter().filter(|found| found.repeat_successes >= config.min_repeat_successes);
            if robust.count() >= config.target_robust {
                break;
            }
        }
        Ok(scored)
    }

    /// Searches around the palm poses of the best grasps, or around their half turns.
    fn refine_best(
        &mut self,
        scored: &[ScoredGrasp],
        is_turned: bool,
        progress: &mut dyn FnMut(f32),
    ) -> Result<Vec<ScoredGrasp>, SceneError> {
        let config = self.config;
        let mut best: Vec<&ScoredGrasp> = scored.iter().collect();
        best.sort_by_cached_key(|found| {
            std::cmp::Reverse(found.score() * self.coverage(&found.grasp))
        });
        best.truncate(3 * config.num_refine_seeds);
        let poses: Vec<_> = best.iter().map(|found| found.grasp.object_from_palm).collect();
        let mut seeds: Vec<Isometry> =
            k_medoids::k_medoids(poses.len(), config.num_refine_seeds, |a, b| {
                k_medoids::palm_distance(&poses[a], &poses[b])
            })
            .into_iter()
            .map(|i| poses[i])
            .collect();
        if is_turned {
            let hand = &self.robot.tree.hand;
            seeds.iter_mut().for_each(|pose| *pose = half_turn(hand, self.object, pose));
        }
        self.refine_seeds(&seeds, progress)
    }

    /// Perturbs each of these palm poses. Returns the grasps that lift, scored in repeats.
    fn refine_seeds(
        &mut self,
        seeds: &[Isometry],
        progress: &mut dyn FnMut(f32),
    ) -> Result<Vec<ScoredGrasp>, SceneError> {
        let config = self.config;
        let mut scored = Vec::new();
        for (i, seed) in seeds.iter().enumerate() {
            progress(i as f32 / seeds.len() as f32);
            let (mut lifted, mut num_tries) = (Vec::new(), 0);
            while num_tries < config.max_perturbations && lifted.len() < config.target_per_seed {
                let (shift, turn) = (config.palm_shift, config.palm_turn);
                let sample = |rng: &mut _| candidates::perturb_palm(seed, shift, turn, rng);
                let closed = self.close_batch(sample);
                num_tries += CLOSING_BATCH;
                let grasps: Vec<Grasp> = closed.into_iter().map(|(grasp, _)| grasp).collect();
                for batch in grasps.chunks(TRIAL_BATCH) {
                    if lifted.len() < config.target_per_seed {
                        lifted.extend(self.score_grasps(batch)?);
                    }
                }
            }
            scored.extend(lifted);
        }
        Ok(scored)
    }

    /// Coverage of a grasp: the number of poses, of every fifth coverage pose, at which it is reachable.
    fn coverage(&self, grasp: &Grasp) -> usize {
        let few: Vec<_> = coverage_poses(self.robot).into_iter().step_by(5).collect();
        reachability(&self.at_origin, &few, grasp)
            .into_iter()
            .filter(|is_within| *is_within)
            .count()
    }

    /// Random generator of a candidate. Candidates are independent, so no result depends on the number of
    /// threads.
    pub(crate) fn candidate_rng(&self, index: usize) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        // Stream 0 has sampled the perturbations of the repeats.
        rng.set_stream(1 + index as u64);
        rng
    }

    /// Closes the hand at the palm poses of the next candidates, which `sample_palm` samples. Returns the
    /// candidates that are not rejected, in order.
    fn close_batch(
        &mut self,
        sample_palm: impl Fn(&mut ChaCha8Rng) -> Isometry + Send + Sync,
    ) -> Vec<(Grasp, Squeeze)> {
        let indices: Vec<usize> = (self.num_candidates..).take(CLOSING_BATCH).collect();
        let closed = parallel::map(&indices, |&index| {
            let mut rng = self.candidate_rng(index);
            let palm = sample_palm(&mut rng);
            self.close_at(palm, &self.config.candidate, &mut rng)
        });
        let closed: Vec<_> = closed.into_iter().flatten().collect();
        self.num_candidates += CLOSING_BATCH;
        self.num_closed += closed.len();
        closed
    }

    /// Closes the hand at a palm pose; `None` if the candidate is rejected.
    pub(crate) fn close_at(
        &self,
        palm: Isometry,
        config: &CandidateConfig,
        rng: &mut ChaCha8Rng,
    ) -> Option<(Grasp, Squeeze)> {
        evaluate_candidate(self.robot, &self.target, config, palm, rng).ok()
    }

    /// Tries each grasp at the object yaw that is easiest to reach. Returns the scores of those that lift, in
    /// order.
    pub(crate) fn score_grasps(
        &mut self,
        grasps: &[Grasp],
    ) -> Result<Vec<ScoredGrasp>, SceneError> {
        let results = parallel::map(grasps, |grasp| {
            let planned = PlannedGrasp::plan_at_easiest_yaw(&self.at_origin, grasp)?;
            planned.map(|planned| self.score_grasp(grasp, &planned)).transpose()
        });
        let mut scored = Vec::new();
        for result in results {
            if let Some(tried) = result? {
                self.num_tried += 1;
                scored.extend(tried);
            }
        }
        Ok(scored)
    }

    /// Tries a grasp, then in perturbed repeats and under shaking. `None` if the first trial fails; the repeats
    /// stop when too many have failed.
    fn score_grasp(
        &self,
        grasp: &Grasp,
        planned: &PlannedGrasp,
    ) -> Result<Option<ScoredGrasp>, SceneError> {
        let mut found = ScoredGrasp { grasp: grasp.clone(), repeat_successes: 0, shake_slip: None };
        let unperturbed = [0.0; 3];
        if !self.lifts(planned, unperturbed, TrialProtocol::SHORT)? {
            return Ok(None);
        }
        let config = self.config;
        let mut num_failed = 0;
        for perturbation in &self.perturbations {
            let lifts = self.lifts(planned, *perturbation, TrialProtocol::SHORT)?;
            num_failed += usize::from(!lifts);
            if num_failed + config.min_repeat_successes > config.num_repeats {
                return Ok(Some(found));
            }
        }
        found.repeat_successes = config.num_repeats - num_failed;
        let outcome = planned.try_perturbed(unperturbed, SHAKE_TRIAL)?;
        if let TrialOutcome::Lifted { slip } = outcome {
            found.shake_slip = Some(slip);
        }
        Ok(Some(found))
    }

    /// Clusters the robust grasps.
    fn clusters(&self, robust: &[ScoredGrasp]) -> Vec<Grasp> {
        let poses = coverage_poses(self.robot);
        let reach_of = |found: &ScoredGrasp| reachability(&self.at_origin, &poses, &found.grasp);
        let reach = parallel::map(robust, reach_of);
        let (hand, count) = (&self.robot.tree.hand, self.config.num_clusters);
        clusters::cluster_grasps(hand, self.object, robust, &reach, count)
    }

    fn lifts(
        &self,
        planned: &PlannedGrasp,
        perturbation: [f32; 3],
        protocol: TrialProtocol,
    ) -> Result<bool, SceneError> {
        let outcome = planned.try_perturbed(perturbation, protocol)?;
        Ok(matches!(outcome, TrialOutcome::Lifted { slip } if slip <= self.config.max_slip))
    }
}

/// A short hold, then shaking.
const SHAKE_TRIAL: TrialProtocol = TrialProtocol { is_shaken: true, ..TrialProtocol::SHORT };

/// Number of candidates that are closed, and of grasps that are tried, before the search decides how to
/// continue. A larger batch occupies more threads and wastes more work.
const CLOSING_BATCH: usize = 16;
const TRIAL_BATCH: usize = 4;

/// Force margin above which stronger squeezes rank equal.
const SUFFICIENT_FORCE_MARGIN: f64 = 2.0;
