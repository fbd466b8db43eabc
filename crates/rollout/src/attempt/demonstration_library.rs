//! Replay of demonstrations in place of a policy (`play-back` in the comparison): the performance of a model
//! without its network.

use policy::Observation;
use robot::{JointState, JointVector};

/// Demonstrations in the canonical frame: rotated about the robot, so that the object is at azimuth 0.
#[derive(Clone, Debug, Default)]
pub struct DemonstrationLibrary {
    demonstrations: Vec<Vec<JointState>>,
}

impl DemonstrationLibrary {
    /// Adds a demonstration (base frame) of the observed object; empty demonstrations are ignored.
    pub fn add(&mut self, observation: &Observation, states: impl Iterator<Item = JointState>) {
        let states: Vec<JointState> =
            states.map(|state| observation.state_to_canonical(&state)).collect();
        if !states.is_empty() {
            self.demonstrations.push(states);
        }
    }

    /// Finds the demonstration that starts nearest to the configuration `start` (rad, base frame), and
    /// rotates it to the observed azimuth.
    pub(crate) fn nearest(
        &self,
        start: &JointVector,
        observation: &Observation,
    ) -> Option<Vec<JointState>> {
        let start = observation.to_canonical(start);
        let distance = |states: &Vec<JointState>| (states[0].q - start).norm_squared();
        let nearest =
            self.demonstrations.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        let rotated = |state: &JointState| JointState {
            q: observation.from_canonical(&state.q),
            qd: state.qd,
        };
        Some(nearest.iter().map(rotated).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_demonstration_is_rotated_to_observed_azimuth() {
        let observed = |bearing| Observation { azimuth: bearing, latent: vec![0.0] };
        let at = |x: f64| JointState::at_rest(JointVector::from_element(x));
        let mut library = DemonstrationLibrary::default();
        assert!(library.nearest(&at(0.0).q, &observed(0.0)).is_none());
        library.add(&observed(0.2), [at(0.3), at(0.4)].into_iter());
        library.add(&observed(0.0), [at(0.9)].into_iter());
        library.add(&observed(0.0), std::iter::empty());
        let found = library.nearest(&at(0.35).q, &observed(-0.1)).unwrap();
        assert_eq!(found.len(), 2);
        assert!((found[1].q[0] - (0.4 - 0.2 - 0.1)).abs() < 1e-12);
        assert!((found[1].q - at(0.4).q).rows(1, robot::DOF - 1).amax() < 1e-12);
    }
}
