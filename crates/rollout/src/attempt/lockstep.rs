//! Attempts that advance together, so that the network is evaluated for all of them at once.

use crate::attempt::Attempt;
use crate::rollout_context::RolloutContext;

/// Attempts that wait for each other before each step of the network.
///
/// A step of one attempt reads all weights of the network (11 MB for the NGF) for one product each. Here, each
/// weight is read once for all attempts. The bits of an attempt do not depend on the others.
///
/// ```rust
/// use rollout::{Attempt, Controller, Lockstep, RolloutContext};
/// let context = RolloutContext::new()?;
/// let object = objects::Object::from_catalog("sugar_box").expect("a built-in object");
/// let attempt = |seed| Attempt::new(&context, &object, "sugar_box", None, seed, Controller::Planner);
/// let mut attempts = Lockstep::new(vec![attempt(0)?, attempt(1)?]);
/// while !attempts.is_empty() {
///     if let Some(ended) = attempts.advance(&context) {
///         println!("seed {}: {:?}", ended.seed(), ended.outcome());
///     }
/// }
/// # Ok::<(), rollout::RolloutError>(())
/// ```
#[derive(Default)]
pub struct Lockstep {
    /// Attempts without outcome, except those that could not start.
    attempts: Vec<Attempt>,
}

impl Lockstep {
    /// Attempts to run; those with an outcome are returned by [`Self::advance`] without a step.
    pub fn new(attempts: Vec<Attempt>) -> Self {
        Self { attempts }
    }

    /// Whether all attempts have ended.
    pub fn is_empty(&self) -> bool {
        self.attempts.is_empty()
    }

    /// Advances the first attempt that does not wait for the network, or else all attempts, by one control
    /// period. Removes and returns an attempt that has an outcome.
    pub fn advance(&mut self, context: &RolloutContext) -> Option<Attempt> {
        let waits = |attempt: &Attempt| attempt.network_input(context).is_some();
        let Some(index) = self.attempts.iter().position(|attempt| !waits(attempt)) else {
            self.step_all(context);
            return None;
        };
        if self.attempts[index].outcome().is_none() {
            self.attempts[index].step(context);
        }
        self.attempts[index].outcome().map(|_| self.attempts.remove(index))
    }

    /// Advances all attempts with q̈ of the network.
    fn step_all(&mut self, context: &RolloutContext) {
        let Some(model) = &context.model else { return };
        let inputs: Vec<_> =
            self.attempts.iter().filter_map(|attempt| attempt.network_input(context)).collect();
        let accelerations = model.network.accelerations(&inputs);
        for (attempt, qdd) in self.attempts.iter_mut().zip(accelerations) {
            attempt.step_with(context, qdd);
        }
    }
}
