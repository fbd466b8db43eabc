//! Specs and their pullback to joint space.

use nalgebra::{SMatrix, SVector};
use robot::{DOF, JointMatrix, JointVector};

/// A term M ẍ + f = 0 in joint space: the metric M is its priority, the force f its desired acceleration.
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    /// M, symmetric positive semi-definite, shape (DOF, DOF).
    pub metric: JointMatrix,
    /// f, on the left-hand side: +1 accelerates in the negative direction.
    pub force: JointVector,
}

impl Spec {
    /// A spec without metric and force.
    pub fn zero() -> Self {
        Self { metric: JointMatrix::zeros(), force: JointVector::zeros() }
    }

    /// Adds the pullback of a term in an N-dimensional task space x = φ(q).
    ///
    /// The pullback is JᵀMJ and Jᵀ(f + M J̇q̇), with J of shape (N, DOF) and `bias` = J̇q̇.
    pub fn add_pullback<const N: usize>(
        &mut self,
        jacobian: &SMatrix<f64, N, DOF>,
        bias: &SVector<f64, N>,
        metric: &SMatrix<f64, N, N>,
        force: &SVector<f64, N>,
    ) {
        let mj = metric * jacobian;
        self.metric += jacobian.transpose() * mj;
        self.force += jacobian.transpose() * (force + metric * bias);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, SMatrix, Vector2};

    fn jacobian() -> SMatrix<f64, 2, DOF> {
        SMatrix::from_fn(|r, c| libm::sin((3 * r + 2 * c + 1) as f64))
    }

    #[test]
    fn pullback_preserves_task_acceleration() {
        // With a vanishing regulariser, J q̈ + J̇q̇ must equal the desired task acceleration.
        let (bias, wanted) = (Vector2::new(0.3, -0.2), Vector2::new(1.5, -0.7));
        let metric = Matrix2::new(2.0, 0.3, 0.3, 1.0);
        let mut spec = Spec { metric: JointMatrix::identity() * 1e-9, force: JointVector::zeros() };
        spec.add_pullback(&jacobian(), &bias, &metric, &(-metric * wanted));
        let resolved = -spec.metric.cholesky().unwrap().solve(&spec.force);
        let got = jacobian() * resolved + bias;
        assert!((got - wanted).norm() < 1e-6, "got {got}, wanted {wanted}");
    }
}
