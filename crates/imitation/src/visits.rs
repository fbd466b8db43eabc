//! The states that a policy visits while it learns: drawn beside the demonstrations or where an attempt begins, rolled
//! out by the policy itself, and drawn anew in the end.

use crate::dagger::DaggerConfig;
use crate::lesson::Lesson;
use anyhow::{Result, ensure};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use robot::{ARM, DOF, JointState, JointVector, Limits};

/// Distance (rad, norm) from the nearest demonstration at which a roll-out is given up.
const STRAYED: f64 = 0.6;

/// A state under way.
#[derive(Clone, Copy)]
pub(crate) struct Visit {
    pub(crate) lesson: usize,
    pub(crate) encoding: usize,
    pub(crate) state: JointState,
    pub(crate) left: usize,
}

/// Draws states of the lessons that there is something to learn from.
pub(crate) struct Sampler<'a> {
    lessons: &'a [Lesson],
    full: Vec<usize>,
    limits: &'a Limits,
}

impl<'a> Sampler<'a> {
    pub(crate) fn new(lessons: &'a [Lesson], limits: &'a Limits) -> Self {
        let full = (0..lessons.len()).filter(|&i| lessons[i].is_full()).collect();
        Self { lessons, full, limits }
    }

    /// States of several batches, to begin with. Each has another part of its roll-out before it.
    pub(crate) fn rounds(&self, config: &DaggerConfig, rng: &mut ChaCha8Rng) -> Vec<Vec<Visit>> {
        let mut draw = |_| {
            let visit = self.draw(config, config.grown(0), rng);
            Visit { left: rng.random_range(1..=visit.left), ..visit }
        };
        let mut batch = |_| (0..config.batch).map(&mut draw).collect();
        (0..config.rounds.max(1)).map(&mut batch).collect()
    }

    /// A start of a neighbour or a noisy state of a random demonstration; `grown` is the share of
    /// their full length that roll-outs have by now.
    pub(crate) fn draw(&self, config: &DaggerConfig, grown: f64, rng: &mut ChaCha8Rng) -> Visit {
        let lesson = self.full[rng.random_range(0..self.full.len())];
        let encoding = rng.random_range(0..self.lessons[lesson].encodings.len());
        if rng.random::<f64>() < grown * config.start_share {
            let start = self.lessons[lesson].draw_start(rng);
            let q = self.lessons[lesson].encodings[encoding].at_bearing(&start);
            let (state, left) =
                (JointState::at_rest(q), length(config.start_horizon(), grown, rng));
            let visit = Visit { lesson, encoding, state, left };
            if is_near(&visit, self.lessons) {
                return visit;
            }
        }
        let demonstrations = &self.lessons[lesson].demonstrations;
        let (first, end) = demonstrations.span(rng.random_range(0..demonstrations.trajectories()));
        let mut state = demonstrations.state(rng.random_range(first..end));
        let [arm, hand, velocity] = config.noise;
        let position = |joint: usize| if joint < ARM { arm } else { hand };
        state.q += JointVector::from_fn(|i, _| rng.random_range(-position(i)..=position(i)));
        state.qd += JointVector::from_fn(|_, _| rng.random_range(-velocity..=velocity));
        let state = self.limits.stop(&state);
        Visit { lesson, encoding, state, left: length(config.horizon, grown, rng) }
    }
}

/// Steps of a roll-out that has a share `grown` of `full`, a quarter more or less: those that began together do not end
/// together, so that in each batch are states of every age.
fn length(full: usize, grown: f64, rng: &mut ChaCha8Rng) -> usize {
    let mean = 1 + (grown * (full.max(1) - 1) as f64) as usize;
    rng.random_range(mean - mean / 4..=mean + mean / 4)
}

/// Numbers of a visit in a checkpoint: lesson, encoding, steps that are left, positions, velocities.
const ROW: usize = 3 + 2 * DOF;

