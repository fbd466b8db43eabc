//! History of an attempt for scrubbing through its ticks.
//!
//! In: one snapshot per tick. Out: the snapshot to display, either the last one or the one at the timeline's
//! tick.

use crate::protocol::Phase;
use rollout::TelemetrySample;

/// State of the scene after a tick.
#[derive(Clone, Debug)]
pub(crate) struct Snapshot {
    /// Position and quaternion of each body: seven numbers per body.
    pub(crate) poses: Vec<f32>,
    /// Commanded joint positions (rad).
    pub(crate) joints: Vec<f32>,
    /// Contact points (m) and forces (N) on the object: six numbers per contact.
    pub(crate) contacts: Vec<f32>,
    pub(crate) phase: Phase,
    pub(crate) telemetry: Option<TelemetrySample>,
}

/// Snapshots of one attempt.
#[derive(Debug, Default)]
pub(crate) struct History {
    snapshots: Vec<Snapshot>,
    /// Displayed tick while scrubbing; `None` displays the last one.
    scrub_tick: Option<usize>,
}

impl History {
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    pub(crate) fn push(&mut self, snapshot: Snapshot) {
        self.snapshots.push(snapshot);
    }

    /// Number of snapshots.
    pub(crate) fn len(&self) -> usize {
        self.snapshots.len()
    }

    /// Telemetry of all snapshots. Missing samples are computed by `sample_at` from their tick and stored.
    pub(crate) fn telemetry(
        &mut self,
        sample_at: impl Fn(usize) -> TelemetrySample,
    ) -> Vec<TelemetrySample> {
        let sample = |(tick, snapshot): (usize, &mut Snapshot)| {
            *snapshot.telemetry.get_or_insert_with(|| sample_at(tick))
        };
        self.snapshots.iter_mut().enumerate().map(sample).collect()
    }

    /// Displays the snapshot of this tick, or the last one if there are fewer ticks.
    pub(crate) fn seek(&mut self, tick: usize) {
        self.scrub_tick = Some(tick).filter(|tick| *tick < self.last_tick());
    }

    /// Whether an earlier snapshot than the last one is displayed.
    pub(crate) fn is_scrubbing(&self) -> bool {
        self.scrub_tick.is_some()
    }

    /// Displays the next snapshot.
    pub(crate) fn advance(&mut self) {
        self.seek(self.tick() + 1);
    }

    /// Displayed tick.
    pub(crate) fn tick(&self) -> usize {
        self.scrub_tick.unwrap_or(self.last_tick())
    }

    /// Index of the last tick.
    pub(crate) fn last_tick(&self) -> usize {
        self.snapshots.len().saturating_sub(1)
    }

    /// Displayed snapshot.
    pub(crate) fn current(&self) -> Option<&Snapshot> {
        self.snapshots.get(self.tick())
    }

    /// First tick of each phase so far, in order. An attempt that fails early skips some phases.
    pub(crate) fn phase_starts(&self) -> Vec<(Phase, usize)> {
        let mut starts = Vec::new();
        let mut previous = None;
        for (tick, snapshot) in self.snapshots.iter().enumerate() {
            if previous != Some(snapshot.phase) {
                starts.push((snapshot.phase, tick));
                previous = Some(snapshot.phase);
            }
        }
        starts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasm_bindgen_test::wasm_bindgen_test as test;

    fn snapshot(phase: Phase) -> Snapshot {
        Snapshot { poses: vec![], joints: vec![], contacts: vec![], phase, telemetry: None }
    }

    #[test]
    fn skipped_phase_has_no_start() {
        let mut history = History::default();
        for phase in [Phase::Approach, Phase::Approach, Phase::Outcome] {
            history.push(snapshot(phase));
        }
        assert_eq!(history.phase_starts(), [(Phase::Approach, 0), (Phase::Outcome, 2)]);
    }

    #[test]
    fn missing_telemetry_is_computed_later() {
        let sample =
            |energy: f64| TelemetrySample { energy, limit_margin: 0.1, damping: None, terms: None };
        let mut history = History::default();
        history.push(snapshot(Phase::Approach));
        history.push(Snapshot { telemetry: Some(sample(7.0)), ..snapshot(Phase::Policy) });
        history.push(snapshot(Phase::Lift));
        let energies: Vec<f64> =
            history.telemetry(|tick| sample(tick as f64)).iter().map(|s| s.energy).collect();
        assert_eq!(energies, [0.0, 7.0, 2.0]);
        history.seek(0);
        assert_eq!(history.current().unwrap().telemetry, Some(sample(0.0)));
    }

    #[test]
    fn scrubbing_plays_from_earlier_snapshot_to_last() {
        let mut history = History::default();
        assert!(history.current().is_none() && !history.is_scrubbing());
        for phase in [Phase::Approach, Phase::Approach, Phase::Policy, Phase::Lift] {
            history.push(snapshot(phase));
        }
        assert_eq!((history.tick(), history.last_tick()), (3, 3));
        let starts = [(Phase::Approach, 0), (Phase::Policy, 2), (Phase::Lift, 3)];
        assert_eq!(history.phase_starts(), starts);
        history.seek(1);
        assert!(history.is_scrubbing() && history.current().unwrap().phase == Phase::Approach);
        // New snapshots do not change the displayed one.
        history.push(snapshot(Phase::Lift));
        assert_eq!((history.tick(), history.last_tick()), (1, 4));
        for tick in 2..4 {
            history.advance();
            assert_eq!((history.tick(), history.is_scrubbing()), (tick, true));
        }
        history.advance();
        assert!(!history.is_scrubbing() && history.tick() == 4);
        for beyond in [99, usize::MAX] {
            history.seek(1);
            history.seek(beyond);
            assert!(!history.is_scrubbing() && history.tick() == 4);
        }
    }
}
