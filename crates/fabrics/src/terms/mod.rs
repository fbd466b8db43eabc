//! Terms of the fabric. Each term adds its metric and forces to [`TermSums`].

pub mod attractor;
pub mod palm;
pub mod posture;
pub mod repulsion;

use crate::Spec;
use nalgebra::{SMatrix, SVector};
use robot::DOF;

/// Sums over all terms. Geometric forces shape the path; potential forces drive the motion.
#[derive(Clone, Copy, Debug)]
pub struct TermSums {
    /// Σ JᵀMJ of all terms, and the forces that are homogeneous of degree two in q̇.
    pub geometry: Spec,
    /// Forces of potentials and their damping. Their metric is part of `geometry`.
    pub potential: robot::JointVector,
}

impl TermSums {
    /// Sums without any term.
    pub fn zero() -> Self {
        Self { geometry: Spec::zero(), potential: robot::JointVector::zeros() }
    }

    /// Adds a forcing term. Its curvature J̇q̇ is of degree two and belongs to the geometry.
    pub fn add_forcing<const N: usize>(
        &mut self,
        jacobian: &SMatrix<f64, N, DOF>,
        bias: &SVector<f64, N>,
        metric: &SMatrix<f64, N, N>,
        acceleration: &SVector<f64, N>,
    ) {
        self.geometry.add_pullback(jacobian, bias, metric, &SVector::zeros());
        self.potential -= jacobian.transpose() * (metric * acceleration);
    }
}
