//! Eq. 3 to 5 for one state: from network outputs to the joint acceleration.
//!
//! The acceleration is a sum of four terms. The geometry shapes the path: it grows with the squared speed, so
//! the path does not depend on the speed. Energization keeps the energy ½ q̇ᵀq̇ constant along the geometry.
//! The potential ψ pulls to the grasp. Damping brings the robot to rest. The metric M weighs the joints like
//! a mass matrix.
//!
//! Double precision from here on: the metric M is solved by Cholesky decomposition.

use nalgebra::Cholesky;
use robot::{DOF, JointMatrix, JointVector};

/// Number of entries of a lower triangular matrix, stored row by row.
pub const TRIANGLE_ENTRIES: usize = DOF * (DOF + 1) / 2;
/// β, the additional damping (1/s, paper §III-B).
pub const BASE_DAMPING: f64 = 5.0;
/// Added to the diagonal of each metric: M = U Uᵀ + 0.01 I.
pub const METRIC_FLOOR: f64 = 0.01;
/// Floor of positive outputs: ELU(x) + 1 + this.
pub const POSITIVE_FLOOR: f32 = 1e-3;
/// ε (rad²/s²), which keeps unit velocity and energization finite at rest.
pub const REST_EPS: f64 = 1e-6;

/// Outputs of the five networks at one state.
///
/// ```rust
/// use policy::networks::fabric_head::{NetworkOutputs, TRIANGLE_ENTRIES};
/// use robot::{DOF, JointVector};
/// // The potential ψ grows with joint 0. Zeros give the metric M = 2 (1.001² + 0.01) I = 2.024 I.
/// let mut potential_gradient = vec![0.0; DOF];
/// potential_gradient[0] = 1.0;
/// let outputs = NetworkOutputs {
///     geometry_metric: vec![0.0; TRIANGLE_ENTRIES],
///     geometry: vec![0.0; DOF],
///     driving_metric: vec![0.0; TRIANGLE_ENTRIES],
///     potential_gradient,
///     damping: 0.0,
/// };
/// // At rest, Eq. 3 is q̈ = -M⁻¹ ∂ψ (rad/s²): joint 0 accelerates downhill.
/// let at_rest = JointVector::zeros();
/// let qdd = outputs.fabric(&at_rest).acceleration(&at_rest).expect("finite outputs");
/// assert!((qdd[0] + 1.0 / 2.024).abs() < 1e-4);
/// assert_eq!(qdd[1], 0.0);
/// ```
#[derive(Clone, Debug)]
pub struct NetworkOutputs {
    /// F_g: entries of U_g, shape (TRIANGLE_ENTRIES).
    pub geometry_metric: Vec<f32>,
    /// F_χ: the geometry's acceleration per squared speed (1/rad), shape (DOF).
    pub geometry: Vec<f32>,
    /// F_f: entries of U_f, shape (TRIANGLE_ENTRIES).
    pub driving_metric: Vec<f32>,
    /// ∂ψ/∂q (rad/s², for dimensionless metrics), shape (DOF).
    pub potential_gradient: Vec<f32>,
    /// F_β before its activation.
    pub damping: f32,
}

/// Metrics and forces of the neural fabric at one state. The metrics are dimensionless, so forces are in
/// rad/s².
#[derive(Clone, Debug)]
pub struct NeuralFabric {
    /// M_g = U_g U_gᵀ + 0.01 I.
    pub geometry_metric: JointMatrix,
    /// M_f = U_f U_fᵀ + 0.01 I.
    pub driving_metric: JointMatrix,
    /// π_g = q̇ᵀq̇ F_χ (rad/s²).
    pub geometry: JointVector,
    /// f_f = ∂ψ + β_f q̇ (rad/s²).
    pub driving_force: JointVector,
    /// β_f > 0 (1/s).
    pub damping: f64,
}

/// The terms of the fabric's acceleration (Eq. 3), each in rad/s²; their sum is q̈.
#[derive(Clone, Debug)]
pub struct AccelerationTerms {
    /// h̃ = -M⁻¹ f_g, of the geometry.
    pub geometry: JointVector,
    /// α_L q̇, which conserves the energy along the geometry.
    pub energization: JointVector,
    /// -M⁻¹ ∂ψ, of the potential.
    pub potential: JointVector,
    /// -(B + β) q̇, of the damping.
    pub damping: JointVector,
}

/// Maps any output to a positive number: ELU(x) + 1 + 1e-3.
///
/// *Departure: the paper's ELU reaches -1 and so cannot force a positive output; we add 1.*
pub fn positive(x: f32) -> f32 {
    crate::networks::mlp::elu(x) + 1.0 + POSITIVE_FLOOR
}

