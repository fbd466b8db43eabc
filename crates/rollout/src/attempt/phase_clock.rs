//! The current phase, and the ticks at which the phases started.

use crate::attempt::Phase;

/// Ticks at which the phases started, if they did.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PhaseStarts {
    pub(crate) policy: Option<usize>,
    pub(crate) lift: Option<usize>,
    pub(crate) hold: Option<usize>,
}

/// The current phase, and the control periods (ticks) in it and before it.
pub(crate) struct PhaseClock {
    phase: Phase,
    ticks: usize,
    ticks_in_phase: usize,
    starts: PhaseStarts,
}

impl PhaseClock {
    /// The start of the approach, at tick 0.
    pub(crate) fn new() -> Self {
        let starts = PhaseStarts::default();
        Self { phase: Phase::Approach, ticks: 0, ticks_in_phase: 0, starts }
    }

    /// Counts one control period.
    pub(crate) fn advance(&mut self) {
        self.ticks += 1;
        self.ticks_in_phase += 1;
    }

    /// Starts a phase at the current tick.
    pub(crate) fn enter(&mut self, phase: Phase) {
        match phase {
            Phase::Policy => self.starts.policy = Some(self.ticks),
            Phase::Lift => self.starts.lift = Some(self.ticks),
            Phase::Hold => self.starts.hold = Some(self.ticks),
            Phase::Approach | Phase::Done => {}
        }
        self.phase = phase;
        self.ticks_in_phase = 0;
    }

    pub(crate) fn phase(&self) -> Phase {
        self.phase
    }

    /// Number of control periods since the start of the attempt.
    pub(crate) fn ticks(&self) -> usize {
        self.ticks
    }

    /// Number of control periods since the start of the phase.
    pub(crate) fn ticks_in_phase(&self) -> usize {
        self.ticks_in_phase
    }

    pub(crate) fn starts(&self) -> PhaseStarts {
        self.starts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phase_starts_are_the_ticks_of_their_entry() {
        let mut clock = PhaseClock::new();
        for (periods, phase) in [(3, Phase::Policy), (4, Phase::Lift), (0, Phase::Done)] {
            (0..periods).for_each(|_| clock.advance());
            assert_eq!(clock.ticks_in_phase(), periods);
            clock.enter(phase);
            assert_eq!((clock.phase(), clock.ticks_in_phase()), (phase, 0));
        }
        let PhaseStarts { policy, lift, hold } = clock.starts();
        assert_eq!((policy, lift, hold, clock.ticks()), (Some(3), Some(7), None, 7));
    }
}
