//! A suite as the figure that the paper shows: bars with intervals, object by object.

use super::Suite;
use dataset::report::canvas::Canvas;

const INK: &str = "#222222";
const QUIET: &str = "#666666";
const LINE: &str = "#dddddd";
/// Bars of policies in their order; controls are grey.
const COLORS: [&str; 6] = ["#1f77b4", "#aec7e8", "#ff7f0e", "#ffbb78", "#2ca02c", "#9467bd"];
const BAR: f32 = 22.0;
const GAP: f32 = 34.0;
const HEIGHT: f32 = 240.0;
const TOP: f32 = 28.0;
const LEFT: f32 = 44.0;

/// Bars of success for each object, with Wilson's intervals; the first `policies` in colour, controls after them. Numbers
/// lead from bars to names.
pub fn figure(suite: &Suite, policies: usize) -> String {
    let (who, objects) = (suite.policies(), suite.objects());
    let group = who.len() as f32 * BAR + GAP;
    let width = LEFT + objects.len() as f32 * group;
    let legend = 18.0 * who.len() as f32;
    let mut canvas = Canvas::new(width.max(360.0), TOP + HEIGHT + 54.0 + legend);
    let y = |share: f64| TOP + HEIGHT * (1.0 - share as f32);
    for percent in [0, 25, 50, 75, 100] {
        let at = y(f64::from(percent) / 100.0);
        canvas.path(&[[LEFT - 4.0, at], [width, at]], LINE, 0.8);
        canvas.text([4.0, at + 4.0], 11.0, QUIET, &format!("{percent} %"));
    }
    let color = |i: usize| if i < policies { COLORS[i % COLORS.len()] } else { "#b0b0b0" };
    for (k, object) in objects.iter().enumerate() {
        let left = LEFT + k as f32 * group;
        canvas.text([left, TOP + HEIGHT + 32.0], 12.0, INK, &object.replace('_', " "));
        for (i, policy) in who.iter().enumerate() {
            let Some(report) = suite.report(policy, object) else { continue };
            let share = report.lifted as f64 / report.attempts.max(1) as f64;
            let x = left + i as f32 * BAR;
            canvas.rectangle([x, y(share)], [BAR - 4.0, y(0.0) - y(share)], color(i));
            let number = (i + 1).to_string();
            canvas.text(
                [x + 6.0 - 2.5 * (number.len() - 1) as f32, y(0.0) + 13.0],
                10.0,
                QUIET,
                &number,
            );
            let middle = x + 0.5 * (BAR - 4.0);
            let [low, high] = report.wilson95;
            canvas.path(&[[middle, y(low)], [middle, y(high)]], INK, 1.2);
        }
    }
    for (i, policy) in who.iter().enumerate() {
        let at = TOP + HEIGHT + 48.0 + 18.0 * i as f32;
        canvas.rectangle([LEFT, at], [12.0, 12.0], color(i));
        canvas.text([LEFT + 18.0, at + 10.0], 12.0, INK, &format!("{} {policy}", i + 1));
    }
    canvas.svg("Attempts that lifted, with 95 % intervals")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::samples::report;

    #[test]
    fn a_bar_is_as_high_as_the_share_and_the_interval_goes_through_its_top() {
        let reports = vec![report("ngf-pcd", "box", &[true, true, true, false])];
        let svg = figure(&Suite { reports }, 1);
        let bar = format!("height=\"{:.1}\"", 0.75 * HEIGHT);
        assert!(svg.contains(&bar) && svg.contains(COLORS[0]), "{svg}");
        assert!(svg.contains("1 ngf-pcd") && svg.contains("75 %"));
    }
}
