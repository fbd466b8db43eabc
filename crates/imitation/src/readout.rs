//! What a linear read-out of z tells of an object's pose: the measure that an encoder has to pass.

use crate::autoencoder::pose_in_front;
use crate::encoder::TrainedEncoder;
use crate::spread::Spread;
use anyhow::{Context, Result};
use geometry::object::Object;
use geometry::symmetry;
use grasps::{Robot, place};
use nalgebra::{DMatrix, DVector};
use policy::LATENT;
use rand_chacha::ChaCha8Rng;
use scene::cloud::Eye;

/// Errors of the read-out on views that it was not fitted to.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Readout {
    /// Of the position on the table (m): median, 9 of 10.
    pub position: [f64; 2],
    /// Of the yaw (rad), as far as the shape tells it: median, 9 of 10; `None` of what is round.
    pub yaw: Option<[f64; 2]>,
}

/// Fits a read-out of the pose in front to half of the views of an object, and tries it on the other half.
pub fn readout(
    encoder: &TrainedEncoder,
    robot: &Robot,
    object: &Object,
    views: usize,
    rng: &mut ChaCha8Rng,
) -> Result<Readout> {
    let eye = Eye::new(&robot.config, &robot.tree);
    let (mut clouds, mut poses) = (Vec::new(), Vec::new());
    for _ in 0..views {
        let [x, y, yaw] = place::random_pose(robot, rng);
        let frame = eye.frame(&object.mesh, &robot.config.upright(x, y, yaw), rng);
        clouds.push(eye.cloud(&frame).iter().flat_map(|p| p.to_array()).collect::<Vec<f32>>());
        poses.push([x, y, yaw]);
    }
    let encodings = encoder.encode(&clouds)?;
    let order = symmetry::order(object);
    let rows: Vec<(Vec<f32>, [f32; 3])> = encodings
        .into_iter()
        .zip(poses)
        .map(|(seen, pose)| (seen.z, pose_in_front(pose, seen.bearing)))
        .collect();
    fitted(&rows, order).context("the views of an object do not suffice for a read-out")
}

/// Fits x, y, and cosine and sine of as many times the yaw as the object looks the same.
fn fitted(rows: &[(Vec<f32>, [f32; 3])], order: usize) -> Option<Readout> {
    let (fit, test) = rows.split_at(rows.len() / 2);
    let inputs = |rows: &[(Vec<f32>, [f32; 3])]| {
        DMatrix::from_fn(rows.len(), LATENT + 1, |i, k| {
            if k < LATENT { f64::from(rows[i].0[k]) } else { 1.0 }
        })
    };
    let times = order as f64;
    let targets = DMatrix::from_fn(fit.len(), 4, |i, k| {
        let [x, y, yaw] = fit[i].1.map(f64::from);
        [x, y, libm::cos(times * yaw), libm::sin(times * yaw)][k]
    });
    let a = inputs(fit);
    let normal = a.transpose() * &a + DMatrix::identity(LATENT + 1, LATENT + 1) * 1e-6;
    let weights = normal.cholesky()?.solve(&(a.transpose() * targets));
    let told = inputs(test) * weights;
    let quantiles = |of: &dyn Fn(usize, &[f32; 3]) -> f64| {
        let errors = test.iter().enumerate().map(|(i, (_, pose))| of(i, pose)).collect();
        Spread::of(errors).map(|Spread { median, p90 }| [median, p90])
    };
    let position = quantiles(&|i, pose| {
        let off = DVector::from_fn(2, |k, _| told[(i, k)] - f64::from(pose[k]));
        off.norm()
    })?;
    let yaw = quantiles(&|i, pose| {
        let found = libm::atan2(told[(i, 3)], told[(i, 2)]);
        let turn = std::f64::consts::TAU;
        let off = (found - times * f64::from(pose[2])).rem_euclid(turn);
        off.min(turn - off) / times
    })?;
    Some(Readout { position, yaw: (order < symmetry::ROUND).then_some(yaw) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_z_holds_linearly_is_read_and_what_it_lacks_is_not() {
        let rows: Vec<(Vec<f32>, [f32; 3])> = (0..200)
            .map(|k| {
                let wave = |seed: usize| libm::sinf((seed * k + k * k % 7) as f32);
                let pose = [0.6 + 0.1 * wave(3), 0.05 * wave(5), 3.0 * wave(11)];
                let mut z: Vec<f32> = (0..LATENT).map(|i| 0.01 * wave(i + 13)).collect();
                z[2] = 2.0 * pose[0] - 1.0;
                z[5] = pose[1] - pose[0];
                z[7] = libm::cosf(2.0 * pose[2]);
                (z, pose)
            })
            .collect();
        let found = fitted(&rows, 2).unwrap();
        assert!(found.position[1] < 1e-4, "{found:?}");
        // The sine is missing: half of the yaws are guessed wrong.
        assert!(found.yaw.unwrap()[1] > 0.2, "{found:?}");
        let whole: Vec<_> = rows
            .iter()
            .map(|(z, pose)| {
                let mut z = z.clone();
                z[9] = libm::sinf(2.0 * pose[2]);
                (z, *pose)
            })
            .collect();
        assert!(fitted(&whole, 2).unwrap().yaw.unwrap()[1] < 1e-3);
        assert_eq!(fitted(&whole, symmetry::ROUND).unwrap().yaw, None);
    }
}
