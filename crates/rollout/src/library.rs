//! Demonstrations that are played back where a policy would act (`play-back` in the suite): what a model is worth
//! without its network.

use policy::Encoding;
use robot::{JointState, JointVector};

/// Demonstrations, each with the object in front.
#[derive(Clone, Debug, Default)]
pub struct Library {
    demonstrations: Vec<Vec<JointState>>,
}

impl Library {
    /// Adds a demonstration (base frame) for what is seen of its object; an empty one is left out.
    pub fn add(&mut self, seen: &Encoding, states: impl Iterator<Item = JointState>) {
        let states: Vec<JointState> = states.map(|state| seen.state_in_front(&state)).collect();
        if !states.is_empty() {
            self.demonstrations.push(states);
        }
    }

    /// The demonstration that begins nearest to the configuration `start` (rad, base frame), turned to the bearing that
    /// is seen.
    pub(crate) fn from(&self, start: &JointVector, seen: &Encoding) -> Option<Vec<JointState>> {
        let start = seen.in_front(start);
        let distance = |states: &Vec<JointState>| (states[0].q - start).norm_squared();
        let nearest =
            self.demonstrations.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        let turned = |state: &JointState| JointState { q: seen.at_bearing(&state.q), qd: state.qd };
        Some(nearest.iter().map(turned).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_demonstration_that_begins_nearest_is_turned_to_the_bearing_that_is_seen() {
        let seen = |bearing| Encoding { bearing, z: vec![0.0] };
        let at = |x: f64| JointState::at_rest(JointVector::from_element(x));
        let mut library = Library::default();
        assert!(library.from(&at(0.0).q, &seen(0.0)).is_none());
        library.add(&seen(0.2), [at(0.3), at(0.4)].into_iter());
        library.add(&seen(0.0), [at(0.9)].into_iter());
        library.add(&seen(0.0), std::iter::empty());
        let found = library.from(&at(0.35).q, &seen(-0.1)).unwrap();
        assert_eq!(found.len(), 2);
        assert!((found[1].q[0] - (0.4 - 0.2 - 0.1)).abs() < 1e-12);
        assert!((found[1].q - at(0.4).q).rows(1, robot::DOF - 1).amax() < 1e-12);
    }
}
