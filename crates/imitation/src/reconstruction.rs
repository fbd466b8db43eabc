//! Pictures of what the autoencoder makes of clouds: the cloud in grey, what comes back in colour.

use crate::encoder::TrainedEncoder;
use anyhow::Result;
use dataset::report::canvas::Canvas;
use geometry::Vec3;
use geometry::object::Object;
use grasps::{Robot, place};
use rand_chacha::ChaCha8Rng;
use scene::cloud::Eye;

/// Pixels of a panel, and pixels for a metre.
const PANEL: f32 = 170.0;
const SCALE: f32 = 600.0;
/// Views of each object.
const VIEWS: usize = 3;

const CLOUD: &str = "#9a9a9a";
const MADE: &str = "#d9480f";
const INK: &str = "#222222";

/// For each object a row of views, each from the side and from above.
pub fn picture(
    encoder: &TrainedEncoder,
    robot: &Robot,
    objects: &[(&str, Object)],
    rng: &mut ChaCha8Rng,
) -> Result<String> {
    let eye = Eye::new(&robot.config, &robot.tree);
    let width = 2.0 * VIEWS as f32 * PANEL;
    let mut canvas = Canvas::new(width, objects.len() as f32 * (PANEL + 20.0));
    for (row, (name, object)) in objects.iter().enumerate() {
        let top = row as f32 * (PANEL + 20.0);
        canvas.text([6.0, top + 14.0], 13.0, INK, &name.replace('_', " "));
        for view in 0..VIEWS {
            let [x, y, yaw] = place::random_pose(robot, rng);
            let frame = eye.frame(&object.mesh, &robot.config.upright(x, y, yaw), rng);
            let (_, cloud) = policy::encoding::to_front(&eye.cloud(&frame));
            let made = encoder.reconstruct(&cloud)?;
            let left = 2.0 * view as f32 * PANEL;
            let place = [left, top + 20.0];
            canvas.place(place, &panel(&cloud, &made, |d| [d.x, d.z]));
            canvas.place([left + PANEL, top + 20.0], &panel(&cloud, &made, |d| [d.x, d.y]));
        }
    }
    Ok(canvas
        .svg("Clouds (grey) and what the decoder makes of their z, from the side and from above"))
}

/// Both clouds about the middle of the first one; `project` gives right and up (m).
fn panel(cloud: &[Vec3], made: &[Vec3], project: impl Fn(Vec3) -> [f32; 2]) -> Canvas {
    let middle = cloud.iter().sum::<Vec3>() / cloud.len().max(1) as f32;
    let mut panel = Canvas::new(PANEL, PANEL);
    for (points, color) in [(cloud, CLOUD), (made, MADE)] {
        for point in points {
            let [right, up] = project(*point - middle);
            let at = [0.5 * PANEL + SCALE * right, 0.5 * PANEL - SCALE * up];
            panel.circle(at, 1.1, color);
        }
    }
    panel
}
