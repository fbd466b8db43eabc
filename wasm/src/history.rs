//! What an attempt looked like, tick by tick, to be looked at again.
//!
//! In: one picture a tick. Out: the picture that is to be shown: the last one, or an earlier one that was asked for.

use crate::protocol::Phase;
use rollout::Moment;

/// How things stood after a tick.
#[derive(Clone, Debug)]
pub(crate) struct Picture {
    /// Seven numbers a body.
    pub(crate) poses: Vec<f32>,
    /// Commanded joint positions (rad).
    pub(crate) joints: Vec<f32>,
    /// Six numbers for each thing that presses on the object.
    pub(crate) contacts: Vec<f32>,
    pub(crate) phase: Phase,
    pub(crate) moment: Option<Moment>,
}

/// The pictures of one attempt.
#[derive(Debug, Default)]
pub(crate) struct History {
    pictures: Vec<Picture>,
    /// Which one is looked at, unless it is the last.
    at: Option<usize>,
}

impl History {
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    pub(crate) fn push(&mut self, picture: Picture) {
        self.pictures.push(picture);
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.pictures.len()
    }

    /// The moments of all pictures; those that are not known are `found`, by their ticks.
    pub(crate) fn moments(&mut self, found: impl Fn(usize) -> Moment) -> Vec<Moment> {
        let known = |(tick, picture): (usize, &mut Picture)| {
            *picture.moment.get_or_insert_with(|| found(tick))
        };
        self.pictures.iter_mut().enumerate().map(known).collect()
    }

    /// Looks at the picture of this tick; beyond the last one, at that.
    pub(crate) fn seek(&mut self, tick: usize) {
        self.at = Some(tick).filter(|tick| *tick < self.last());
    }

    /// Whether an earlier picture is looked at.
    pub(crate) fn is_behind(&self) -> bool {
        self.at.is_some()
    }

    /// Goes on by a tick.
    pub(crate) fn advance(&mut self) {
        self.seek(self.tick() + 1);
    }

    /// The tick that is looked at.
    pub(crate) fn tick(&self) -> usize {
        self.at.unwrap_or(self.last())
    }

    /// The last tick.
    pub(crate) fn last(&self) -> usize {
        self.pictures.len().saturating_sub(1)
    }

    /// What is to be shown.
    pub(crate) fn shown(&self) -> Option<&Picture> {
        self.pictures.get(self.tick())
    }

    /// The phases so far, in their order, each with its first tick. An attempt that fails early leaves some out.
    pub(crate) fn marks(&self) -> Vec<(Phase, usize)> {
        let mut marks = Vec::new();
        let mut before = None;
        for (tick, picture) in self.pictures.iter().enumerate() {
            if before != Some(picture.phase) {
                marks.push((picture.phase, tick));
                before = Some(picture.phase);
            }
        }
        marks
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasm_bindgen_test::wasm_bindgen_test as test;

    fn picture(phase: Phase) -> Picture {
        Picture { poses: vec![], joints: vec![], contacts: vec![], phase, moment: None }
    }

    #[test]
    fn a_phase_that_was_left_out_has_no_mark() {
        let mut history = History::default();
        for phase in [Phase::Approach, Phase::Approach, Phase::Verdict] {
            history.push(picture(phase));
        }
        assert_eq!(history.marks(), [(Phase::Approach, 0), (Phase::Verdict, 2)]);
    }

    #[test]
    fn moments_that_nobody_watched_are_found_later() {
        let moment = |energy: f64| Moment { energy, margin: 0.1, damping: None, terms: None };
        let mut history = History::default();
        history.push(picture(Phase::Approach));
        history.push(Picture { moment: Some(moment(7.0)), ..picture(Phase::Policy) });
        history.push(picture(Phase::Lift));
        let energies: Vec<f64> =
            history.moments(|tick| moment(tick as f64)).iter().map(|m| m.energy).collect();
        assert_eq!(energies, [0.0, 7.0, 2.0]);
        history.seek(0);
        assert_eq!(history.shown().unwrap().moment, Some(moment(0.0)));
    }

    #[test]
    fn an_earlier_picture_is_shown_and_played_to_the_last() {
        let mut history = History::default();
        assert!(history.shown().is_none() && !history.is_behind());
        for phase in [Phase::Approach, Phase::Approach, Phase::Policy, Phase::Lift] {
            history.push(picture(phase));
        }
        assert_eq!((history.tick(), history.last()), (3, 3));
        let marks = [(Phase::Approach, 0), (Phase::Policy, 2), (Phase::Lift, 3)];
        assert_eq!(history.marks(), marks);
        history.seek(1);
        assert!(history.is_behind() && history.shown().unwrap().phase == Phase::Approach);
        // What comes meanwhile moves nothing.
        history.push(picture(Phase::Lift));
        assert_eq!((history.tick(), history.last()), (1, 4));
        for tick in 2..4 {
            history.advance();
            assert_eq!((history.tick(), history.is_behind()), (tick, true));
        }
        history.advance();
        assert!(!history.is_behind() && history.tick() == 4);
        for far in [99, usize::MAX] {
            history.seek(1);
            history.seek(far);
            assert!(!history.is_behind() && history.tick() == 4);
        }
    }
}
