//! Specs, and the operations that combine them: pullback and sum.

use nalgebra::{SMatrix, SVector};
use robot::{DOF, JointMatrix, JointVector};

/// A term M ẍ + f = 0 in joint space: the metric says how much it matters, the force what it asks for.
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    /// M, symmetric positive semi-definite, shape (DOF, DOF).
    pub metric: JointMatrix,
    /// f, on the left-hand side: +1 accelerates backwards.
    pub force: JointVector,
}

impl Spec {
    /// A term that asks for nothing.
    pub fn zero() -> Self {
        Self { metric: JointMatrix::zeros(), force: JointVector::zeros() }
    }

    /// Adds a term that lives in an N-dimensional task space x = φ(q).
    ///
    /// Pullback: JᵀMJ and Jᵀ(f + M J̇q̇), with J of shape (N, DOF) and `bias` = J̇q̇.
    pub fn add_pulled_back<const N: usize>(
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

    /// The acceleration that satisfies M q̈ + f = 0; `None` if M is not positive definite.
    pub fn resolve(&self) -> Option<JointVector> {
        Some(-self.metric.cholesky()?.solve(&self.force))
    }
}

impl std::ops::Add for Spec {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { metric: self.metric + other.metric, force: self.force + other.force }
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
    fn a_pulled_back_term_gets_its_task_acceleration() {
        // With a vanishing regulariser, J q̈ + J̇q̇ must be the acceleration that the term asks for.
        let (bias, wanted) = (Vector2::new(0.3, -0.2), Vector2::new(1.5, -0.7));
        let metric = Matrix2::new(2.0, 0.3, 0.3, 1.0);
        let mut spec = Spec { metric: JointMatrix::identity() * 1e-9, force: JointVector::zeros() };
        spec.add_pulled_back(&jacobian(), &bias, &metric, &(-metric * wanted));
        let got = jacobian() * spec.resolve().unwrap() + bias;
        assert!((got - wanted).norm() < 1e-6, "{got} against {wanted}");
    }

    #[test]
    fn sums_weigh_by_metric() {
        let term = |weight: f64, acceleration: f64| Spec {
            metric: JointMatrix::identity() * weight,
            force: JointVector::from_element(-weight * acceleration),
        };
        let got = (term(3.0, 1.0) + term(1.0, 5.0)).resolve().unwrap();
        assert!((got - JointVector::from_element(2.0)).norm() < 1e-12);
    }

    #[test]
    fn an_indefinite_metric_has_no_acceleration() {
        assert!(Spec::zero().resolve().is_none());
    }
}
