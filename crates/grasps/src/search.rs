//! Search: many proposals, the strongest ones tried in physics and varied, the reliable ones clustered.

use crate::grasp::Grasp;
use crate::import::Imported;
use crate::kind::{self, Scored, half_turn};
use crate::place::{Planned, reach, reach_poses};
use crate::proposal::{self, ProposalConfig, Subject, propose};
use crate::squeeze::Squeeze;
use crate::trial::{Endurance, Physics, TrialOutcome};
use crate::{GraspSet, Robot, Setting, cluster};
use geometry::object::Object;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::Isometry;
use scene::SceneError;

/// How long is searched and what counts as reliable.
#[derive(Clone, Debug)]
pub struct SearchConfig {
    /// Palm poses proposed at most.
    pub proposals: usize,
    /// Proposals with balanced forces that are enough.
    pub closings: usize,
    /// Reliable grasps among the strongest of these that are enough.
    pub enough: usize,
    /// Medoids of the most reliable grasps, around which and then around whose half turns is searched
    /// again.
    pub centers: usize,
    /// Palm poses proposed around each of these at most.
    pub variants: usize,
    /// Lifting grasps around one of these that are enough.
    pub enough_variants: usize,
    /// How far such palm poses lie from it along each axis (m).
    pub palm_shift: f64,
    /// How far they are turned about each axis (rad).
    pub palm_turn: f64,
    /// Perturbed repeats of a trial that lifted.
    pub repeats: usize,
    /// Of these, how many must lift again.
    pub least_lifted: usize,
    /// Greatest shift of the object in a repeat along x and y (m).
    pub object_shift: f32,
    /// Greatest turn of the object in a repeat (rad).
    pub object_turn: f32,
    /// Greatest slip of the object in the palm (m) in a trial that counts as lifted.
    pub slip: f32,
    /// Kinds of grasps that remain after clustering (paper §II-A: N = 7).
    pub kinds: usize,
    /// What is proposed.
    pub proposal: ProposalConfig,
}

impl SearchConfig {
    /// The paper's N; the other figures are ours. Repeats are perturbed by about what a policy that sees
    /// one cloud is off.
    pub fn paper(robot: &Robot) -> Self {
        Self {
            proposals: 60_000,
            closings: 250,
            enough: 20,
            centers: 6,
            variants: 1500,
            enough_variants: 5,
            palm_shift: 0.008,
            palm_turn: 0.1,
            repeats: 10,
            least_lifted: 7,
            object_shift: 0.015,
            object_turn: 0.2,
            slip: 0.025,
            kinds: 7,
            proposal: ProposalConfig::standard(&robot.config),
        }
    }

    /// Three times as many closings, reliable grasps and centres: for what is heavy, and has to be chosen well.
    pub fn thorough(robot: &Robot) -> Self {
        Self { closings: 800, enough: 60, centers: 18, ..Self::paper(robot) }
    }

    /// A few reliable grasps of one kind or two, soon: for whoever waits.
    pub fn quick(robot: &Robot) -> Self {
        Self {
            proposals: 12_000,
            closings: 60,
            enough: 4,
            centers: 1,
            variants: 200,
            enough_variants: 2,
            repeats: 4,
            least_lifted: 3,
            kinds: 3,
            ..Self::paper(robot)
        }
    }

    /// For [`search_around`]: more of each, from fewer proposals.
    pub fn around(robot: &Robot) -> Self {
        Self { variants: 800, enough_variants: 8, ..Self::paper(robot) }
    }
}

/// A search under way.
pub(crate) struct Search<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) object: &'a Object,
    anywhere: Setting<'a>,
    subject: Subject<'a>,
    pub(crate) config: &'a SearchConfig,
    /// Where the object stands in the repeats, the same for every grasp: x, y (m), yaw (rad).
    beside: Vec<[f32; 3]>,
    pub(crate) rng: ChaCha8Rng,
    pub(crate) proposed: usize,
    pub(crate) closed: usize,
    pub(crate) tried: usize,
}

/// Searches grasps of `object`, and gives all that are reliable too; `progress` gets the share done.
pub fn search(
    robot: &Robot,
    object: &Object,
    config: &SearchConfig,
    seed: u64,
    mut progress: impl FnMut(f32),
) -> Result<(GraspSet, Vec<Scored>), SceneError> {
    let mut search = Search::begin(robot, object, config, seed);
    let mut scored = search.around_the_object(&mut |share| progress(0.5 * share))?;
    for (round, is_turned) in [false, true].into_iter().enumerate() {
        let progress = &mut |share| progress(0.5 + 0.2 * (round as f32 + share));
        scored.extend(search.around(&scored, is_turned, progress)?);
    }
    search.end(scored, &mut |share| progress(0.9 + 0.1 * share))
}

/// Searches reliable grasps around a palm pose in the object's frame, as [`search`] does around the best that it finds.
pub fn search_around(
    robot: &Robot,
    object: &Object,
    config: &SearchConfig,
    palm: Isometry,
    seed: u64,
) -> Result<Vec<Scored>, SceneError> {
    let mut search = Search::begin(robot, object, config, seed);
    let scored = search.around_each(&[palm], &mut |_| ())?;
    Ok(scored.into_iter().filter(|found| found.again >= config.least_lifted).collect())
}

