//! Paces the simulation: fixed time step, limited backlog, measured real-time factor.
//!
//! In: wall-clock times (ms). Out: numbers of ticks. Timers are set by the caller.

/// Duration of a tick (s).
const TICK_S: f64 = scene::config::CONTROL_DT;
/// Max ticks per call, so that messages are handled between calls.
const MAX_TICKS_PER_CALL: usize = 4;
/// Max backlog (s of real time). Ticks beyond it are dropped: the simulation slows down instead of jumping.
const MAX_LAG_S: f64 = 0.25;
/// Averaging time of the measured real-time factor (ms).
const WINDOW_MS: f64 = 1000.0;

/// Clock of simulated time.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    /// Requested real-time factor (simulated seconds per second).
    pub(crate) speed: f64,
    /// Whether the simulation is running.
    pub(crate) is_running: bool,
    last_ms: f64,
    /// Simulated time that is due (s).
    backlog_s: f64,
    window: Window,
}

/// Ticks since the start of the current window, and the real-time factor of the previous one.
#[derive(Clone, Copy, Debug, Default)]
struct Window {
    start_ms: f64,
    ticks: usize,
    rate: Option<f64>,
}

impl Clock {
    pub(crate) fn new() -> Self {
        Self {
            speed: 1.0,
            is_running: true,
            last_ms: 0.0,
            backlog_s: 0.0,
            window: Window::default(),
        }
    }

    /// Clears the backlog and the measurement.
    pub(crate) fn restart(&mut self, now_ms: f64) {
        self.last_ms = now_ms;
        self.backlog_s = 0.0;
        self.window = Window { start_ms: now_ms, ..Window::default() };
    }

    /// Number of ticks to run now.
    pub(crate) fn ticks_due(&mut self, now_ms: f64) -> usize {
        let elapsed = (now_ms - self.last_ms).max(0.0) / 1000.0;
        self.last_ms = now_ms;
        if !self.is_running {
            return 0;
        }
        self.backlog_s =
            (self.backlog_s + elapsed * self.speed).min(MAX_LAG_S * self.speed.max(1.0));
        // The tolerance prevents rounding from losing a tick.
        let ticks = ((self.backlog_s / TICK_S + 1e-9) as usize).min(MAX_TICKS_PER_CALL);
        self.backlog_s -= ticks as f64 * TICK_S;
        self.measure(ticks, now_ms);
        ticks
    }

    /// Time until the next tick is due (ms).
    pub(crate) fn wait_ms(&self) -> f64 {
        ((TICK_S - self.backlog_s) / self.speed * 1000.0).max(0.0)
    }

    /// Real-time factor over the last complete window.
    pub(crate) fn realtime_factor(&self) -> Option<f64> {
        self.window.rate
    }

    fn measure(&mut self, ticks: usize, now_ms: f64) {
        let window = &mut self.window;
        window.ticks += ticks;
        let elapsed = now_ms - window.start_ms;
        if elapsed >= WINDOW_MS {
            let rate = window.ticks as f64 * TICK_S / (elapsed / 1000.0);
            *window = Window { start_ms: now_ms, ticks: 0, rate: Some(rate) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasm_bindgen_test::wasm_bindgen_test as test;

    /// Number of ticks in `seconds` of calls every `every_ms`.
    fn run(clock: &mut Clock, every_ms: f64, seconds: f64) -> usize {
        clock.restart(0.0);
        let calls = (seconds * 1000.0 / every_ms).round() as usize;
        (1..=calls).map(|i| clock.ticks_due(i as f64 * every_ms)).sum()
    }

    #[test]
    fn tick_rate_is_30_hz_at_any_call_interval() {
        for every_ms in [1.0, 7.0, 33.3, 50.0, 125.0] {
            let mut clock = Clock::new();
            let ticks = run(&mut clock, every_ms, 10.0);
            assert!((299..=301).contains(&ticks), "every {every_ms} ms: {ticks} of 300");
            let rate = clock.realtime_factor().unwrap();
            assert!((rate - 1.0).abs() < 0.06, "every {every_ms} ms: {rate}");
        }
    }

    #[test]
    fn speed_scales_tick_rate() {
        for factor in [0.25, 2.0] {
            let mut clock = Clock { speed: factor, ..Clock::new() };
            let (ticks, expected) = (run(&mut clock, 10.0, 10.0), 300.0 * factor);
            assert!((ticks as f64 - expected).abs() <= 1.0, "{ticks} of {expected}");
        }
    }

    #[test]
    fn realtime_factor_drops_when_calls_are_slow() {
        // Up to four ticks per 200 ms: two thirds of real time.
        let mut clock = Clock::new();
        run(&mut clock, 200.0, 10.0);
        let rate = clock.realtime_factor().unwrap();
        assert!((rate - 2.0 / 3.0).abs() < 0.02, "{rate}");
        // Afterwards the clock does not catch up.
        let late: usize = (1..=10).map(|i| clock.ticks_due(10_000.0 + i as f64)).sum();
        assert!(late <= 8, "{late} ticks");
    }

    #[test]
    fn paused_clock_accumulates_no_ticks() {
        let mut clock = Clock { is_running: false, ..Clock::new() };
        assert_eq!(run(&mut clock, 10.0, 5.0), 0);
        clock.is_running = true;
        assert_eq!(clock.ticks_due(5_001.0), 0);
    }
}
