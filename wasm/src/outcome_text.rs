//! Texts about the outcome of an attempt: one sentence, and the measurements that explain a failure.

use rollout::{Attempt, Outcome};
use scene::config::AttemptProtocol;

/// The outcome in one sentence. After an intervention of the user, the sentence is about the user.
pub(crate) fn headline(attempt: &Attempt, outcome: Outcome) -> &'static str {
    let was_pulled_out = attempt.evidence().is_some_and(|evidence| {
        evidence.max_fingers > 0 && evidence.fingers == 0 && !evidence.palm
    });
    match (attempt.was_disturbed(), outcome.is_lifted()) {
        (true, true) => "Lifted and held, but you moved the object: not counted.",
        (true, false) if was_pulled_out => "You pulled the object out of the hand: not counted.",
        (true, false) => "You moved the object: not counted.",
        (false, _) => attempt.description().unwrap_or(outcome.description()),
    }
}

/// Measurements that explain a failure; `None` for a lifted object, and for an attempt without a simulation.
pub(crate) fn explanation(
    attempt: &Attempt,
    outcome: Outcome,
    protocol: &AttemptProtocol,
) -> Option<String> {
    let evidence = attempt.evidence().filter(|_| !outcome.is_lifted())?;
    Some(evidence.explain(protocol))
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Vec3;
    use objects::object::Object;
    use rollout::{Controller, Phase, RolloutContext};
    use wasm_bindgen_test::wasm_bindgen_test as test;

    /// Headline of the planner's attempt with an object of the shape of the sugar box.
    ///
    /// `pull`: from the start of this phase on, the user pulls the object to this offset (m) from its position.
    fn headline_of(object: &Object, pull: Option<(Phase, Vec3)>) -> &'static str {
        let context = RolloutContext::new().unwrap();
        let controller = Controller::Planner;
        let mut attempt = Attempt::new(&context, object, "sugar_box", None, 0, controller).unwrap();
        if let Some((phase, offset)) = pull {
            while attempt.phase() != phase {
                assert_eq!(attempt.outcome(), None, "before {phase:?}");
                attempt.step(&context);
            }
            let target = attempt.scene().object_pose().translation + offset;
            attempt.drag(Some((Vec3::ZERO, target)));
        }
        let outcome = attempt.run(&context);
        headline(&attempt, outcome)
    }

    #[test]
    fn object_pulled_out_of_the_hand_has_not_slipped() {
        // The hand grips it, but rises without it.
        let mut heavy = Object::from_catalog("sugar_box").unwrap();
        heavy.mass = 30.0;
        let undisturbed = headline_of(&heavy, None);
        assert!(undisturbed.starts_with("Slipped"), "{undisturbed}");
        let down = Vec3::new(0.0, 0.0, -0.5);
        let pulled = headline_of(&heavy, Some((Phase::Lift, down)));
        assert_eq!(pulled, "You pulled the object out of the hand: not counted.");
    }

    #[test]
    fn object_pulled_away_before_any_contact_was_only_moved() {
        let object = Object::from_catalog("sugar_box").unwrap();
        let away = Vec3::new(0.0, 0.4, 0.1);
        let moved = headline_of(&object, Some((Phase::Policy, away)));
        assert_eq!(moved, "You moved the object: not counted.");
    }

    #[test]
    fn object_that_stays_in_the_hand_was_only_moved() {
        let object = Object::from_catalog("sugar_box").unwrap();
        assert_eq!(headline_of(&object, None), "Lifted and held.");
        let moved = headline_of(&object, Some((Phase::Hold, Vec3::ZERO)));
        assert_eq!(moved, "Lifted and held, but you moved the object: not counted.");
    }
}
