//! Texts about the outcome of an attempt: one sentence, and the measurements that explain a failure.

use rollout::{Attempt, Outcome};
use scene::config::AttemptProtocol;

/// The outcome in one sentence. After an intervention of the user, the sentence is about the user.
pub(crate) fn headline(attempt: &Attempt, outcome: Outcome) -> &'static str {
    let is_in_hand =
        attempt.evidence().is_none_or(|evidence| evidence.fingers > 0 || evidence.palm);
    match (attempt.was_disturbed(), outcome.is_lifted()) {
        (true, true) => "Lifted and held, but you moved the object: not counted.",
        (true, false) if is_in_hand => "You moved the object: not counted.",
        (true, false) => "You pulled the object out of the hand: not counted.",
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
