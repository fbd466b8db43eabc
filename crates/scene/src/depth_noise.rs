//! Noise model of a stereo depth sensor: lateral shift, quantised disparity, dropout and outliers.
//!
//! The model is the simulated Kinect of Barron and Malik, "Intrinsic scene properties from a single
//! RGB-D image" (2013): depth = base / round(base / depth + noise), sampled at a shifted pixel.
//! *Departure: their constant bias of half a disparity step is omitted.*

use crate::config::{CameraConfig, DepthNoise};
use crate::depth_camera::DepthImage;
use rand::{Rng, RngExt};

/// Applies the noise of `config` to a depth image.
pub fn apply(image: &DepthImage, config: &CameraConfig, rng: &mut impl Rng) -> DepthImage {
    let DepthNoise { dropout, outlier, shift_sigma, disparity_sigma, disparity_base } =
        config.noise;
    let [near, far] = config.range;
    let mut depth = Vec::with_capacity(image.depth.len());
    for row in 0..image.height {
        for column in 0..image.width {
            let (dx, dy) = normal_pair(rng);
            let (step_noise, _) = normal_pair(rng);
            let selector: f32 = rng.random();
            let random: f32 = rng.random();
            let x = shifted(column, dx * shift_sigma, image.width);
            let y = shifted(row, dy * shift_sigma, image.height);
            let true_depth = image.depth[y * image.width + x];
            let measured = if selector < dropout || true_depth <= 0.0 {
                0.0
            } else if selector < dropout + outlier {
                near + random * (far - near)
            } else {
                let disparity = disparity_base / true_depth + step_noise * disparity_sigma;
                disparity_base / libm::rintf(disparity).max(1.0)
            };
            depth.push(measured);
        }
    }
    DepthImage { depth, ..*image }
}

fn shifted(pixel: usize, by: f32, count: usize) -> usize {
    (libm::rintf(pixel as f32 + by).max(0.0) as usize).min(count - 1)
}

/// Two independent standard normal samples (Box and Muller).
pub fn normal_pair(rng: &mut impl Rng) -> (f32, f32) {
    // 1 - u is in (0, 1], so the logarithm is finite.
    let (u, v): (f32, f32) = (rng.random(), rng.random());
    let radius = libm::sqrtf(-2.0 * libm::logf(1.0 - u));
    let (sin, cos) = libm::sincosf(std::f32::consts::TAU * v);
    (radius * cos, radius * sin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SceneConfig;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn noisy_wall_stays_within_disparity_step() {
        let config = SceneConfig::standard().unwrap().camera;
        let wall = DepthImage { width: 160, height: 120, depth: vec![1.0; 160 * 120] };
        let noisy = apply(&wall, &config, &mut ChaCha8Rng::seed_from_u64(1));
        let lost = noisy.depth.iter().filter(|d| **d == 0.0).count() as f32 / 19200.0;
        assert!((lost - 0.003).abs() < 0.002, "fraction of lost pixels {lost}, wanted 0.003");
        let close = noisy.depth.iter().filter(|d| (**d - 1.0).abs() < 0.004).count();
        assert!(close as f32 > 0.98 * 19200.0, "{close} of 19200 pixels within 4 mm");
    }

    #[test]
    fn normal_pair_has_zero_mean_and_unit_variance() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let draws: Vec<f32> = (0..20_000).map(|_| normal_pair(&mut rng).0).collect();
        let mean = draws.iter().sum::<f32>() / 20_000.0;
        let variance = draws.iter().map(|x| x * x).sum::<f32>() / 20_000.0;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
    }
}