/// Unit velocity q̇ / sqrt(q̇ᵀq̇ + 1e-6); zero at rest.
pub fn unit_velocity(qd: &JointVector) -> JointVector {
    qd / libm::sqrt(qd.norm_squared() + REST_EPS)
}

/// M = U Uᵀ + 0.01 I with U lower triangular and a positive diagonal (paper §III-B).
pub fn metric(entries: &[f32]) -> JointMatrix {
    let mut u = JointMatrix::zeros();
    let mut entries = entries.iter();
    for row in 0..DOF {
        for (column, entry) in (0..=row).zip(entries.by_ref()) {
            u[(row, column)] = if row == column { positive(*entry) } else { *entry } as f64;
        }
    }
    u * u.transpose() + JointMatrix::identity() * METRIC_FLOOR
}

impl NetworkOutputs {
    /// Assembles the fabric at joint velocity `qd` (rad/s).
    pub fn fabric(&self, qd: &JointVector) -> NeuralFabric {
        let vector = |x: &[f32]| JointVector::from_fn(|i, _| x[i] as f64);
        let damping = positive(self.damping) as f64;
        NeuralFabric {
            geometry_metric: metric(&self.geometry_metric),
            driving_metric: metric(&self.driving_metric),
            geometry: vector(&self.geometry) * qd.norm_squared(),
            driving_force: vector(&self.potential_gradient) + qd * damping,
            damping,
        }
    }
}

impl NeuralFabric {
    /// f_g = M_g π_g, the force of the geometry.
    pub fn geometry_force(&self) -> JointVector {
        self.geometry_metric * self.geometry
    }

    /// Cholesky decomposition of M = M_g + M_f; `None` if an entry is not finite.
    pub fn factored_metric(&self) -> Option<Cholesky<f64, nalgebra::Const<DOF>>> {
        (self.geometry_metric + self.driving_metric).cholesky()
    }

    /// Solves (M_g + M_f) q̈ + f_g + f_f = 0 for q̈ (Eq. 4, 5).
    pub fn resolve(&self) -> Option<JointVector> {
        Some(-self.factored_metric()?.solve(&(self.geometry_force() + self.driving_force)))
    }

    /// Acceleration of the whole fabric (Eq. 3): h̃ + α_L q̇ - M⁻¹ ∂ψ - B q̇ - β q̇, with B = β_f M⁻¹.
    ///
    /// *Departure: the paper prints B = β_f M⁻¹ q̇. Multiplied by q̇ again, that is not a damping term.*
    pub fn acceleration(&self, qd: &JointVector) -> Option<JointVector> {
        let metric = self.factored_metric()?;
        let h = -metric.solve(&self.geometry_force());
        let drive = metric.solve(&self.driving_force);
        Some(h + qd * (energization(qd, &h) - BASE_DAMPING) - drive)
    }

    /// The terms of [`Self::acceleration`]; `None` if an entry is not finite.
    pub fn terms(&self, qd: &JointVector) -> Option<AccelerationTerms> {
        let metric = self.factored_metric()?;
        let geometry = -metric.solve(&self.geometry_force());
        let brake = qd * self.damping;
        Some(AccelerationTerms {
            energization: qd * energization(qd, &geometry),
            geometry,
            potential: -metric.solve(&(self.driving_force - brake)),
            damping: -metric.solve(&brake) - qd * BASE_DAMPING,
        })
    }

    /// λ_max(B) + β (1/s), the maximum damping rate. Integration by Eq. 6 and 7 is stable below 2 / dt = 60.
    pub fn max_damping_rate(&self) -> f64 {
        let metric = self.geometry_metric + self.driving_metric;
        self.damping / metric.symmetric_eigenvalues().min() + BASE_DAMPING
    }
}

