//! What a policy did between start and lift, attempt by attempt, as a figure: energy, damping, distance from the limits.

use dataset::report::canvas::Canvas;
use rollout::Moment;
use scene::config::CONTROL_PERIOD;

/// An attempt's course, and whether it lifted.
pub type Course = (bool, Vec<Moment>);

const INK: &str = "#222222";
const QUIET: &str = "#666666";
const LINE: &str = "#dddddd";
const LIFTED: &str = "#1f77b4";
const FAILED: &str = "#d62728";
const WIDTH: f32 = 460.0;
const HEIGHT: f32 = 130.0;
const LEFT: f32 = 50.0;
const TOP: f32 = 26.0;

/// What is plotted over the time: its name, and its value at a moment.
type Quantity = (&'static str, fn(&Moment) -> Option<f64>);

const QUANTITIES: [Quantity; 3] = [
    ("energy ½ q̇ᵀq̇ (rad²/s²)", |moment| Some(moment.energy)),
    ("greatest damping λmax(B) + β (1/s); unstable from 60 on", |moment| moment.damping),
    ("distance from the nearest joint limit (rad)", |moment| Some(moment.margin)),
];

/// Attempts that are drawn at most: more lines are one blot.
const SHOWN: usize = 40;

/// One plot below the other, a line for each of the first attempts; what nobody has is left out.
pub fn courses(title: &str, courses: &[Course]) -> String {
    let courses = &courses[..courses.len().min(SHOWN)];
    let ticks = courses.iter().map(|(_, moments)| moments.len()).max().unwrap_or(0).max(2) - 1;
    let plots: Vec<Canvas> =
        QUANTITIES.iter().filter_map(|quantity| plot(quantity, courses, ticks)).collect();
    let mut canvas = Canvas::new(LEFT + WIDTH + 20.0, (HEIGHT + TOP + 24.0) * plots.len() as f32);
    for (i, plot) in plots.iter().enumerate() {
        canvas.place([0.0, (HEIGHT + TOP + 24.0) * i as f32], plot);
    }
    canvas.svg(title)
}

fn plot((name, value): &Quantity, courses: &[Course], ticks: usize) -> Option<Canvas> {
    let all = || courses.iter().flat_map(|(_, moments)| moments.iter().filter_map(value));
    let most = all().reduce(f64::max)?;
    let [low, high] = [all().fold(0.0, f64::min), most.max(1e-9)];
    let x = |tick: usize| LEFT + WIDTH * tick as f32 / ticks as f32;
    let y = |value: f64| TOP + HEIGHT * (1.0 - ((value - low) / (high - low)) as f32);
    let mut canvas = Canvas::new(LEFT + WIDTH, TOP + HEIGHT);
    canvas.text([LEFT, TOP - 9.0], 12.0, INK, name);
    for at in [low, high] {
        canvas.path(&[[LEFT, y(at)], [LEFT + WIDTH, y(at)]], LINE, 0.8);
        canvas.text([4.0, y(at) + 4.0], 11.0, QUIET, &format!("{at:.1}"));
    }
    let seconds = ticks as f64 * CONTROL_PERIOD;
    canvas.text([x(ticks) - 22.0, y(low) + 14.0], 11.0, QUIET, &format!("{seconds:.1} s"));
    // Failures over the others.
    for lifted in [true, false] {
        for (_, moments) in courses.iter().filter(|(is_lifted, _)| *is_lifted == lifted) {
            let point = |(tick, moment): (usize, &Moment)| Some([x(tick), y(value(moment)?)]);
            let points: Vec<[f32; 2]> = moments.iter().enumerate().filter_map(point).collect();
            canvas.path(&points, if lifted { LIFTED } else { FAILED }, 0.5);
        }
    }
    Some(canvas)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_a_line_for_each_attempt_and_no_plot_of_what_nobody_has() {
        let moment = |energy| Moment { energy, margin: 0.5, damping: None, terms: None };
        let attempts = [
            (true, vec![moment(0.0), moment(2.0), moment(1.0)]),
            (false, vec![moment(0.0), moment(1.0)]),
            (false, Vec::new()),
        ];
        let svg = courses("test", &attempts);
        assert!(svg.contains("energy") && svg.contains("joint limit") && !svg.contains("damping"));
        for (color, lines) in [(LIFTED, 2), (FAILED, 4)] {
            assert_eq!(svg.matches(color).count(), lines, "{color}");
        }
        // The greatest energy is drawn at the top, half-way through.
        assert!(svg.contains(&format!("{:.1},{TOP:.1}", LEFT + 0.5 * WIDTH)), "{svg}");
        assert!(courses("empty", &[]).starts_with("<svg"));
    }
}