/// States under way as numbers.
pub(crate) fn write(rounds: &[Vec<Visit>]) -> Vec<f32> {
    let row = |visit: &Visit| {
        let indices = [visit.lesson, visit.encoding, visit.left].map(|index| index as f32);
        let state = [visit.state.q, visit.state.qd];
        let state = state
            .into_iter()
            .flat_map(|joints| joints.iter().map(|x| *x as f32).collect::<Vec<_>>());
        indices.into_iter().chain(state).collect::<Vec<_>>()
    };
    rounds.iter().flatten().flat_map(row).collect()
}

/// States under way of several batches from their numbers.
pub(crate) fn read(numbers: &[f32], batch: usize, lessons: &[Lesson]) -> Result<Vec<Vec<Visit>>> {
    let visit = |row: &[f32; ROW]| {
        let [lesson, encoding, left] = std::array::from_fn(|i| row[i] as usize);
        let left = left.max(1);
        let joints = |from: usize| JointVector::from_fn(|i, _| f64::from(row[from + i]));
        let state = JointState { q: joints(3), qd: joints(3 + DOF) };
        let is_there = lessons.get(lesson).is_some_and(|lesson| encoding < lesson.encodings.len());
        ensure!(is_there, "the checkpoint is of other lessons; delete it to begin anew");
        Ok(Visit { lesson, encoding, state, left })
    };
    let (rows, rest) = numbers.as_chunks::<ROW>();
    ensure!(
        rest.is_empty() && !rows.is_empty(),
        "the checkpoint is cut off; delete it to begin anew"
    );
    let visits = rows.iter().map(visit).collect::<Result<Vec<_>>>()?;
    Ok(visits.chunks(batch.max(1)).map(<[Visit]>::to_vec).collect())
}

/// Whether the state is still so close to its demonstrations that the expert makes sense.
pub(crate) fn is_near(visit: &Visit, lessons: &[Lesson]) -> bool {
    let demonstrations = &lessons[visit.lesson].demonstrations;
    let (nearest, _) = demonstrations.nearest(&visit.state.q);
    let distance = (visit.state.q - demonstrations.state(nearest).q).norm();
    distance.is_finite() && distance < STRAYED
}

#[cfg(test)]
pub(crate) mod samples {
    use super::*;
    use crate::expert::Demonstrations;
    use policy::{Encoding, PolicyConfig};
    use robot::DOF;

    pub(crate) fn tiny() -> DaggerConfig {
        DaggerConfig { rounds: 4, ..DaggerConfig::standard(PolicyConfig::tiny()) }
    }

