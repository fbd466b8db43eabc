//! Energization: adds a force along q̇ to a geometry so that it conserves an energy.

use robot::JointVector;

/// Regularises the quotient at rest (rad²/s²).
const REGULARIZER: f64 = 1e-6;

/// Coefficient α for which h + α q̇ conserves L = ½ q̇ᵀq̇: α = -q̇ᵀh / (q̇ᵀq̇ + ε).
///
/// The general form is α = -q̇ᵀ(M_e h + f_e) / (q̇ᵀ M_e q̇). For this energy, M_e = I and f_e = 0.
///
/// ```rust
/// use fabrics::energy::energization;
/// use robot::JointVector;
/// let qd = JointVector::from_element(0.5); // rad/s
/// let h = JointVector::from_fn(|i, _| i as f64); // rad/s²
/// // The energized geometry does no work: its power q̇ᵀq̈ is zero, up to ε.
/// let qdd = h + qd * energization(&qd, &h);
/// assert!(qd.dot(&qdd).abs() < 1e-4);
/// ```
pub fn energization(qd: &JointVector, h: &JointVector) -> f64 {
    -qd.dot(h) / (qd.norm_squared() + REGULARIZER)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energization_does_no_work() {
        for seed in 0..10 {
            let qd = JointVector::from_fn(|i, _| libm::sin((seed * 7 + i) as f64));
            let h = JointVector::from_fn(|i, _| 5.0 * libm::cos((seed + 3 * i) as f64));
            let power = qd.dot(&(h + qd * energization(&qd, &h)));
            let scale = qd.norm() * h.norm();
            assert!(power.abs() < 1e-6 * scale, "power {power} against a scale of {scale}");
        }
    }

    #[test]
    fn energization_is_zero_at_rest() {
        assert_eq!(energization(&JointVector::zeros(), &JointVector::from_element(3.0)), 0.0);
    }
}
