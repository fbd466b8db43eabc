//! Random Fourier features: 500 cosines and 500 sines of random projections (paper §III-B).
//!
//! The frequencies are sampled from a seed and not stored, so they are the same on every machine.

use crate::simd;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Number of frequencies; each gives a cosine and a sine.
pub const NUM_FREQUENCIES: usize = 500;
/// Number of features; the cosines come first.
pub const NUM_FEATURES: usize = 2 * NUM_FREQUENCIES;

/// A block of inputs with a common length scale.
#[derive(Clone, Copy, Debug)]
pub struct InputBlock {
    /// Number of inputs in the block.
    pub size: usize,
    /// Distance in input space over which the features decorrelate.
    pub length_scale: f32,
}

/// The random projection of a network's inputs.
#[derive(Clone, Debug)]
pub struct FourierFeatures {
    /// Frequencies, shape (num_inputs, NUM_FREQUENCIES), row-major.
    pub frequencies: Vec<f32>,
    /// Number of inputs.
    pub num_inputs: usize,
}

impl FourierFeatures {
    /// Samples Gaussian frequencies with the blocks' length scales; the features approximate a Gaussian
    /// kernel.
    pub fn new(blocks: &[InputBlock], seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut frequencies = Vec::new();
        for block in blocks {
            for _ in 0..block.size * NUM_FREQUENCIES {
                frequencies.push(standard_normal(&mut rng) / block.length_scale);
            }
        }
        Self { frequencies, num_inputs: blocks.iter().map(|block| block.size).sum() }
    }

    /// Projections Wx of a batch, shape (batch, num_inputs), row-major; shape (batch, NUM_FREQUENCIES).
    pub fn project(&self, x: &[f32]) -> Vec<f32> {
        debug_assert_eq!(x.len() % self.num_inputs, 0);
        let mut phases = vec![0.0; x.len() / self.num_inputs * NUM_FREQUENCIES];
        simd::with_simd(
            #[inline(always)]
            || {
                for (i, row) in self.frequencies.chunks_exact(NUM_FREQUENCIES).enumerate() {
                    let batch = phases.chunks_exact_mut(NUM_FREQUENCIES);
                    for (phases, x) in batch.zip(x.chunks_exact(self.num_inputs)) {
                        let x = x[i];
                        for (phase, w) in phases.iter_mut().zip(row) {
                            *phase += x * w;
                        }
                    }
                }
            },
        );
        phases
    }

    /// Features (cos Wx, sin Wx) of a batch, shape (batch, num_inputs), row-major; shape (batch, NUM_FEATURES).
    ///
    /// ```rust
    /// use policy::networks::fourier::{FourierFeatures, InputBlock, NUM_FREQUENCIES};
    /// let fourier = FourierFeatures::new(&[InputBlock { size: 2, length_scale: 1.0 }], 7);
    /// let features = fourier.features(&[0.4, -0.2]);
    /// // A cosine and a sine of the same projection are on the unit circle.
    /// let (cosines, sines) = features.split_at(NUM_FREQUENCIES);
    /// assert!(cosines.iter().zip(sines).all(|(c, s)| (c * c + s * s - 1.0).abs() < 1e-5));
    /// ```
    pub fn features(&self, x: &[f32]) -> Vec<f32> {
        let phases = self.project(x);
        let mut features = vec![0.0; 2 * phases.len()];
        let rows = features.chunks_exact_mut(NUM_FEATURES);
        for (row, phases) in rows.zip(phases.chunks_exact(NUM_FREQUENCIES)) {
            let (cosines, sines) = row.split_at_mut(NUM_FREQUENCIES);
            for ((cosine, sine), phase) in cosines.iter_mut().zip(sines).zip(phases) {
                (*sine, *cosine) = sin_cos(*phase);
            }
        }
        features
    }

    /// Vector-Jacobian product: gradient with respect to the first `count` inputs, given `features` and the
    /// gradient with respect to them: Wᵀ(-sin ⊙ ḡ_cos + cos ⊙ ḡ_sin).
    pub fn vjp(&self, features: &[f32], gradient: &[f32], count: usize) -> Vec<f32> {
        let (cosines, sines) = features.split_at(NUM_FREQUENCIES);
        let (of_cosines, of_sines) = gradient.split_at(NUM_FREQUENCIES);
        let phases: Vec<f32> = (0..NUM_FREQUENCIES)
            .map(|k| cosines[k] * of_sines[k] - sines[k] * of_cosines[k])
            .collect();
        let rows = self.frequencies.chunks_exact(NUM_FREQUENCIES).take(count);
        rows.map(|row| simd::dot::<8>(row, &phases)).collect()
    }
}