    /// Pose `pose` at bearing `turn`: one demonstration, from q = 0.1 pose, and two clouds.
    pub(crate) fn lesson(pose: usize, turn: f32) -> Lesson {
        let rows: Vec<f32> = (0..3)
            .flat_map(|row| {
                let q = 0.1 * pose as f32 + 0.02 * row as f32;
                (0..2 * DOF).map(move |i| if i < DOF { q } else { 0.0 })
            })
            .collect();
        let cloud = |off: f64| Encoding {
            bearing: f64::from(turn) + off,
            z: vec![pose as f32 + off as f32; policy::LATENT],
        };
        Lesson {
            object: "box".into(),
            pose,
            demonstrations: Demonstrations::new(rows, vec![0, 3]).turned(turn),
            encodings: vec![cloud(0.01), cloud(-0.02)],
            has_starts: turn == 0.0,
            near: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::samples::{lesson, tiny};
    use super::*;
    use crate::lesson::{introduce, starts};
    use rand::SeedableRng;
    use robot::Tree;

    #[test]
    fn an_attempt_begins_at_the_start_of_another_pose_turned_to_the_bearing_that_is_seen() {
        let mut lessons: Vec<Lesson> = (0..6).map(|k| lesson(k / 2, [0.0, 0.7][k % 2])).collect();
        let among = starts(&lessons);
        introduce(&mut lessons, &among);
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        let sampler = Sampler::new(&lessons, &limits);
        let config = DaggerConfig { start_share: 1.0, ..tiny() };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..40 {
            let visit = sampler.draw(&config, 1.0, &mut rng);
            let own = &lessons[visit.lesson];
            let q = visit.state.q;
            let is_start_of = |pose: usize| (q[1] - 0.1 * pose as f64).abs() < 1e-6;
            let pose = (0..3).find(|pose| is_start_of(*pose)).unwrap();
            assert_ne!(pose, own.pose);
            // The first cloud of the other lesson was seen at bearing 0.01.
            let wanted = q[1] - 0.01 + own.encodings[visit.encoding].bearing;
            assert!((q[0] - wanted).abs() < 1e-6, "{} against {wanted}", q[0]);
            assert_eq!(visit.state.qd.norm(), 0.0);
        }
    }

    #[test]
    fn what_is_under_way_is_written_and_read_to_single_precision() {
        let lessons = [lesson(3, 0.0), lesson(1, 0.7)];
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        let config = DaggerConfig { batch: 5, rounds: 3, ..tiny() };
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let rounds = Sampler::new(&lessons, &limits).rounds(&config, &mut rng);
        let written = write(&rounds);
        let found = read(&written, 5, &lessons).unwrap();
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [5; 3]);
        for (before, after) in rounds.iter().flatten().zip(found.iter().flatten()) {
            let of = |visit: &Visit| (visit.lesson, visit.encoding, visit.left);
            assert_eq!(of(before), of(after));
            let off =
                (before.state.q - after.state.q).amax() + (before.state.qd - after.state.qd).amax();
            assert!(off < 1e-6, "{off}");
        }
        // Whoever goes on from what is written finds the same there as whoever wrote it.
        assert_eq!(write(&found), written);
        assert!(read(&written[1..], 5, &lessons).is_err(), "cut off");
        assert!(read(&written, 5, &lessons[..1]).is_err(), "of other lessons");
    }

    #[test]
    fn roll_outs_that_begin_together_end_apart() {
        let lessons = [lesson(3, 0.0)];
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        let sampler = Sampler::new(&lessons, &limits);
        let config = DaggerConfig { horizon: 40, start_share: 0.0, ..tiny() };
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let lengths: Vec<usize> =
            (0..400).map(|_| sampler.draw(&config, 1.0, &mut rng).left).collect();
        assert!(lengths.iter().all(|length| (30..=50).contains(length)));
        let mean = lengths.iter().sum::<usize>() as f64 / 400.0;
        assert!((mean - 40.0).abs() < 1.0, "{mean}");
    }

    #[test]
    fn what_begins_at_full_length_is_at_every_stage_of_it() {
        let lessons = [lesson(3, 0.0)];
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        let config =
            DaggerConfig { rounds: 64, horizon: 40, growth: [0.0; 2], start_share: 0.0, ..tiny() };
        let rounds =
            Sampler::new(&lessons, &limits).rounds(&config, &mut ChaCha8Rng::seed_from_u64(5));
        assert_eq!(rounds.len(), 64);
        let left = |batch: &Vec<Visit>, among: std::ops::Range<usize>| {
            batch.iter().filter(|visit| among.contains(&visit.left)).count()
        };
        for batch in &rounds {
            assert_eq!(batch.len(), left(batch, 1..51));
            let early = left(batch, 1..21);
            assert!(2 * early > batch.len() * 7 / 10 && early < batch.len() * 7 / 10, "{early}");
        }
    }

    #[test]
    fn drawn_states_stay_within_the_noise() {
        let lessons = [lesson(3, 0.0)];
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        let sampler = Sampler::new(&lessons, &limits);
        let config = tiny();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for _ in 0..40 {
            let visit = sampler.draw(&config, 0.0, &mut rng);
            let (nearest, _) = lessons[0].demonstrations.nearest(&visit.state.q);
            let off = visit.state.q - lessons[0].demonstrations.state(nearest).q;
            assert!(off.amax() <= 0.12 + 0.04 && visit.state.qd.amax() <= 0.3);
            assert_eq!(visit.left, 1, "roll-outs begin with one step");
            // As in attempts no joint is beyond its limits; the thumb's first begins at one there.
            assert!(limits.contains(&visit.state.q, 0.0), "{}", visit.state.q);
        }
    }
}