/// Tries grasps that come from elsewhere, as [`search`] tries its own.
pub fn try_imported(
    robot: &Robot,
    object: &Object,
    config: &SearchConfig,
    imported: &[Imported],
    seed: u64,
    mut progress: impl FnMut(f32),
) -> Result<(GraspSet, Vec<Scored>), SceneError> {
    let mut search = Search::begin(robot, object, config, seed);
    let mut scored = Vec::new();
    for (i, row) in imported.iter().enumerate() {
        progress(0.9 * i as f32 / imported.len() as f32);
        search.proposed += 1;
        let proposal = row.config(&config.proposal);
        if let Some((grasp, _)) = search.close(row.object_from_palm, &proposal) {
            scored.extend(search.scored(&grasp)?);
        }
    }
    search.end(scored, &mut |share| progress(0.9 + 0.1 * share))
}

impl<'a> Search<'a> {
    pub(crate) fn begin(
        robot: &'a Robot,
        object: &'a Object,
        config: &'a SearchConfig,
        seed: u64,
    ) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |reach: f32| rng.random_range(-reach..=reach);
        let [shift, turn] = [config.object_shift, config.object_turn];
        let beside = (0..config.repeats).map(|_| [draw(shift), draw(shift), draw(turn)]).collect();
        let subject = Subject::new(object, &robot.config);
        let (proposed, closed, tried) = (0, 0, 0);
        let anywhere = Setting::anywhere(robot, object);
        Self { robot, object, anywhere, subject, config, beside, rng, proposed, closed, tried }
    }

    /// Reliable grasps as a set of kinds.
    fn end(
        &self,
        scored: Vec<Scored>,
        progress: &mut dyn FnMut(f32),
    ) -> Result<(GraspSet, Vec<Scored>), SceneError> {
        let lifted = scored.len();
        let least = self.config.least_lifted;
        let reliable: Vec<_> = scored.into_iter().filter(|found| found.again >= least).collect();
        let (grasps, confirmed) = self.confirmed_kinds(&reliable, progress)?;
        let set = GraspSet {
            grasps,
            proposed: self.proposed,
            closed: self.closed,
            tried: self.tried,
            lifted,
            reliable: reliable.len(),
            confirmed,
        };
        Ok((set, reliable))
    }

    /// Palm poses all around the object, and of those that close the strongest: each that lifts, with
    /// its repeats that lifted.
    fn around_the_object(
        &mut self,
        progress: &mut dyn FnMut(f32),
    ) -> Result<Vec<Scored>, SceneError> {
        let config = self.config;
        let mut found = Vec::new();
        while self.proposed < config.proposals && found.len() < config.closings {
            let palm = proposal::draw_palm(self.object, &config.proposal, &mut self.rng);
            found.extend(self.close(palm, &config.proposal));
            self.proposed += 1;
            if self.proposed.is_multiple_of(256) {
                let share = found.len() as f32 / config.closings as f32;
                progress(0.5 * share.max(self.proposed as f32 / config.proposals as f32));
            }
        }
        // What serves more poses comes first, if it is about as strong.
        let worth = |(grasp, squeeze): (Grasp, Squeeze)| {
            (squeeze.reserve.min(ENOUGH_RESERVE) * self.served(&grasp) as f64, grasp)
        };
        let mut found: Vec<_> = found.into_iter().map(worth).collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut scored = Vec::new();
        for (i, (_, grasp)) in found.iter().enumerate() {
            progress(0.5 + 0.5 * i as f32 / found.len() as f32);
            scored.extend(self.scored(grasp)?);
            let reliable = scored.iter().filter(|found| found.again >= config.least_lifted);
            if reliable.count() == config.enough {
                break;
            }
        }
        Ok(scored)
    }

    /// The same around the best of these, or around their half turns.
    fn around(
        &mut self,
        scored: &[Scored],
        is_turned: bool,
        progress: &mut dyn FnMut(f32),
    ) -> Result<Vec<Scored>, SceneError> {
        let config = self.config;
        let mut best: Vec<&Scored> = scored.iter().collect();
        best.sort_by_cached_key(|found| {
            std::cmp::Reverse(found.worth() * self.served(&found.grasp))
        });
        best.truncate(3 * config.centers);
        let poses: Vec<_> = best.iter().map(|found| found.grasp.object_from_palm).collect();
        let mut centers: Vec<Isometry> = cluster::medoids(poses.len(), config.centers, |a, b| {
            cluster::distance(&poses[a], &poses[b])
        })
        .into_iter()
        .map(|i| poses[i])
        .collect();
        if is_turned {
            centers.iter_mut().for_each(|pose| *pose = half_turn(self.object, pose));
        }
        self.around_each(&centers, progress)
    }

    /// Palm poses around each of these: each that lifts, with its repeats that lifted.
    fn around_each(
        &mut self,
        centers: &[Isometry],
        progress: &mut dyn FnMut(f32),
    ) -> Result<Vec<Scored>, SceneError> {
        let config = self.config;
        let mut scored = Vec::new();
        for (i, center) in centers.iter().enumerate() {
            progress(i as f32 / centers.len() as f32);
            let before = scored.len();
            for _ in 0..config.variants {
                let (shift, turn) = (config.palm_shift, config.palm_turn);
                let palm = proposal::vary_palm(center, shift, turn, &mut self.rng);
                if let Some((grasp, _)) = self.close(palm, &config.proposal) {
                    scored.extend(self.scored(&grasp)?);
                }
                if scored.len() == before + config.enough_variants {
                    break;
                }
            }
        }
        Ok(scored)
    }

    /// Object poses, of a fifth of those at which reach is counted, at which a grasp is within reach.
    fn served(&self, grasp: &Grasp) -> usize {
        let few: Vec<_> = reach_poses(self.robot).into_iter().step_by(5).collect();
        reach(&self.anywhere, &few, grasp).into_iter().filter(|is_within| *is_within).count()
    }

    /// The grasp that closing at a palm pose gives.
    pub(crate) fn close(
        &mut self,
        palm: Isometry,
        config: &ProposalConfig,
    ) -> Option<(Grasp, Squeeze)> {
        let found = propose(self.robot, &self.subject, config, palm, &mut self.rng).ok();
        self.closed += usize::from(found.is_some());
        found
    }

    /// The grasp, if it lifts where it is easiest to reach, how many of the perturbed repeats lifted too, and
    /// how it bears shaking; this ends where too many are lost.
    pub(crate) fn scored(&mut self, grasp: &Grasp) -> Result<Option<Scored>, SceneError> {
        let planned = Planned::easiest(&self.anywhere, grasp)?;
        let Some(planned) = planned else { return Ok(None) };
        self.tried += 1;
        let mut found = Scored { grasp: grasp.clone(), again: 0, shaken: None };
        let still = [0.0; 3];
        if !self.lifts(Physics::Hand, &planned, still, Endurance::BRIEF)? {
            return Ok(None);
        }
        let config = self.config;
        let mut lost = 0;
        for beside in &self.beside {
            let lifts = self.lifts(Physics::Hand, &planned, *beside, Endurance::BRIEF)?;
            lost += usize::from(!lifts);
            if lost + config.least_lifted > config.repeats {
                return Ok(Some(found));
            }
        }
        found.again = config.repeats - lost;
        if let TrialOutcome::Lifted { slip } = planned.try_beside(Physics::Hand, still, SHAKEN)? {
            found.shaken = Some(slip);
        }
        Ok(Some(found))
    }

    /// The kinds of the reliable grasps, each of which arm and hand lift too, and how many have been tried so:
    /// those that are not lifted are left out, and the kinds chosen anew.
    fn confirmed_kinds(
        &self,
        reliable: &[Scored],
        progress: &mut dyn FnMut(f32),
    ) -> Result<(Vec<Grasp>, [usize; 2]), SceneError> {
        let mut left = reliable.to_vec();
        let poses = reach_poses(self.robot);
        let of = |found: &Scored| reach(&self.anywhere, &poses, &found.grasp);
        let mut reach: Vec<_> = left.iter().map(of).collect();
        let (mut sound, mut tried) = (Vec::new(), 0);
        loop {
            let chosen = kind::kinds(self.object, &left, &reach, self.config.kinds);
            let place = |grasp: &Grasp| (grasp.object_from_palm, grasp.touch, grasp.squeeze);
            let new = chosen.iter().find(|grasp| !sound.contains(&place(grasp)));
            let Some(new) = new else { return Ok((chosen, [tried, sound.len()])) };
            progress(sound.len() as f32 / chosen.len() as f32);
            tried += 1;
            if self.is_confirmed(new)? {
                sound.push(place(new));
            } else if let Some(i) = left.iter().position(|found| place(&found.grasp) == place(new))
            {
                left.remove(i);
                reach.remove(i);
            }
        }
    }

    pub(crate) fn is_confirmed(&self, grasp: &Grasp) -> Result<bool, SceneError> {
        match Planned::easiest(&self.anywhere, grasp)? {
            Some(planned) => self.lifts(Physics::Full, &planned, [0.0; 3], Endurance::BRIEF),
            None => Ok(false),
        }
    }

    fn lifts(
        &self,
        physics: Physics,
        planned: &Planned,
        beside: [f32; 3],
        endurance: Endurance,
    ) -> Result<bool, SceneError> {
        let outcome = planned.try_beside(physics, beside, endurance)?;
        Ok(matches!(outcome, TrialOutcome::Lifted { slip } if slip <= self.config.slip))
    }
}

/// A short hold, then shaken.
const SHAKEN: Endurance = Endurance { is_shaken: true, ..Endurance::BRIEF };

/// A squeeze with so many times the needed forces is strong enough.
const ENOUGH_RESERVE: f64 = 2.0;
