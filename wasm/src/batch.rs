//! Many attempts one after another, as fast as they go.

use crate::protocol::Attempted;
use crate::stage::Stage;
use crate::statistics::Tally;
use rollout::{Attempt, RolloutError};

/// Attempts of seeds one after another with what stands on the stage.
pub(crate) struct Batch {
    run: u32,
    seed: u32,
    left: u32,
    /// Its attempts so far.
    tally: Tally,
    current: Option<Attempt>,
}

impl Batch {
    /// So many, from this seed on.
    pub(crate) fn new(run: u32, seed: u32, attempts: u32) -> Self {
        Self { run, seed, left: attempts, tally: Tally::default(), current: None }
    }

    /// Its number.
    pub(crate) fn run(&self) -> u32 {
        self.run
    }

    /// Whether all are done.
    pub(crate) fn is_over(&self) -> bool {
        self.left == 0
    }

    /// A tick of the attempt under way, or the beginning of the next one; says how it ended when it did.
    pub(crate) fn advance(&mut self, stage: &mut Stage) -> Result<Option<Attempted>, RolloutError> {
        let Some(attempt) = &mut self.current else {
            if self.left > 0 {
                self.current = Some(stage.attempt(None, self.seed)?);
            }
            return Ok(None);
        };
        attempt.tick(&stage.workcell);
        let Some(verdict) = attempt.verdict() else { return Ok(None) };
        self.tally.count(verdict.is_lifted());
        let told = stage.attempted(self.run, self.tally, attempt, verdict);
        self.current = None;
        self.seed = self.seed.wrapping_add(1);
        self.left -= 1;
        Ok(Some(told))
    }
}
