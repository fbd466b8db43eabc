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
/// fingertips at the end from where the demonstrations have them, the mean over the four tips. Lessons that no pose nearby is
/// grasped alike with are left out.
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
    lessons.par_iter().flat_map_iter(of_lesson).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expert::Demonstrations;
    use crate::nn::{Params, network};
    use crate::visits::samples::lesson;
    use policy::PolicyConfig;
    use policy::baseline::BaselineConfig;
    use policy::head::DAMPING;
    use policy::network::NetworkConfig;
    use policy::ngf::NgfConfig;
    use policy::weights::Tensors;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use robot::DOF;

    fn fresh(network: NetworkConfig, tree: &Tree) -> Network {
        let config = PolicyConfig { network, ..PolicyConfig::tiny() };
        let mut params = Params::default();
        network::init(&mut params, &config, &mut ChaCha8Rng::seed_from_u64(3)).unwrap();
        let bytes = params.export(&[]).unwrap();
        Network::load(&Tensors::parse(&bytes).unwrap(), &config, &tree.limits).unwrap()
    }

    /// A fabric that is nothing but its bowl: it goes to the middle of that, and stays.
    fn homing(rest: &JointVector, tree: &Tree) -> Network {
        let config = NgfConfig { potential_scale: 0.0, rest: (*rest).into(), ..NgfConfig::tiny() };
        fresh(NetworkConfig::Ngf(config), tree)
    }

    #[test]
    fn what_goes_where_it_was_shown_is_nowhere_off_and_else_by_the_way_between() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let middle = (tree.limits.lower + tree.limits.upper) * 0.5;
        let policy = homing(&middle, &tree);
        let shown = |end: JointVector| {
            let row = |q: &JointVector| q.iter().map(|x| *x as f32).chain([0.0; DOF]).collect();
            let mut shown = lesson(0, 0.7);
            let bearing = shown.encodings[1].bearing;
            let mut end = end;
            end[0] += bearing;
            let rows: Vec<Vec<f32>> = vec![row(&JointVector::zeros()), row(&end)];
            shown.demonstrations = Demonstrations::new(rows.concat(), vec![0, 2]);
            shown.near = vec![middle, middle * 0.9, middle * 0.8];
            shown
        };
        let there = fingertip_errors(&tree, &policy, &[&shown(middle)]);
        assert!(there.len() == 2 && there.iter().all(|off| *off < 1e-4), "{there:?}");
        let mut beside = middle;
        beside[3] += 0.2;
        let off = fingertip_errors(&tree, &policy, &[&shown(beside)]);
        let wanted = tips_apart(&tree, &middle, &beside);
        assert!(wanted > 0.05 && off.iter().all(|off| (off - wanted).abs() < 1e-3), "{off:?}");
        let alone = lesson(0, 0.7);
        assert!(fingertip_errors(&tree, &policy, &[&alone]).is_empty(), "it begins nowhere");
    }

    #[test]
    fn the_greatest_damping_is_that_of_the_fabric_on_the_way() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let found = greatest_damping(&homing(&JointVector::zeros(), &tree), &[&lesson(0, 0.0)]);
        // β_f = 51 + 1e-3, M = 2 (1 + 1e-3)² I + 0.02 I.
        let wanted = 51.001 / (2.0 * 1.001 * 1.001 + 0.02) + DAMPING;
        assert!((found.unwrap() - wanted).abs() < 1e-3 * wanted, "{found:?}");
        let baseline = fresh(NetworkConfig::Mlp(BaselineConfig::paper()), &tree);
        assert_eq!(greatest_damping(&baseline, &[&lesson(0, 0.0)]), None);
    }
}
