//! Batch of attempts, run at full speed.

use crate::protocol::AttemptFinished;
use crate::session::Session;
use crate::statistics::Tally;
use rollout::{Attempt, RolloutError};

/// Attempts of consecutive seeds with the current object.
pub(crate) struct Batch {
    id: u32,
    seed: u32,
    remaining: u32,
    /// Attempts so far.
    tally: Tally,
    current: Option<Attempt>,
}

impl Batch {
    /// `id` is part of the resulting events; `seed` is that of the first attempt.
    pub(crate) fn new(id: u32, seed: u32, attempts: u32) -> Self {
        Self { id, seed, remaining: attempts, tally: Tally::default(), current: None }
    }

    /// Id from the request.
    pub(crate) fn id(&self) -> u32 {
        self.id
    }

    /// Whether all attempts have ended.
    pub(crate) fn is_finished(&self) -> bool {
        self.remaining == 0
    }

    /// Advances the current attempt by one tick, or starts the next one. Returns the result when an attempt
    /// ends.
    pub(crate) fn advance(
        &mut self,
        session: &mut Session,
    ) -> Result<Option<AttemptFinished>, RolloutError> {
        let Some(attempt) = &mut self.current else {
            if self.remaining > 0 {
                self.current = Some(session.new_attempt(None, self.seed)?);
            }
            return Ok(None);
        };
        attempt.step(&session.context);
        let Some(outcome) = attempt.outcome() else { return Ok(None) };
        self.tally.count(outcome.is_lifted());
        let finished = session.finish_batch_attempt(self.id, self.tally, attempt, outcome);
        self.current = None;
        self.seed = self.seed.wrapping_add(1);
        self.remaining -= 1;
        Ok(Some(finished))
    }
}
