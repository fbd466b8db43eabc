//! Charts of a dataset: success over the workspace, palm trajectories, outcomes.

use crate::report::{INK, LINE, MUTED};
use files::svg::Canvas;
use geometry::Vec3;
use std::collections::BTreeMap;

/// An object pose, the fraction of requested demonstrations kept there, and the grasp used.
pub(crate) struct PosePoint {
    pub(crate) pose: [f32; 3],
    pub(crate) kept_fraction: f32,
    pub(crate) grasp: Option<usize>,
}

/// Minimum and maximum of an axis (m).
type Range = [f32; 2];

/// Plot of a plane region; `scale` is in pixels per metre.
struct Plot {
    x: Range,
    y: Range,
    scale: f32,
}

/// Margin around a plot (pixels).
const MARGIN: f32 = 34.0;

impl Plot {
    fn size(&self) -> [f32; 2] {
        [self.x, self.y].map(|[min, max]| 2.0 * MARGIN + self.scale * (max - min))
    }

    /// Converts a point (m) to pixels; x points right, y points up.
    fn to_pixels(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        [MARGIN + self.scale * (x - self.x[0]), MARGIN + self.scale * (self.y[1] - y)]
    }

    /// Canvas with grid lines and labels every `step` metres.
    fn canvas(&self, step: f32, names: [&str; 2]) -> Canvas {
        let [width, height] = self.size();
        let mut canvas = Canvas::new(width, height);
        let steps = |[min, max]: Range| {
            let first = libm::ceilf(min / step - 1e-3) as i32;
            let last = libm::floorf(max / step + 1e-3) as i32;
            (first..=last).map(move |i| i as f32 * step)
        };
        for x in steps(self.x) {
            canvas.polyline(
                &[self.to_pixels([x, self.y[0]]), self.to_pixels([x, self.y[1]])],
                LINE,
                0.6,
            );
            let [at, _] = self.to_pixels([x, 0.0]);
            canvas.text([at - 8.0, height - 18.0], 9.0, MUTED, &format!("{x:.2}"));
        }
        for y in steps(self.y) {
            canvas.polyline(
                &[self.to_pixels([self.x[0], y]), self.to_pixels([self.x[1], y])],
                LINE,
                0.6,
            );
            let [_, at] = self.to_pixels([0.0, y]);
            canvas.text([4.0, at + 3.0], 9.0, MUTED, &format!("{y:.2}"));
        }
        canvas.text([width - 46.0, height - 4.0], 10.0, INK, names[0]);
        canvas.text([6.0, 14.0], 10.0, INK, names[1]);
        canvas
    }
}

/// Colors of the grasps by index; further grasps are gray.
const GRASP_COLORS: [&str; 8] =
    ["#1f77b4", "#ff7f0e", "#2ca02c", "#9467bd", "#8c564b", "#e377c2", "#17becf", "#bcbd22"];

/// Top view of the object poses. The dot size shows the kept fraction, the color the grasp, the line the yaw.
pub(crate) fn success_map(spots: &[PosePoint], [x, y]: [Range; 2]) -> String {
    let wide = |[min, max]: Range| [min - 0.05, max + 0.05];
    let plot = Plot { x: wide(x), y: wide(y), scale: 720.0 };
    let mut canvas = plot.canvas(0.1, ["x (m)", "y (m)"]);
    for PosePoint { pose: [x, y, yaw], kept_fraction: share, grasp } in spots {
        let at = plot.to_pixels([*x, *y]);
        let tip = plot.to_pixels([x + 0.016 * libm::cosf(*yaw), y + 0.016 * libm::sinf(*yaw)]);
        let color = match grasp {
            Some(grasp) => GRASP_COLORS.get(*grasp).copied().unwrap_or("#7f7f7f"),
            None => "#d62728",
        };
        canvas.polyline(&[at, tip], color, 1.6);
        canvas.circle(at, 2.0 + 4.0 * share, color);
    }
    canvas.svg("Object poses and the grasp used at each; red: no grasp")
}

/// Palm paths in side view and top view.
pub(crate) fn trajectory_plot(paths: &[Vec<Vec3>], touch: &[Vec3]) -> String {
    let range = |of: &dyn Fn(&Vec3) -> f32| {
        let values = || paths.iter().flatten().map(of);
        let (min, max) = (values().fold(f32::MAX, f32::min), values().fold(f32::MIN, f32::max));
        if min <= max { [min - 0.02, max + 0.02] } else { [0.0, 0.1] }
    };
    let (x, y, z) = (range(&|p| p.x), range(&|p| p.y), range(&|p| p.z));
    let side = Plot { x, y: z, scale: 1200.0 };
    let above = Plot { x, y, scale: 1200.0 };
    let mut left = side.canvas(0.05, ["x (m)", "z (m)"]);
    let mut right = above.canvas(0.05, ["x (m)", "y (m)"]);
    for path in paths {
        let drawn = |plot: &Plot, of: &dyn Fn(&Vec3) -> [f32; 2]| -> Vec<[f32; 2]> {
            path.iter().map(|p| plot.to_pixels(of(p))).collect()
        };
        left.polyline(&drawn(&side, &|p| [p.x, p.z]), "#1f77b488", 0.8);
        right.polyline(&drawn(&above, &|p| [p.x, p.y]), "#1f77b488", 0.8);
    }
    for p in touch {
        left.circle(side.to_pixels([p.x, p.z]), 2.5, "#d62728");
        right.circle(above.to_pixels([p.x, p.y]), 2.5, "#d62728");
    }
    let ([a, b], [c, d]) = (side.size(), above.size());
    let mut both = Canvas::new(a + c, b.max(d));
    both.embed([0.0, 0.0], &left);
    both.embed([a, 0.0], &right);
    both.svg("Palm paths into the grasp; red: contact")
}

/// Bar chart of the trials by outcome.
pub(crate) fn outcome_bars(counts: &BTreeMap<String, usize>) -> String {
    let total = counts.values().sum::<usize>().max(1) as f32;
    let mut canvas = Canvas::new(460.0, 22.0 * counts.len() as f32 + 8.0);
    for (i, (name, count)) in counts.iter().enumerate() {
        let y = 22.0 * i as f32 + 6.0;
        let color = if name == "kept" { "#2ca02c" } else { "#d62728" };
        let share = *count as f32 / total;
        canvas.text([0.0, y + 12.0], 12.0, INK, name);
        canvas.rectangle([90.0, y], [240.0 * share + 1.0, 15.0], color);
        let figures = format!("{count} ({:.1} %)", 100.0 * share);
        canvas.text([336.0, y + 12.0], 11.0, MUTED, &figures);
    }
    canvas.svg("Trials by outcome")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plot_maps_corners_to_margins() {
        let plot = Plot { x: [0.4, 0.8], y: [-0.25, 0.25], scale: 100.0 };
        assert_eq!(plot.to_pixels([0.4, 0.25]), [MARGIN, MARGIN]);
        let [width, height] = plot.size();
        let [x, y] = plot.to_pixels([0.8, -0.25]);
        assert!((x - (width - MARGIN)).abs() < 1e-3 && (y - (height - MARGIN)).abs() < 1e-3);
    }

    #[test]
    fn charts_are_empty_when_input_is_empty() {
        assert!(trajectory_plot(&[], &[]).starts_with("<svg"));
        assert_eq!(success_map(&[], [[0.4, 0.8], [-0.2, 0.2]]).matches("<circle").count(), 0);
        assert_eq!(outcome_bars(&BTreeMap::from([("kept".into(), 3)])).matches("<rect").count(), 1);
    }
}
