//! When to tick: a fixed step, owed as time passes, and how fast it really goes.
//!
//! In: times of day (ms). Out: numbers of ticks. Knows no timers.

/// Seconds of a tick.
const TICK: f64 = scene::config::CONTROL_PERIOD;
/// Most ticks in one go: messages are read in between.
const MOST: usize = 4;
/// Ticks that are owed beyond this are given up: the attempt runs slower instead of jumping.
const LONGEST_DEBT: f64 = 0.25;
/// The rate is measured over this time (ms).
const WINDOW_MS: f64 = 1000.0;

/// A clock for simulated time.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    /// Simulated seconds per second that are asked for.
    pub(crate) factor: f64,
    /// Whether time passes.
    pub(crate) is_running: bool,
    last_ms: f64,
    /// Simulated seconds that are due.
    owed: f64,
    window: Window,
}

/// Ticks since a time of day, and the rate of the window before.
#[derive(Clone, Copy, Debug, Default)]
struct Window {
    begin_ms: f64,
    ticks: usize,
    rate: Option<f64>,
}

impl Clock {
    pub(crate) fn new() -> Self {
        Self { factor: 1.0, is_running: true, last_ms: 0.0, owed: 0.0, window: Window::default() }
    }

    /// Starts anew: nothing owed, nothing measured.
    pub(crate) fn restart(&mut self, now_ms: f64) {
        self.last_ms = now_ms;
        self.owed = 0.0;
        self.window = Window { begin_ms: now_ms, ..Window::default() };
    }

    /// Ticks to do now.
    pub(crate) fn due(&mut self, now_ms: f64) -> usize {
        let passed = (now_ms - self.last_ms).max(0.0) / 1000.0;
        self.last_ms = now_ms;
        if !self.is_running {
            return 0;
        }
        self.owed = (self.owed + passed * self.factor).min(LONGEST_DEBT * self.factor.max(1.0));
        // A hair's breadth of rounding must not cost a tick.
        let ticks = ((self.owed / TICK + 1e-9) as usize).min(MOST);
        self.owed -= ticks as f64 * TICK;
        self.measure(ticks, now_ms);
        ticks
    }

    /// Milliseconds until the next tick is due.
    pub(crate) fn wait_ms(&self) -> f64 {
        ((TICK - self.owed) / self.factor * 1000.0).max(0.0)
    }

    /// Simulated seconds per second, over the last whole window.
    pub(crate) fn measured(&self) -> Option<f64> {
        self.window.rate
    }

    fn measure(&mut self, ticks: usize, now_ms: f64) {
        let window = &mut self.window;
        window.ticks += ticks;
        let passed = now_ms - window.begin_ms;
        if passed >= WINDOW_MS {
            let rate = window.ticks as f64 * TICK / (passed / 1000.0);
            *window = Window { begin_ms: now_ms, ticks: 0, rate: Some(rate) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasm_bindgen_test::wasm_bindgen_test as test;

    /// Ticks done when the clock is asked every `every_ms` for `seconds`.
    fn run(clock: &mut Clock, every_ms: f64, seconds: f64) -> usize {
        clock.restart(0.0);
        let wakes = (seconds * 1000.0 / every_ms).round() as usize;
        (1..=wakes).map(|i| clock.due(i as f64 * every_ms)).sum()
    }

    #[test]
    fn it_ticks_at_30_hz_however_often_it_is_asked() {
        for every_ms in [1.0, 7.0, 33.3, 50.0, 125.0] {
            let mut clock = Clock::new();
            let ticks = run(&mut clock, every_ms, 10.0);
            assert!((299..=301).contains(&ticks), "every {every_ms} ms: {ticks} of 300");
            let rate = clock.measured().unwrap();
            assert!((rate - 1.0).abs() < 0.06, "every {every_ms} ms: {rate}");
        }
    }

    #[test]
    fn the_factor_scales_time() {
        for factor in [0.25, 2.0] {
            let mut clock = Clock { factor, ..Clock::new() };
            let (ticks, wanted) = (run(&mut clock, 10.0, 10.0), 300.0 * factor);
            assert!((ticks as f64 - wanted).abs() <= 1.0, "{ticks} of {wanted}");
        }
    }

    #[test]
    fn a_slow_machine_runs_slower_and_says_so() {
        // Four ticks at most every 200 ms: two thirds of real time.
        let mut clock = Clock::new();
        run(&mut clock, 200.0, 10.0);
        let rate = clock.measured().unwrap();
        assert!((rate - 2.0 / 3.0).abs() < 0.02, "{rate}");
        // Afterwards it does not race to catch up.
        let late: usize = (1..=10).map(|i| clock.due(10_000.0 + i as f64)).sum();
        assert!(late <= 8, "{late} ticks");
    }

    #[test]
    fn a_paused_clock_owes_nothing() {
        let mut clock = Clock { is_running: false, ..Clock::new() };
        assert_eq!(run(&mut clock, 10.0, 5.0), 0);
        clock.is_running = true;
        assert_eq!(clock.due(5_001.0), 0);
    }
}
