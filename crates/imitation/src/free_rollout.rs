//! What a policy does without physics: free roll-outs, and the damping on its way.

use crate::lesson::Lesson;
use policy::Network;
use rayon::prelude::*;
use robot::{JointState, JointVector, Tree, integrator};
use scene::config::CONTROL_PERIOD;

/// Control periods of a free roll-out: 4 s, as long as the policy may act in an attempt.
const FREE_STEPS: usize = (4.0 / CONTROL_PERIOD) as usize;

/// Rows between two at which the damping is looked at.
const EVERY_ROW: usize = 10;

/// Free roll-outs of the policy from where attempts with the objects of lessons may begin: distance (m) of the
/// fingertips at the end from where the demonstrations have them, the mean over the four tips, sorted. Lessons that no
/// pose nearby is grasped alike with are left out.
pub fn fingertip_errors(tree: &Tree, policy: &Network, lessons: &[&Lesson]) -> Vec<f64> {
    let error = |lesson: &Lesson, start: &JointVector| {
        let object = &lesson.encodings[lesson.encodings.len() - 1];
        let mut state = JointState::at_rest(object.at_bearing(start));
        for _ in 0..FREE_STEPS {
            let lost = || JointVector::repeat(f64::NAN);
            let qdd = object.acceleration(policy, &state).unwrap_or_else(lost);
            state = tree.limits.stop(&integrator::step(&state, &qdd, CONTROL_PERIOD));
        }
        let end = lesson.demonstrations.state(lesson.demonstrations.rows() - 1).q;
        let apart = tips_apart(tree, &state.q, &end);
        if apart.is_finite() { apart } else { f64::INFINITY }
    };
    let of_lesson = |lesson: &&Lesson| {
        lesson.near.iter().take(2).map(|start| error(lesson, start)).collect::<Vec<_>>()
    };
    let mut errors: Vec<f64> = lessons.par_iter().flat_map_iter(of_lesson).collect();
    errors.sort_by(f64::total_cmp);
    errors
}

/// Distance (m) between the fingertips of two postures, the mean over the four tips.
fn tips_apart(tree: &Tree, a: &JointVector, b: &JointVector) -> f64 {
    let (a, b) = (tree.kinematics(a).tips(), tree.kinematics(b).tips());
    a.iter().zip(&b).map(|(a, b)| (a - b).norm()).sum::<f64>() / 4.0
}

/// The greatest λ_max(B) + β (1/s) of a fabric in the states of demonstrations; `None` of another network.
pub fn greatest_damping(policy: &Network, lessons: &[&Lesson]) -> Option<f64> {
    let of_lesson = |lesson: &&Lesson| {
        let (object, rows) = (&lesson.encodings[0], lesson.demonstrations.rows());
        let row = |row| {
            let state = object.state_in_front(&lesson.demonstrations.state(row));
            Some(policy.fabric(&state, &object.z)?.greatest_damping())
        };
        (0..rows).step_by(EVERY_ROW).filter_map(row).reduce(f64::max)
    };
    lessons.par_iter().filter_map(of_lesson).reduce_with(f64::max)
}