/// α_L = -q̇ᵀh̃ / (q̇ᵀq̇ + ε), which conserves L = ½ q̇ᵀq̇ along the geometry.
pub fn energization(qd: &JointVector, h: &JointVector) -> f64 {
    -qd.dot(h) / (qd.norm_squared() + REST_EPS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outputs(seed: usize) -> NetworkOutputs {
        let wave = |k: usize| libm::sinf((k * k + 31 * seed) as f32);
        let vector = |n: usize, shift: usize| (0..n).map(|k| wave(k + shift)).collect();
        NetworkOutputs {
            geometry_metric: vector(TRIANGLE_ENTRIES, 0),
            geometry: vector(DOF, 300),
            driving_metric: vector(TRIANGLE_ENTRIES, 400),
            potential_gradient: vector(DOF, 700),
            damping: wave(800),
        }
    }

    fn velocity(seed: usize) -> JointVector {
        JointVector::from_fn(|i, _| libm::cos((i + 5 * seed) as f64))
    }

    #[test]
    fn max_damping_rate_is_that_of_the_lightest_direction() {
        for seed in 0..5 {
            let fabric = outputs(seed).fabric(&velocity(seed));
            let inverse = fabric.factored_metric().unwrap().inverse();
            let b = inverse * fabric.damping + JointMatrix::identity() * BASE_DAMPING;
            // Power iteration.
            let mut v = velocity(seed + 9);
            for _ in 0..20_000 {
                v = (b * v).normalize();
            }
            let wanted = v.dot(&(b * v));
            let got = fabric.max_damping_rate();
            assert!((got - wanted).abs() < 1e-3 * wanted, "{got} against {wanted}");
        }
    }

    #[test]
    fn metrics_are_positive_definite_also_at_rest() {
        for seed in 0..20 {
            for qd in [velocity(seed), JointVector::zeros()] {
                let fabric = outputs(seed).fabric(&qd);
                for metric in [fabric.geometry_metric, fabric.driving_metric] {
                    let min = metric.symmetric_eigenvalues().min();
                    assert!(min >= 0.99 * METRIC_FLOOR, "smallest eigenvalue {min}");
                }
            }
        }
        let min = metric(&[-50.0; TRIANGLE_ENTRIES]).symmetric_eigenvalues().min();
        assert!(min > 0.0, "smallest eigenvalue {min} of an extreme metric");
    }

    #[test]
    fn eq4_holds() {
        for seed in 0..20 {
            let fabric = outputs(seed).fabric(&velocity(seed));
            let qdd = fabric.resolve().unwrap();
            let force = fabric.geometry_force() + fabric.driving_force;
            let residual = (fabric.geometry_metric + fabric.driving_metric) * qdd + force;
            let ratio = residual.norm() / force.norm();
            assert!(ratio <= 1e-10, "relative residual {ratio}");
        }
    }

    #[test]
    fn eq3_is_eq5_with_energization_and_damping() {
        let qd = velocity(3);
        let fabric = outputs(3).fabric(&qd);
        let h = -fabric.factored_metric().unwrap().solve(&fabric.geometry_force());
        let wanted = fabric.resolve().unwrap() + qd * (energization(&qd, &h) - BASE_DAMPING);
        let got = fabric.acceleration(&qd).unwrap();
        assert!((got - wanted).norm() < 1e-9 * wanted.norm());
    }

    #[test]
    fn eq3_is_the_sum_of_its_terms() {
        for seed in 0..20 {
            let qd = velocity(seed);
            let fabric = outputs(seed).fabric(&qd);
            let AccelerationTerms { geometry, energization, potential, damping } =
                fabric.terms(&qd).unwrap();
            let wanted = fabric.acceleration(&qd).unwrap();
            let sum = geometry + energization + potential + damping;
            assert!((sum - wanted).norm() < 1e-9 * wanted.norm());
            assert!(qd.dot(&damping) < 0.0, "damping must dissipate energy");
            let rest = fabric.terms(&JointVector::zeros()).unwrap();
            assert_eq!(rest.energization.norm() + rest.damping.norm(), 0.0);
        }
    }

    #[test]
    fn eq3_energization_does_no_work() {
        for seed in 0..20 {
            let qd = velocity(seed);
            let fabric = outputs(seed).fabric(&qd);
            let h = -fabric.factored_metric().unwrap().solve(&fabric.geometry_force());
            let power = qd.dot(&(h + qd * energization(&qd, &h)));
            assert!(power.abs() < 1e-6 * qd.norm() * h.norm(), "power {power}");
        }
    }

    #[test]
    fn geometry_is_of_degree_two_in_velocity() {
        let (outputs, qd) = (outputs(1), velocity(1));
        let h = |speed: f64| {
            let fabric = outputs.fabric(&(qd * speed));
            fabric.factored_metric().unwrap().solve(&fabric.geometry_force())
        };
        assert!((h(3.0) - h(1.0) * 9.0).norm() < 1e-9 * h(3.0).norm());
    }

    #[test]
    fn fabric_at_rest_accelerates_down_its_potential() {
        let fabric = outputs(2).fabric(&JointVector::zeros());
        let qdd = fabric.acceleration(&JointVector::zeros()).unwrap();
        assert!(qdd.dot(&fabric.driving_force) < 0.0);
    }
}
