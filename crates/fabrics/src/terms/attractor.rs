//! The soft-normalised pull to a point that palm, hand and posture share.

use nalgebra::SVector;

/// A pull of constant strength that fades near its target, with damping that grows there.
#[derive(Clone, Copy, Debug)]
pub struct Attractor {
    /// Strength far from the target (m/s² or rad/s²).
    pub gain: f64,
    /// How steeply it fades: half strength at about 0.55 / sharpness.
    pub sharpness: f64,
    /// Priority against other terms.
    pub mass: f64,
    /// Damping at the target (1/s).
    pub damping: f64,
    /// Distance within which the damping acts (m or rad).
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
        self.pull(error) - velocity * (self.damping * gate)
    }

    /// -k tanh(a|e|) e/|e| alone; zero at the target.
    pub fn pull<const N: usize>(&self, error: &SVector<f64, N>) -> SVector<f64, N> {
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
    fn the_pull_is_the_gradient_of_a_potential() {
        // ψ = k/a ln cosh(a|e|) has the gradient k tanh(a|e|) e/|e|.
        let attractor =
            Attractor { gain: 3.0, sharpness: 4.0, mass: 1.0, damping: 0.0, damping_radius: 0.1 };
        let psi = |e: Vector3<f64>| 0.75 * libm::log(libm::cosh(4.0 * e.norm()));
        let (e, h) = (Vector3::new(0.3, -0.1, 0.2), 1e-6);
        for i in 0..3 {
            let mut d = Vector3::zeros();
            d[i] = h;
            let gradient = (psi(e + d) - psi(e - d)) / (2.0 * h);
            assert!((attractor.pull(&e)[i] + gradient).abs() < 1e-8);
        }
        assert_eq!(attractor.pull(&Vector3::zeros()), Vector3::zeros());
    }
}
