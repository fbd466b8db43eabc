//! Attempts that advance together, so that the network is evaluated for all of them at once.

use crate::attempt::Attempt;
use crate::rollout_context::RolloutContext;
use robot::JointVector;
use std::collections::VecDeque;

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
    /// q̈ (rad/s²) of the last attempts, which have not been stepped with it; `None` if it is not finite.
    accelerations: VecDeque<Option<JointVector>>,
}

impl Lockstep {
    /// Max attempts of a group in evaluations and in batches of the page. A larger group reports later.
    pub const MAX_GROUP: usize = 8;

    /// Attempts to run; those with an outcome are returned by [`Self::advance`] without a step.
    pub fn new(attempts: Vec<Attempt>) -> Self {
        Self { attempts, accelerations: VecDeque::new() }
    }

    /// Adds an attempt that has not been stepped.
    pub fn push(&mut self, attempt: Attempt) {
        // It takes part in the next step of the network, so it must not be counted among the last attempts.
        let index = self.attempts.len() - self.accelerations.len();
        self.attempts.insert(index, attempt);
    }

    /// Whether all attempts have ended.
    pub fn is_empty(&self) -> bool {
        self.attempts.is_empty()
    }

    /// Advances one attempt by one control period: one that does not wait for the network, if there is one. When
    /// all wait, evaluates the network for all of them. Removes and returns an attempt that has an outcome.
    pub fn advance(&mut self, context: &RolloutContext) -> Option<Attempt> {
        if self.accelerations.is_empty() {
            let waits = |attempt: &Attempt| attempt.network_input(context).is_some();
            match self.attempts.iter().position(|attempt| !waits(attempt)) {
                Some(index) => return self.step(index, None, context),
                None => self.evaluate_network(context),
            }
        }
        let qdd = self.accelerations.pop_front()?;
        let index = self.attempts.len() - self.accelerations.len() - 1;
        self.step(index, qdd, context)
    }

    /// Steps an attempt unless it has an outcome; removes and returns it if it has one afterwards.
    fn step(
        &mut self,
        index: usize,
        qdd: Option<JointVector>,
        context: &RolloutContext,
    ) -> Option<Attempt> {
        let attempt = &mut self.attempts[index];
        if attempt.outcome().is_none() {
            attempt.step_with(context, qdd);
        }
        attempt.outcome().map(|_| self.attempts.remove(index))
    }

    /// Computes q̈ of all attempts, which wait for the network.
    fn evaluate_network(&mut self, context: &RolloutContext) {
        let Some(model) = &context.model else { return };
        let inputs: Vec<_> =
            self.attempts.iter().filter_map(|attempt| attempt.network_input(context)).collect();
        self.accelerations = model.network.accelerations(&inputs).into();
    }
}
