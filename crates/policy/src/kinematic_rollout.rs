//! Kinematic rollouts of a policy: time steps of Eq. 6 and 7, without physics.

use crate::{Network, Observation};
use robot::integrator::{self, CONTROL_DT};
use robot::{JointState, JointVector, KinematicTree};

/// Control periods of a rollout: 4 s, the time limit of the policy in an attempt.
const NUM_STEPS: usize = (4.0 / CONTROL_DT) as usize;

/// Final configurations (rad, base frame) of rollouts that start at rest; `None` where the policy diverges.
///
/// Each start (rad, base frame) has an observation. No rollout depends on the others; together they share the reads of
/// the network's weights.
pub fn roll_out(
    network: &Network,
    tree: &KinematicTree,
    starts: &[(&Observation, JointVector)],
) -> Vec<Option<JointVector>> {
    let at_rest = |(_, start): &(_, JointVector)| Some(JointState::at_rest(*start));
    let mut states: Vec<Option<JointState>> = starts.iter().map(at_rest).collect();
    for _ in 0..NUM_STEPS {
        let pairs = starts.iter().zip(&states);
        let inputs: Vec<_> =
            pairs.filter_map(|((of, _), state)| Some(of.network_input(state.as_ref()?))).collect();
        let mut accelerations = network.accelerations(&inputs).into_iter();
        for state in &mut states {
            let Some(now) = *state else { continue };
            let next = |qdd| tree.limits.clamp_state(&integrator::step(&now, &qdd, CONTROL_DT));
            *state = accelerations.next().flatten().map(next);
        }
    }
    states.into_iter().map(|state| Some(state?.q)).collect()
}
