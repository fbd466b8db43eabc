//! The closed candidates of a search: which ones are robust, what they cover, and which ones to test next.

use crate::search::SearchConfig;
use crate::search::tested_candidate::TestedCandidate;
use crate::set::k_medoids::palm_distance;

/// Closed candidates, judged by the criteria of a configuration.
pub(super) struct CandidatePool {
    pub(super) config: SearchConfig,
    pub(super) candidates: Vec<TestedCandidate>,
}

/// Distance (m, by [`palm_distance`]) from a failed candidate within which other candidates have half of their
/// value.
const FAILURE_RADIUS: f64 = 0.05;

/// Number of tested candidates near the half turn of a robust grasp.
const COUNTERPART_TESTS: usize = 3;

impl CandidatePool {
    pub(super) fn new(config: SearchConfig) -> Self {
        Self { config, candidates: Vec::new() }
    }

    /// Number of tested candidates, without those of half turns.
    pub(super) fn num_tested(&self) -> usize {
        let is_tested = |one: &&TestedCandidate| !one.is_new() && one.counterpart_of.is_none();
        self.candidates.iter().filter(is_tested).count()
    }

    /// Candidates that have lifted in enough repeats.
    pub(super) fn robust(&self) -> impl Iterator<Item = (usize, &TestedCandidate)> {
        self.candidates.iter().enumerate().filter(|(_, candidate)| {
            self.is_promising(candidate)
                && candidate.is_approachable == Some(true)
                && candidate.num_repeats() >= self.config.num_screening_repeats
        })
    }

    /// Whether a candidate has lifted and has not failed too often since.
    pub(super) fn is_promising(&self, candidate: &TestedCandidate) -> bool {
        let SearchConfig { num_repeats, min_repeat_successes, .. } = self.config;
        // No larger share of the repeats so far has failed than may fail of all.
        let has_few_failures = candidate.num_failed_repeats() * num_repeats
            <= (num_repeats - min_repeat_successes) * candidate.num_repeats();
        candidate.has_lifted() && has_few_failures && candidate.is_approachable != Some(false)
    }

    /// Whether each sparse coverage pose is reachable with a robust grasp.
    pub(super) fn covered(&self) -> Vec<bool> {
        let count = self.candidates.first().map_or(0, |one| one.sparse_reach.len());
        let mut covered = vec![false; count];
        self.robust().for_each(|(_, candidate)| cover(&mut covered, candidate));
        covered
    }

    /// Number of sparse coverage poses that robust grasps cover, and that any closed candidate covers.
    pub(super) fn coverage(&self) -> [usize; 2] {
        let covered = self.covered();
        let mut coverable = covered.clone();
        self.candidates.iter().for_each(|candidate| cover(&mut coverable, candidate));
        [covered, coverable].map(|poses| poses.into_iter().filter(|pose| *pose).count())
    }

    /// The new candidates that may add most object poses, each beyond those before it.
    pub(super) fn most_valuable(&self, count: usize) -> Vec<usize> {
        let mut covered = self.covered();
        let in_progress = |candidate: &&TestedCandidate| self.is_promising(candidate);
        self.candidates.iter().filter(in_progress).for_each(|one| cover(&mut covered, one));
        let has_failed = |one: &&TestedCandidate| !one.is_new() && !self.is_promising(one);
        let failed: Vec<&TestedCandidate> = self.candidates.iter().filter(has_failed).collect();
        let is_close = |one: &TestedCandidate, other: &TestedCandidate| {
            let [a, b] = [one, other].map(|candidate| &candidate.grasp.object_from_palm);
            palm_distance(a, b) < FAILURE_RADIUS
        };
        let chance = |one: &TestedCandidate| {
            1.0 / (1 + failed.iter().filter(|other| is_close(one, other)).count()) as f64
        };
        let new = self.candidates.iter().enumerate();
        let new = new.filter(|(_, one)| one.is_new() && one.counterpart_of.is_none());
        let mut new: Vec<(usize, f64)> = new.map(|(index, one)| (index, chance(one))).collect();
        let mut chosen = Vec::new();
        while chosen.len() < count {
            if !self.config.needs_coverage() {
                covered.fill(false);
            }
            let value =
                |(index, chance): &(usize, f64)| chance * self.candidates[*index].value(&covered);
            // Ties select the first.
            let best = new.iter().rev().max_by(|a, b| value(a).total_cmp(&value(b)));
            let Some(&best) = best.filter(|best| value(best) > 0.0) else { break };
            new.retain(|one| one.0 != best.0);
            cover(&mut covered, &self.candidates[best.0]);
            chosen.push(best.0);
        }
        chosen
    }

    /// For each half turn without a grasp that lifts, the next candidate to test.
    pub(super) fn counterparts_to_test(&self, turned: &[usize]) -> Vec<usize> {
        let next = |turned: &usize| {
            let is_of = |(_, one): &(usize, &TestedCandidate)| one.counterpart_of == Some(*turned);
            let all = || self.candidates.iter().enumerate().filter(is_of);
            let num_tested = all().filter(|(_, one)| !one.is_new()).count();
            let is_running = |one: &TestedCandidate| {
                self.is_promising(one) || (one.is_untried() && one.is_approachable == Some(true))
            };
            if all().any(|(_, one)| is_running(one)) || num_tested >= COUNTERPART_TESTS {
                return None;
            }
            let all_poses = vec![false; self.covered().len()];
            let value = |one: &TestedCandidate| one.value(&all_poses);
            let new = all().filter(|(_, one)| one.is_new() && value(one) > 0.0);
            new.max_by(|a, b| value(a.1).total_cmp(&value(b.1))).map(|(index, _)| index)
        };
        turned.iter().filter_map(next).collect()
    }
}

/// Adds the poses in reach of a candidate.
fn cover(covered: &mut [bool], candidate: &TestedCandidate) {
    for (covered, reaches) in covered.iter_mut().zip(&candidate.sparse_reach) {
        *covered |= reaches;
    }
}
