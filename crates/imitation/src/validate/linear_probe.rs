//! Linear probe: predicts the object pose from z by a linear map, as a quality measure of the encoder.

use crate::models::encoder::TrainedEncoder;
use crate::train::autoencoder::canonical_pose;
use anyhow::{Context, Result};
use evaluation::percentiles::MedianP90;
use grasps::RobotContext;
use grasps::plan::object_poses;
use nalgebra::{DMatrix, DVector};
use objects::object::Object;
use objects::symmetry;
use policy::LATENT_DIM;
use rand_chacha::ChaCha8Rng;
use scene::depth_sensor::DepthSensor;

/// Errors of the linear probe on held-out views.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ProbeErrors {
    /// Position error on the table (m): median and 90th percentile.
    pub position: [f64; 2],
    /// Yaw error (rad), modulo the object's symmetry: median and 90th percentile; `None` for round objects.
    pub yaw: Option<[f64; 2]>,
}

/// Max. number of frames per view.
const MAX_LOOKS: usize = 4;

/// Renders `views` random views of an object, fits a linear probe of the pose (canonical frame) on half of
/// them, and evaluates it on the other half.
pub fn linear_probe(
    encoder: &TrainedEncoder,
    robot: &RobotContext,
    object: &Object,
    views: usize,
    rng: &mut ChaCha8Rng,
) -> Result<ProbeErrors> {
    let sensor = DepthSensor::new(&robot.config, &robot.tree);
    let (mut clouds, mut poses) = (Vec::new(), Vec::new());
    // The sensor does not see a thin object everywhere.
    for _ in 0..MAX_LOOKS * views {
        if clouds.len() == views {
            break;
        }
        let [x, y, yaw] = object_poses::sample_planar_pose(robot, rng);
        let frame = sensor.capture(&object.mesh, &robot.config.object_pose(x, y, yaw), rng);
        let cloud = sensor.extract_cloud(&frame);
        if !cloud.is_empty() {
            clouds.push(cloud.iter().flat_map(|p| p.to_array()).collect::<Vec<f32>>());
            poses.push([x, y, yaw]);
        }
    }
    let encodings = encoder.encode(&clouds)?;
    let order = symmetry::symmetry_order(object);
    let rows: Vec<(Vec<f32>, [f32; 3])> = encodings
        .into_iter()
        .zip(poses)
        .map(|(observation, pose)| (observation.latent, canonical_pose(pose, observation.azimuth)))
        .collect();
    fit(&rows, order).context("too few views for the linear probe; use more views")
}

/// Fits x, y, and cosine and sine of `order` times the yaw, `order` being the rotational symmetry of the
/// object.
fn fit(rows: &[(Vec<f32>, [f32; 3])], order: usize) -> Option<ProbeErrors> {
    let (fit, test) = rows.split_at(rows.len() / 2);
    let inputs = |rows: &[(Vec<f32>, [f32; 3])]| {
        DMatrix::from_fn(rows.len(), LATENT_DIM + 1, |i, k| {
            if k < LATENT_DIM { f64::from(rows[i].0[k]) } else { 1.0 }
        })
    };
    let times = order as f64;
    let targets = DMatrix::from_fn(fit.len(), 4, |i, k| {
        let [x, y, yaw] = fit[i].1.map(f64::from);
        [x, y, libm::cos(times * yaw), libm::sin(times * yaw)][k]
    });
    let a = inputs(fit);
    let normal = a.transpose() * &a + DMatrix::identity(LATENT_DIM + 1, LATENT_DIM + 1) * 1e-6;
    let weights = normal.cholesky()?.solve(&(a.transpose() * targets));
    let predicted = inputs(test) * weights;
    let quantiles = |of: &dyn Fn(usize, &[f32; 3]) -> f64| {
        let errors = test.iter().enumerate().map(|(i, (_, pose))| of(i, pose)).collect();
        MedianP90::of(errors).map(|MedianP90 { median, p90 }| [median, p90])
    };
    let position = quantiles(&|i, pose| {
        let error = DVector::from_fn(2, |k, _| predicted[(i, k)] - f64::from(pose[k]));
        error.norm()
    })?;
    let yaw = quantiles(&|i, pose| {
        let angle = libm::atan2(predicted[(i, 3)], predicted[(i, 2)]);
        let turn = std::f64::consts::TAU;
        let error = (angle - times * f64::from(pose[2])).rem_euclid(turn);
        error.min(turn - error) / times
    })?;
    Some(ProbeErrors { position, yaw: (order < symmetry::MAX_ORDER).then_some(yaw) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_probe_recovers_only_linearly_encoded_pose() {
        let rows: Vec<(Vec<f32>, [f32; 3])> = (0..200)
            .map(|k| {
                let wave = |seed: usize| libm::sinf((seed * k + k * k % 7) as f32);
                let pose = [0.6 + 0.1 * wave(3), 0.05 * wave(5), 3.0 * wave(11)];
                let mut z: Vec<f32> = (0..LATENT_DIM).map(|i| 0.01 * wave(i + 13)).collect();
                z[2] = 2.0 * pose[0] - 1.0;
                z[5] = pose[1] - pose[0];
                z[7] = libm::cosf(2.0 * pose[2]);
                (z, pose)
            })
            .collect();
        let found = fit(&rows, 2).unwrap();
        assert!(found.position[1] < 1e-4, "{found:?}");
        // Without the sine, half of the yaw predictions are wrong.
        assert!(found.yaw.unwrap()[1] > 0.2, "{found:?}");
        let complete: Vec<_> = rows
            .iter()
            .map(|(z, pose)| {
                let mut z = z.clone();
                z[9] = libm::sinf(2.0 * pose[2]);
                (z, *pose)
            })
            .collect();
        assert!(fit(&complete, 2).unwrap().yaw.unwrap()[1] < 1e-3);
        assert_eq!(fit(&complete, symmetry::MAX_ORDER).unwrap().yaw, None);
    }
}
