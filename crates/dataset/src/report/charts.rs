//! Success over the table, fans of trajectories, reasons of failure.

use crate::report::canvas::Canvas;
use crate::report::{INK, LINE, QUIET};
use geometry::Vec3;
use std::collections::BTreeMap;

/// A pose of an object, and the share of wanted demonstrations that were kept there.
pub(crate) struct Spot {
    pub(crate) pose: [f32; 3],
    pub(crate) share: f32,
    pub(crate) grasp: Option<usize>,
}

/// Least and greatest value of an axis (m).
type Range = [f32; 2];

/// A picture of a part of a plane: `to` maps metres to pixels, `size` is that of the picture.
struct Plot {
    x: Range,
    y: Range,
    scale: f32,
}

/// Pixels around a plot.
const MARGIN: f32 = 34.0;

impl Plot {
    fn size(&self) -> [f32; 2] {
        [self.x, self.y].map(|[min, max]| 2.0 * MARGIN + self.scale * (max - min))
    }

    /// To the right and up.
    fn to(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        [MARGIN + self.scale * (x - self.x[0]), MARGIN + self.scale * (self.y[1] - y)]
    }

    /// A frame with figures every `step` metres.
    fn canvas(&self, step: f32, names: [&str; 2]) -> Canvas {
        let [width, height] = self.size();
        let mut canvas = Canvas::new(width, height);
        let steps = |[min, max]: Range| {
            let first = libm::ceilf(min / step - 1e-3) as i32;
            let last = libm::floorf(max / step + 1e-3) as i32;
            (first..=last).map(move |i| i as f32 * step)
        };
        for x in steps(self.x) {
            canvas.path(&[self.to([x, self.y[0]]), self.to([x, self.y[1]])], LINE, 0.6);
            let [at, _] = self.to([x, 0.0]);
            canvas.text([at - 8.0, height - 18.0], 9.0, QUIET, &format!("{x:.2}"));
        }
        for y in steps(self.y) {
            canvas.path(&[self.to([self.x[0], y]), self.to([self.x[1], y])], LINE, 0.6);
            let [_, at] = self.to([0.0, y]);
            canvas.text([4.0, at + 3.0], 9.0, QUIET, &format!("{y:.2}"));
        }
        canvas.text([width - 46.0, height - 4.0], 10.0, INK, names[0]);
        canvas.text([6.0, 14.0], 10.0, INK, names[1]);
        canvas
    }
}

/// Colours of grasps, in their order; the rest is grey.
const GRASPS: [&str; 8] =
    ["#1f77b4", "#ff7f0e", "#2ca02c", "#9467bd", "#8c564b", "#e377c2", "#17becf", "#bcbd22"];

/// Where an object stood, seen from above: as large as the share kept, coloured by grasp, its yaw as a line.
pub(crate) fn table(spots: &[Spot], [x, y]: [Range; 2]) -> String {
    let wide = |[min, max]: Range| [min - 0.05, max + 0.05];
    let plot = Plot { x: wide(x), y: wide(y), scale: 720.0 };
    let mut canvas = plot.canvas(0.1, ["x (m)", "y (m)"]);
    for Spot { pose: [x, y, yaw], share, grasp } in spots {
        let at = plot.to([*x, *y]);
        let tip = plot.to([x + 0.016 * libm::cosf(*yaw), y + 0.016 * libm::sinf(*yaw)]);
        let color = match grasp {
            Some(grasp) => GRASPS.get(*grasp).copied().unwrap_or("#7f7f7f"),
            None => "#d62728",
        };
        canvas.path(&[at, tip], color, 1.6);
        canvas.circle(at, 2.0 + 4.0 * share, color);
    }
    canvas.svg("Where the object stood and which grasp served it; red: none")
}

/// Paths of the palm seen from the side and from above.
pub(crate) fn fan(paths: &[Vec<Vec3>], touch: &[Vec3]) -> String {
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
            path.iter().map(|p| plot.to(of(p))).collect()
        };
        left.path(&drawn(&side, &|p| [p.x, p.z]), "#1f77b488", 0.8);
        right.path(&drawn(&above, &|p| [p.x, p.y]), "#1f77b488", 0.8);
    }
    for p in touch {
        left.circle(side.to([p.x, p.z]), 2.5, "#d62728");
        right.circle(above.to([p.x, p.y]), 2.5, "#d62728");
    }
    let ([a, b], [c, d]) = (side.size(), above.size());
    let mut both = Canvas::new(a + c, b.max(d));
    both.place([0.0, 0.0], &left);
    both.place([a, 0.0], &right);
    both.svg("Paths of the palm into the grasp; red: where the fingers touch")
}

/// Attempts by what became of them.
pub(crate) fn fates(counts: &BTreeMap<String, usize>) -> String {
    let total = counts.values().sum::<usize>().max(1) as f32;
    let mut canvas = Canvas::new(460.0, 22.0 * counts.len() as f32 + 8.0);
    for (i, (name, count)) in counts.iter().enumerate() {
        let y = 22.0 * i as f32 + 6.0;
        let color = if name == "kept" { "#2ca02c" } else { "#d62728" };
        let share = *count as f32 / total;
        canvas.text([0.0, y + 12.0], 12.0, INK, name);
        canvas.rectangle([90.0, y], [240.0 * share + 1.0, 15.0], color);
        let figures = format!("{count} ({:.1} %)", 100.0 * share);
        canvas.text([336.0, y + 12.0], 11.0, QUIET, &figures);
    }
    canvas.svg("Attempts at a demonstration by what became of them")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_maps_its_corners_to_its_margins() {
        let plot = Plot { x: [0.4, 0.8], y: [-0.25, 0.25], scale: 100.0 };
        assert_eq!(plot.to([0.4, 0.25]), [MARGIN, MARGIN]);
        let [width, height] = plot.size();
        let [x, y] = plot.to([0.8, -0.25]);
        assert!((x - (width - MARGIN)).abs() < 1e-3 && (y - (height - MARGIN)).abs() < 1e-3);
    }

    #[test]
    fn nothing_is_drawn_of_nothing() {
        assert!(fan(&[], &[]).starts_with("<svg"));
        assert_eq!(table(&[], [[0.4, 0.8], [-0.2, 0.2]]).matches("<circle").count(), 0);
        assert_eq!(fates(&BTreeMap::from([("kept".into(), 3)])).matches("<rect").count(), 1);
    }
}
