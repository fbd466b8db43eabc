//! The states that a policy visits while it learns: drawn beside the demonstrations or where an attempt begins, rolled
//! out by the policy itself, and drawn anew in the end.

use crate::dagger::DaggerConfig;
use crate::lesson::Lesson;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use robot::{ARM, JointState, JointVector, Limits};

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

    /// States of several batches. Horizons are staggered, so that they are not all drawn anew at once.
    pub(crate) fn rounds(
        &self,
        config: &DaggerConfig,
        step: u64,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Vec<Visit>> {
        let mut staggered = |i| {
            let visit = self.draw(config, config.grown(step), rng);
            Visit { left: 1 + i % visit.left, ..visit }
        };
        let mut batch = |_| (0..config.batch).map(&mut staggered).collect();
        (0..config.rounds.max(1)).map(&mut batch).collect()
    }

    /// A start of a neighbour or a noisy state of a random demonstration; `grown` is the share of
    /// their full length that roll-outs have by now.
    pub(crate) fn draw(&self, config: &DaggerConfig, grown: f64, rng: &mut ChaCha8Rng) -> Visit {
        let length = |full: usize| 1 + (grown * (full.max(1) - 1) as f64) as usize;
        let lesson = self.full[rng.random_range(0..self.full.len())];
        let encoding = rng.random_range(0..self.lessons[lesson].encodings.len());
        if rng.random::<f64>() < grown * config.start_share {
            let start = self.lessons[lesson].draw_start(rng);
            let q = self.lessons[lesson].encodings[encoding].at_bearing(&start);
            let (state, left) = (JointState::at_rest(q), length(config.start_horizon()));
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
        Visit { lesson, encoding, state, left: length(config.horizon) }
    }
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
        DaggerConfig::standard(PolicyConfig::tiny())
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
