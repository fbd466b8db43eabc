//! Soft-normalised attraction to a point, used by the palm, hand and posture terms.

use nalgebra::SVector;

/// An attractor with constant strength that decays near its target, and damping near the target.
///
/// ```rust
/// use fabrics::terms::attractor::Attractor;
/// use nalgebra::Vector3;
/// let attractor =
///     Attractor { gain: 2.0, sharpness: 10.0, mass: 1.0, damping: 20.0, damping_radius: 0.1 };
/// // 5 m from the target along x, at rest: full strength towards the target (m/s²).
/// let acceleration = attractor.acceleration(&Vector3::new(5.0, 0.0, 0.0), &Vector3::zeros());
/// assert!((acceleration - Vector3::new(-2.0, 0.0, 0.0)).norm() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Attractor {
    /// Strength far from the target (m/s² or rad/s²).
    pub gain: f64,
    /// Steepness of the decay: half strength at a distance of about 0.55 / sharpness.
    pub sharpness: f64,
    /// Priority relative to other terms: scale of the metric.
    pub mass: f64,
    /// Damping at the target (1/s).
    pub damping: f64,
    /// Distance within which the damping is active (m or rad).
    pub damping_radius: f64,
}

impl Attractor {
    /// -k tanh(a|e|) e/|e| - b g(|e|) ẋ, with the gate g = ½ tanh(-10 (|e| - r)) + ½.
    pub fn acceleration<const N: usize>(
        &self,
        error: &SVector<f64, N>,
        velocity: &SVector<f64, N>,
    ) -> SVector<f64, N> {
        let distance = error.norm();
        let gate = 0.5 * libm::tanh(-10.0 * (distance - self.damping_radius)) + 0.5;
        self.potential_acceleration(error) - velocity * (self.damping * gate)
    }

    /// Potential part -k tanh(a|e|) e/|e|; zero at the target.
    pub fn potential_acceleration<const N: usize>(
        &self,
        error: &SVector<f64, N>,
    ) -> SVector<f64, N> {
        let distance = error.norm();
        if distance < 1e-12 {
            return SVector::zeros();
        }
        error * (-self.gain * libm::tanh(self.sharpness * distance) / distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn potential_acceleration_is_negative_gradient_of_potential() {
        // ψ = k/a ln cosh(a|e|) has the gradient k tanh(a|e|) e/|e|.
        let attractor =
            Attractor { gain: 3.0, sharpness: 4.0, mass: 1.0, damping: 0.0, damping_radius: 0.1 };
        let psi = |e: Vector3<f64>| 0.75 * libm::log(libm::cosh(4.0 * e.norm()));
        let (e, h) = (Vector3::new(0.3, -0.1, 0.2), 1e-6);
        for i in 0..3 {
            let mut d = Vector3::zeros();
            d[i] = h;
            let gradient = (psi(e + d) - psi(e - d)) / (2.0 * h);
            assert!((attractor.potential_acceleration(&e)[i] + gradient).abs() < 1e-8);
        }
        assert_eq!(attractor.potential_acceleration(&Vector3::zeros()), Vector3::zeros());
    }
}