/// Sine and cosine in single precision, without branches, so that compilers can vectorise it.
///
/// Reduction to [-π/4, π/4] with π/2 in three parts, then the minimax polynomials of Cephes
/// (S. Moshier); error below 2e-7 for |x| < 8000.
#[inline(always)]
pub fn sin_cos(x: f32) -> (f32, f32) {
    // Adding 1.5 x 2^23 rounds to an integer, as `rint` does, but inlines.
    const ROUND: f32 = 12_582_912.0;
    let quadrant = (x * std::f32::consts::FRAC_2_PI + ROUND) - ROUND;
    let r = ((x - quadrant * 1.570_312_5) - quadrant * 4.837_513e-4) - quadrant * 7.549_79e-8;
    let r2 = r * r;
    let sin = r + r * r2 * (-1.666_665_5e-1 + r2 * (8.332_161e-3 + r2 * -1.951_529_6e-4));
    let cos =
        1.0 - 0.5 * r2 + r2 * r2 * (4.166_664_6e-2 + r2 * (-1.388_731_6e-3 + r2 * 2.443_315_7e-5));
    let index = quadrant as i32 & 3;
    let (a, b) = if index & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let sine = if index & 2 == 0 { a } else { -a };
    let cosine = if (index + 1) & 2 == 0 { b } else { -b };
    (sine, cosine)
}

/// A standard normal value (Box and Muller); the second value is discarded to keep the random stream simple.
fn standard_normal(rng: &mut ChaCha8Rng) -> f32 {
    let (u, v): (f32, f32) = (rng.random(), rng.random());
    let radius = libm::sqrtf(-2.0 * libm::logf(1.0 - u));
    radius * libm::cosf(std::f32::consts::TAU * v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_approximate_gaussian_kernel() {
        let fourier = FourierFeatures::new(&[InputBlock { size: 3, length_scale: 2.0 }], 1);
        for distance in [0.0f32, 1.0, 2.0, 4.0] {
            let a = fourier.features(&[0.3, -0.2, 0.9]);
            let b = fourier.features(&[0.3 + distance, -0.2, 0.9]);
            let kernel = simd::dot::<8>(&a, &b) / NUM_FREQUENCIES as f32;
            let wanted = (-distance * distance / 8.0).exp();
            assert!((kernel - wanted).abs() < 0.1, "{kernel} against {wanted} at {distance}");
        }
    }

    #[test]
    fn sine_and_cosine_agree_with_double_precision() {
        let near = (-4000..4000).map(|i| i as f32 * 0.01);
        let far = (-8000..8000).map(|i| i as f32 * 0.999_7);
        for x in near.chain(far) {
            let (sine, cosine) = sin_cos(x);
            let (s, c) = libm::sincos(x as f64);
            assert!((sine as f64 - s).abs() < 2e-7, "sin {x}: {sine} against {s}");
            assert!((cosine as f64 - c).abs() < 2e-7, "cos {x}: {cosine} against {c}");
        }
    }

    #[test]
    fn vjp_agrees_with_central_differences() {
        let fourier = FourierFeatures::new(&[InputBlock { size: 4, length_scale: 1.5 }], 3);
        let weights: Vec<f32> = (0..NUM_FEATURES).map(|k| libm::sinf(k as f32)).collect();
        let x = [0.1f32, -0.4, 0.7, 0.2];
        let value = |x: &[f32]| simd::dot::<8>(&fourier.features(x), &weights) as f64;
        let gradient = fourier.vjp(&fourier.features(&x), &weights, 4);
        for i in 0..4 {
            let (mut up, mut down) = (x, x);
            up[i] += 1e-2;
            down[i] -= 1e-2;
            let wanted = (value(&up) - value(&down)) / 2e-2;
            assert!((gradient[i] as f64 - wanted).abs() < 2e-2, "{} against {wanted}", gradient[i]);
        }
    }
}
