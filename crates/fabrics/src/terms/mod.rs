//! What a fabric is made of. Each term adds its metric and forces to the two sums of a [`Pull`].

pub mod attractor;
pub mod palm;
pub mod posture;
pub mod repulsion;

use crate::Spec;
use nalgebra::{SMatrix, SVector};
use robot::DOF;

/// The sums of all terms: geometric forces bend the path, potential forces drive it.
#[derive(Clone, Copy, Debug)]
pub struct Pull {
    /// Σ JᵀMJ of all terms, and the forces that are homogeneous of degree two in q̇.
    pub geometry: Spec,
    /// Forces that derive from potentials and their damping; its metric is part of `geometry`.
    pub potential: robot::JointVector,
}

impl Pull {
    /// No terms yet.
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
        self.geometry.add_pulled_back(jacobian, bias, metric, &SVector::zeros());
        self.potential -= jacobian.transpose() * (metric * acceleration);
    }
}
