//! Plots of attempt telemetry from start to lift: kinetic energy, damping and joint limit margin over time.

use files::svg::Canvas;
use rollout::TelemetrySample;
use scene::config::CONTROL_DT;

/// Whether an attempt lifted, and its telemetry samples, one per control tick.
pub type AttemptTelemetry = (bool, Vec<TelemetrySample>);

const INK: &str = "#222222";
const GRAY: &str = "#666666";
const GRID: &str = "#dddddd";
const LIFTED: &str = "#1f77b4";
const FAILED: &str = "#d62728";
const WIDTH: f32 = 460.0;
const HEIGHT: f32 = 130.0;
const LEFT: f32 = 50.0;
const TOP: f32 = 26.0;

/// A plotted quantity: axis label, and its value at a telemetry sample (`None`: not available).
type Quantity = (&'static str, fn(&TelemetrySample) -> Option<f64>);

const QUANTITIES: [Quantity; 3] = [
    ("energy ½ q̇ᵀq̇ (rad²/s²)", |sample| Some(sample.energy)),
    ("max. damping rate λmax(B) + β (1/s), unstable from 60", |sample| sample.damping),
    ("distance to the nearest joint limit (rad)", |sample| Some(sample.limit_margin)),
];

/// Max. number of plotted attempts; more lines are not distinguishable.
const MAX_LINES: usize = 40;

/// SVG with stacked plots, one line per attempt; omits quantities that no attempt has.
pub fn telemetry_plots(title: &str, attempts: &[AttemptTelemetry]) -> String {
    let attempts = &attempts[..attempts.len().min(MAX_LINES)];
    let ticks = attempts.iter().map(|(_, samples)| samples.len()).max().unwrap_or(0).max(2) - 1;
    let plots: Vec<Canvas> =
        QUANTITIES.iter().filter_map(|quantity| plot(quantity, attempts, ticks)).collect();
    let mut canvas = Canvas::new(LEFT + WIDTH + 20.0, (HEIGHT + TOP + 24.0) * plots.len() as f32);
    for (i, plot) in plots.iter().enumerate() {
        canvas.embed([0.0, (HEIGHT + TOP + 24.0) * i as f32], plot);
    }
    canvas.svg(title)
}

fn plot((name, value): &Quantity, attempts: &[AttemptTelemetry], ticks: usize) -> Option<Canvas> {
    let all = || attempts.iter().flat_map(|(_, samples)| samples.iter().filter_map(value));
    let max = all().reduce(f64::max)?;
    let [low, high] = [all().fold(0.0, f64::min), max.max(1e-9)];
    let x = |tick: usize| LEFT + WIDTH * tick as f32 / ticks as f32;
    let y = |value: f64| TOP + HEIGHT * (1.0 - ((value - low) / (high - low)) as f32);
    let mut canvas = Canvas::new(LEFT + WIDTH, TOP + HEIGHT);
    canvas.text([LEFT, TOP - 9.0], 12.0, INK, name);
    for at in [low, high] {
        canvas.polyline(&[[LEFT, y(at)], [LEFT + WIDTH, y(at)]], GRID, 0.8);
        canvas.text([4.0, y(at) + 4.0], 11.0, GRAY, &format!("{at:.1}"));
    }
    let seconds = ticks as f64 * CONTROL_DT;
    canvas.text([x(ticks) - 22.0, y(low) + 14.0], 11.0, GRAY, &format!("{seconds:.1} s"));
    // Failures are drawn on top.
    for lifted in [true, false] {
        for (_, samples) in attempts.iter().filter(|(is_lifted, _)| *is_lifted == lifted) {
            let point =
                |(tick, sample): (usize, &TelemetrySample)| Some([x(tick), y(value(sample)?)]);
            let points: Vec<[f32; 2]> = samples.iter().enumerate().filter_map(point).collect();
            canvas.polyline(&points, if lifted { LIFTED } else { FAILED }, 0.5);
        }
    }
    Some(canvas)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plots_have_one_line_per_attempt_and_omit_missing_quantities() {
        let sample =
            |energy| TelemetrySample { energy, limit_margin: 0.5, damping: None, terms: None };
        let attempts = [
            (true, vec![sample(0.0), sample(2.0), sample(1.0)]),
            (false, vec![sample(0.0), sample(1.0)]),
            (false, Vec::new()),
        ];
        let svg = telemetry_plots("test", &attempts);
        assert!(svg.contains("energy") && svg.contains("joint limit") && !svg.contains("damping"));
        for (color, lines) in [(LIFTED, 2), (FAILED, 4)] {
            assert_eq!(svg.matches(color).count(), lines, "{color}");
        }
        // The energy maximum is at the top edge, at half the duration.
        assert!(svg.contains(&format!("{:.1},{TOP:.1}", LEFT + 0.5 * WIDTH)), "{svg}");
        assert!(telemetry_plots("empty", &[]).starts_with("<svg"));
    }
}
