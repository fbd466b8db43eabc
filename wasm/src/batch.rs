//! Batch of attempts, run at full speed by one or several workers.

use crate::protocol::{AttemptFinished, BatchAttempt};
use crate::session::Session;
use crate::statistics::Tally;
use rollout::{Lockstep, RolloutError};

/// Max attempts of one worker that advance in lockstep.
const MAX_LOCKSTEP: u32 = Lockstep::MAX_GROUP as u32;

/// Attempts of consecutive seeds with the current object.
pub(crate) struct Batch {
    id: u32,
    /// Seed of the first attempt that no worker has taken.
    seed: u32,
    /// Attempts that no worker has taken.
    untaken: u32,
    /// Attempts of all workers without result.
    unfinished: u32,
    /// Workers that execute the batch.
    workers: u32,
    /// Seeds that this worker has taken but not started.
    own: Share,
    /// Attempts of this worker.
    running: Lockstep,
    /// Attempts so far.
    tally: Tally,
}

/// Consecutive seeds that one worker executes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Share {
    pub(crate) seed: u32,
    /// Number of seeds; 0 if none is left.
    pub(crate) attempts: u32,
}

impl Batch {
    /// `id` is part of the resulting events; `seed` is that of the first attempt.
    pub(crate) fn new(id: u32, seed: u32, attempts: u32, workers: u32) -> Self {
        Self {
            id,
            seed,
            untaken: attempts,
            unfinished: attempts,
            workers: workers.max(1),
            own: Share::default(),
            running: Lockstep::default(),
            tally: Tally::default(),
        }
    }

    /// Id from the request.
    pub(crate) fn id(&self) -> u32 {
        self.id
    }

    /// Whether all attempts have ended.
    pub(crate) fn is_finished(&self) -> bool {
        self.unfinished == 0
    }

    /// Whether this worker has nothing to execute; others may.
    pub(crate) fn is_idle(&self) -> bool {
        self.untaken + self.own.attempts == 0 && self.running.is_empty()
    }

    /// Takes seeds for one worker. Shares become smaller, so that the workers end at about the same time.
    pub(crate) fn take(&mut self) -> Share {
        let fair =
            if self.workers == 1 { self.untaken } else { self.untaken.div_ceil(2 * self.workers) };
        let share = Share { seed: self.seed, attempts: fair.min(MAX_LOCKSTEP) };
        self.seed = self.seed.wrapping_add(share.attempts);
        self.untaken -= share.attempts;
        share
    }

    /// Starts an attempt of this worker, or advances one by one tick. Returns the result when an attempt ends.
    pub(crate) fn advance(
        &mut self,
        session: &mut Session,
    ) -> Result<Option<AttemptFinished>, RolloutError> {
        if self.own.attempts == 0 && self.running.is_empty() {
            self.own = self.take();
        }
        if self.own.attempts > 0 {
            self.running.push(session.new_attempt(None, self.own.seed)?);
            self.own.seed = self.own.seed.wrapping_add(1);
            self.own.attempts -= 1;
            return Ok(None);
        }
        let ended = self.running.advance(&session.context);
        let ended = ended.as_ref().and_then(BatchAttempt::of);
        Ok(ended.and_then(|attempt| self.count(attempt, session)))
    }

    /// Counts an attempt of this or another worker; `None` if all attempts have been counted.
    pub(crate) fn count(
        &mut self,
        attempt: BatchAttempt,
        session: &mut Session,
    ) -> Option<AttemptFinished> {
        self.unfinished = self.unfinished.checked_sub(1)?;
        self.tally.count(attempt.lifted);
        let tally = session.count_batch_attempt(&attempt);
        Some(AttemptFinished { batch_id: self.id, attempt, batch_tally: self.tally, tally })
    }
}

#[cfg(all(test, target_arch = "wasm32"))]
mod tests {
    use super::*;
    use wasm_bindgen_test::wasm_bindgen_test;

    /// Shares of a batch until all seeds are taken.
    fn shares(attempts: u32, workers: u32) -> Vec<Share> {
        let mut batch = Batch::new(1, u32::MAX, attempts, workers);
        let taken = std::iter::repeat_with(|| batch.take());
        taken.take_while(|share| share.attempts > 0).collect()
    }

    #[wasm_bindgen_test]
    fn shares_cover_all_seeds_and_become_smaller() {
        for (attempts, workers) in [(1, 2), (7, 1), (20, 2), (100, 4)] {
            let shares = shares(attempts, workers);
            let mut next = u32::MAX;
            for share in &shares {
                assert_eq!(share.seed, next);
                next = next.wrapping_add(share.attempts);
            }
            assert_eq!(next, u32::MAX.wrapping_add(attempts));
            assert!(shares.is_sorted_by_key(|share| std::cmp::Reverse(share.attempts)));
            assert!(shares[0].attempts <= MAX_LOCKSTEP);
        }
        assert_eq!(shares(7, 1).len(), 1, "one worker has no reason for small shares");
    }

    #[wasm_bindgen_test]
    fn attempts_in_shares_of_two_workers_equal_those_of_one() {
        let (Ok(mut page), Ok(mut helper)) = (Session::new(), Session::new()) else {
            panic!("no session");
        };
        let run = |batch: &mut Batch, session: &mut Session| {
            let mut results = Vec::new();
            while !batch.is_idle() {
                results.extend(batch.advance(session).ok().unwrap());
            }
            results
        };
        let end = |result: &AttemptFinished| {
            (result.attempt.seed, result.attempt.final_state_hash.clone())
        };
        let mut alone = run(&mut Batch::new(1, 5, 4, 1), &mut page);
        alone.sort_by_key(|result| result.attempt.seed);
        // The page's worker counts the results of both.
        let mut shared = Batch::new(2, 5, 4, 2);
        let Share { seed, attempts } = shared.take();
        let of_helper = run(&mut Batch::new(2, seed, attempts, 1), &mut helper);
        let mut results = run(&mut shared, &mut page);
        assert!(shared.is_idle() && !shared.is_finished());
        results.extend(of_helper.into_iter().filter_map(|r| shared.count(r.attempt, &mut page)));
        assert!(shared.is_finished());
        let last = results.last().expect("four results").batch_tally;
        assert_eq!(
            last,
            alone.iter().fold(Tally::default(), |mut tally, result| {
                tally.count(result.attempt.lifted);
                tally
            })
        );
        results.sort_by_key(|result| result.attempt.seed);
        assert!(results.iter().map(end).eq(alone.iter().map(end)));
    }
}
