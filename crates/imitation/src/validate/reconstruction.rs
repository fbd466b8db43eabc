//! Figure of autoencoder reconstructions: input clouds in grey, reconstructions in colour.

use crate::models::encoder::TrainedEncoder;
use anyhow::Result;
use files::svg::Canvas;
use geometry::Vec3;
use grasps::RobotContext;
use grasps::plan::object_poses;
use objects::object::Object;
use rand_chacha::ChaCha8Rng;
use scene::depth_sensor::DepthSensor;

/// Panel size (pixels), and scale (pixels per metre).
const PANEL: f32 = 170.0;
const SCALE: f32 = 600.0;
/// Number of views per object.
const VIEWS: usize = 3;

const CLOUD: &str = "#9a9a9a";
const RECONSTRUCTION: &str = "#d9480f";
const INK: &str = "#222222";

/// SVG with one row per object: random views, each projected from the side and from above.
pub fn reconstruction_figure(
    encoder: &TrainedEncoder,
    robot: &RobotContext,
    objects: &[(&str, Object)],
    rng: &mut ChaCha8Rng,
) -> Result<String> {
    let sensor = DepthSensor::new(&robot.config, &robot.tree);
    let width = 2.0 * VIEWS as f32 * PANEL;
    let mut canvas = Canvas::new(width, objects.len() as f32 * (PANEL + 20.0));
    for (row, (name, object)) in objects.iter().enumerate() {
        let top = row as f32 * (PANEL + 20.0);
        canvas.text([6.0, top + 14.0], 13.0, INK, &name.replace('_', " "));
        for view in 0..VIEWS {
            let [x, y, yaw] = object_poses::sample_planar_pose(robot, rng);
            let frame = sensor.capture(&object.mesh, &robot.config.object_pose(x, y, yaw), rng);
            let (_, cloud) = policy::observation::canonicalize(&sensor.extract_cloud(&frame));
            // The panel stays empty where the sensor does not see a thin object.
            if cloud.is_empty() {
                continue;
            }
            let decoded = encoder.reconstruct(&cloud)?;
            let left = 2.0 * view as f32 * PANEL;
            canvas.embed([left, top + 20.0], &panel(&cloud, &decoded, |d| [d.x, d.z]));
            canvas.embed([left + PANEL, top + 20.0], &panel(&cloud, &decoded, |d| [d.x, d.y]));
        }
    }
    Ok(canvas.svg("Clouds (grey) and their reconstructions from z, from the side and from above"))
}

/// Both clouds, centred on the first one; `project` returns the coordinates right and up (m).
fn panel(cloud: &[Vec3], decoded: &[Vec3], project: impl Fn(Vec3) -> [f32; 2]) -> Canvas {
    let center = cloud.iter().sum::<Vec3>() / cloud.len().max(1) as f32;
    let mut panel = Canvas::new(PANEL, PANEL);
    for (points, color) in [(cloud, CLOUD), (decoded, RECONSTRUCTION)] {
        for point in points {
            let [right, up] = project(*point - center);
            let at = [0.5 * PANEL + SCALE * right, 0.5 * PANEL - SCALE * up];
            panel.circle(at, 1.1, color);
        }
    }
    panel
}
