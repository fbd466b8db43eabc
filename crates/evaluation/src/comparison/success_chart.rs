//! Bar chart of success rates with confidence intervals, grouped by object, as in the paper.

use super::Comparison;
use files::svg::Canvas;

const INK: &str = "#222222";
const GRAY: &str = "#666666";
const GRID: &str = "#dddddd";
/// Bar colours of the policies, in order; controls are grey.
const COLORS: [&str; 6] = ["#1f77b4", "#aec7e8", "#ff7f0e", "#ffbb78", "#2ca02c", "#9467bd"];
const BAR_PITCH: f32 = 22.0;
const GROUP_GAP: f32 = 34.0;
const HEIGHT: f32 = 240.0;
const TOP: f32 = 28.0;
const LEFT: f32 = 44.0;

/// SVG with success rates per object and 95 % Wilson intervals. The first `policies` bars are coloured,
/// controls are grey; the numbers below the bars refer to the legend.
pub fn success_chart(suite: &Comparison, policies: usize) -> String {
    let (labels, objects) = (suite.policies(), suite.objects());
    let group = labels.len() as f32 * BAR_PITCH + GROUP_GAP;
    let width = LEFT + objects.len() as f32 * group;
    let legend = 18.0 * labels.len() as f32;
    let mut canvas = Canvas::new(width.max(360.0), TOP + HEIGHT + 54.0 + legend);
    let y = |rate: f64| TOP + HEIGHT * (1.0 - rate as f32);
    for percent in [0, 25, 50, 75, 100] {
        let at = y(f64::from(percent) / 100.0);
        canvas.polyline(&[[LEFT - 4.0, at], [width, at]], GRID, 0.8);
        canvas.text([4.0, at + 4.0], 11.0, GRAY, &format!("{percent} %"));
    }
    let color = |i: usize| if i < policies { COLORS[i % COLORS.len()] } else { "#b0b0b0" };
    for (k, object) in objects.iter().enumerate() {
        let left = LEFT + k as f32 * group;
        canvas.text([left, TOP + HEIGHT + 32.0], 12.0, INK, &object.replace('_', " "));
        for (i, policy) in labels.iter().enumerate() {
            let Some(report) = suite.report(policy, object) else { continue };
            let rate = report.lifted as f64 / report.attempts.max(1) as f64;
            let x = left + i as f32 * BAR_PITCH;
            canvas.rectangle([x, y(rate)], [BAR_PITCH - 4.0, y(0.0) - y(rate)], color(i));
            let number = (i + 1).to_string();
            canvas.text(
                [x + 6.0 - 2.5 * (number.len() - 1) as f32, y(0.0) + 13.0],
                10.0,
                GRAY,
                &number,
            );
            let center = x + 0.5 * (BAR_PITCH - 4.0);
            let [low, high] = report.wilson95;
            canvas.polyline(&[[center, y(low)], [center, y(high)]], INK, 1.2);
        }
    }
    for (i, policy) in labels.iter().enumerate() {
        let at = TOP + HEIGHT + 48.0 + 18.0 * i as f32;
        canvas.rectangle([LEFT, at], [12.0, 12.0], color(i));
        canvas.text([LEFT + 18.0, at + 10.0], 12.0, INK, &format!("{} {policy}", i + 1));
    }
    canvas.svg("Success rate, with 95 % confidence intervals")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::fixtures::report;

    #[test]
    fn bar_height_equals_success_rate() {
        let reports = vec![report("ngf-pcd", "box", &[true, true, true, false])];
        let svg = success_chart(&Comparison { reports }, 1);
        let bar = format!("height=\"{:.1}\"", 0.75 * HEIGHT);
        assert!(svg.contains(&bar) && svg.contains(COLORS[0]), "{svg}");
        assert!(svg.contains("1 ngf-pcd") && svg.contains("75 %"));
    }
}
