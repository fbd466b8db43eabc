//! Eq. 3 to 5 for one state: from network outputs to the joint acceleration.
//!
//! Double precision from here on: M is solved by Cholesky.

use nalgebra::Cholesky;
use robot::{DOF, JointMatrix, JointVector};

/// Entries of a lower triangular matrix, row by row.
pub const TRIANGLE: usize = DOF * (DOF + 1) / 2;
/// β, the additional damping (paper §III-B).
pub const DAMPING: f64 = 5.0;
/// Added to every metric: M = U Uᵀ + 0.01 I.
pub const METRIC_FLOOR: f64 = 0.01;
/// Positive outputs are ELU(x) + 1 + this.
pub const POSITIVE_FLOOR: f32 = 1e-3;
/// Keeps unit velocity and energization finite at rest (rad²/s²).
pub const REST: f64 = 1e-6;

/// What the five networks say about one state.
#[derive(Clone, Debug)]
pub struct Outputs {
    /// F_g: entries of U_g, shape (TRIANGLE).
    pub geometry_metric: Vec<f32>,
    /// F_χ: the geometry's acceleration per squared speed, shape (DOF).
    pub geometry: Vec<f32>,
    /// F_f: entries of U_f, shape (TRIANGLE).
    pub driving_metric: Vec<f32>,
    /// ∂ψ/∂q, shape (DOF).
    pub potential_gradient: Vec<f32>,
    /// F_β before its activation.
    pub damping: f32,
}

/// The parts of the fabric at one state.
#[derive(Clone, Debug)]
pub struct Fabric {
    /// M_g = U_g U_gᵀ + 0.01 I.
    pub geometry_metric: JointMatrix,
    /// M_f = U_f U_fᵀ + 0.01 I.
    pub driving_metric: JointMatrix,
    /// π_g = q̇ᵀq̇ F_χ (rad/s²).
    pub geometry: JointVector,
    /// f_f = ∂ψ + β_f q̇.
    pub driving_force: JointVector,
    /// β_f > 0.
    pub damping: f64,
}

/// What the acceleration of a fabric is the sum of (Eq. 3), each in rad/s².
#[derive(Clone, Debug)]
pub struct Terms {
    /// h̃ = -M⁻¹ f_g, the geometry.
    pub geometry: JointVector,
    /// α_L q̇, which keeps the energy along the geometry.
    pub energization: JointVector,
    /// -M⁻¹ ∂ψ.
    pub potential: JointVector,
    /// -(B + β) q̇.
    pub damping: JointVector,
}

/// A positive number from any: ELU(x) + 1 + 1e-3.
///
/// *Departure: the paper's ELU reaches -1 and so cannot force a positive output; we add 1.*
pub fn positive(x: f32) -> f32 {
    crate::mlp::elu(x) + 1.0 + POSITIVE_FLOOR
}

/// q̇ / sqrt(q̇ᵀq̇ + 1e-6): the unit velocity, zero at rest.
pub fn unit_velocity(qd: &JointVector) -> JointVector {
    qd / libm::sqrt(qd.norm_squared() + REST)
}

/// M = U Uᵀ + 0.01 I with U lower triangular, its diagonal made positive (paper §III-B).
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

impl Outputs {
    /// The fabric that the networks describe at joint velocity `qd` (rad/s).
    pub fn fabric(&self, qd: &JointVector) -> Fabric {
        let vector = |x: &[f32]| JointVector::from_fn(|i, _| x[i] as f64);
        let damping = positive(self.damping) as f64;
        Fabric {
            geometry_metric: metric(&self.geometry_metric),
            driving_metric: metric(&self.driving_metric),
            geometry: vector(&self.geometry) * qd.norm_squared(),
            driving_force: vector(&self.potential_gradient) + qd * damping,
            damping,
        }
    }
}

impl Fabric {
    /// f_g = M_g π_g.
    pub fn geometry_force(&self) -> JointVector {
        self.geometry_metric * self.geometry
    }

    /// M = M_g + M_f, factored; `None` if an entry is not finite.
    pub fn factored_metric(&self) -> Option<Cholesky<f64, nalgebra::Const<DOF>>> {
        (self.geometry_metric + self.driving_metric).cholesky()
    }

    /// The q̈ that solves (M_g + M_f) q̈ + f_g + f_f = 0 (Eq. 4, 5).
    pub fn resolve(&self) -> Option<JointVector> {
        Some(-self.factored_metric()?.solve(&(self.geometry_force() + self.driving_force)))
    }

    /// The whole fabric (Eq. 3): h̃ + α_L q̇ - M⁻¹ ∂ψ - B q̇ - β q̇, with B = β_f M⁻¹.
    ///
    /// *Departure: the paper prints B = β_f M⁻¹ q̇; multiplied by q̇ once more that is no damping.*
    pub fn acceleration(&self, qd: &JointVector) -> Option<JointVector> {
        let metric = self.factored_metric()?;
        let h = -metric.solve(&self.geometry_force());
        let drive = metric.solve(&self.driving_force);
        Some(h + qd * (energization(qd, &h) - DAMPING) - drive)
    }

    /// The terms of [`Self::acceleration`]; `None` if an entry is not finite.
    pub fn terms(&self, qd: &JointVector) -> Option<Terms> {
        let metric = self.factored_metric()?;
        let geometry = -metric.solve(&self.geometry_force());
        let brake = qd * self.damping;
        Some(Terms {
            energization: qd * energization(qd, &geometry),
            geometry,
            potential: -metric.solve(&(self.driving_force - brake)),
            damping: -metric.solve(&brake) - qd * DAMPING,
        })
    }

    /// λ_max(B) + β (1/s), the fastest rate at which it brakes: Eq. 6 and 7 are stable below 2 / dt = 60.
    pub fn greatest_damping(&self) -> f64 {
        let metric = self.geometry_metric + self.driving_metric;
        self.damping / metric.symmetric_eigenvalues().min() + DAMPING
    }
}

/// α_L = -q̇ᵀh̃ / (q̇ᵀq̇ + ε): conserves L = ½ q̇ᵀq̇ along the geometry.
pub fn energization(qd: &JointVector, h: &JointVector) -> f64 {
    -qd.dot(h) / (qd.norm_squared() + REST)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outputs(seed: usize) -> Outputs {
        let wave = |k: usize| libm::sinf((k * k + 31 * seed) as f32);
        let vector = |n: usize, shift: usize| (0..n).map(|k| wave(k + shift)).collect();
        Outputs {
            geometry_metric: vector(TRIANGLE, 0),
            geometry: vector(DOF, 300),
            driving_metric: vector(TRIANGLE, 400),
            potential_gradient: vector(DOF, 700),
            damping: wave(800),
        }
    }

    fn velocity(seed: usize) -> JointVector {
        JointVector::from_fn(|i, _| libm::cos((i + 5 * seed) as f64))
    }

    #[test]
    fn the_greatest_damping_is_that_of_the_lightest_direction() {
        for seed in 0..5 {
            let fabric = outputs(seed).fabric(&velocity(seed));
            let inverse = fabric.factored_metric().unwrap().inverse();
            let b = inverse * fabric.damping + JointMatrix::identity() * DAMPING;
            // The power method.
            let mut v = velocity(seed + 9);
            for _ in 0..20_000 {
                v = (b * v).normalize();
            }
            let wanted = v.dot(&(b * v));
            let got = fabric.greatest_damping();
            assert!((got - wanted).abs() < 1e-3 * wanted, "{got} against {wanted}");
        }
    }

    #[test]
    fn metrics_are_positive_definite_also_at_rest() {
        for seed in 0..20 {
            for qd in [velocity(seed), JointVector::zeros()] {
                let fabric = outputs(seed).fabric(&qd);
                for metric in [fabric.geometry_metric, fabric.driving_metric] {
                    let least = metric.symmetric_eigenvalues().min();
                    assert!(least >= 0.99 * METRIC_FLOOR, "least eigenvalue {least}");
                }
            }
        }
        let worst = metric(&[-50.0; TRIANGLE]).symmetric_eigenvalues().min();
        assert!(worst > 0.0, "least eigenvalue {worst} of an extreme metric");
    }

    #[test]
    fn eq4_holds() {
        for seed in 0..20 {
            let fabric = outputs(seed).fabric(&velocity(seed));
            let qdd = fabric.resolve().unwrap();
            let force = fabric.geometry_force() + fabric.driving_force;
            let residual = (fabric.geometry_metric + fabric.driving_metric) * qdd + force;
            let share = residual.norm() / force.norm();
            assert!(share <= 1e-10, "residual {share} of the forces");
        }
    }

    #[test]
    fn eq3_is_eq5_with_energization_and_damping() {
        let qd = velocity(3);
        let fabric = outputs(3).fabric(&qd);
        let h = -fabric.factored_metric().unwrap().solve(&fabric.geometry_force());
        let wanted = fabric.resolve().unwrap() + qd * (energization(&qd, &h) - DAMPING);
        let got = fabric.acceleration(&qd).unwrap();
        assert!((got - wanted).norm() < 1e-9 * wanted.norm());
    }

    #[test]
    fn eq3_is_the_sum_of_its_terms() {
        for seed in 0..20 {
            let qd = velocity(seed);
            let fabric = outputs(seed).fabric(&qd);
            let Terms { geometry, energization, potential, damping } = fabric.terms(&qd).unwrap();
            let wanted = fabric.acceleration(&qd).unwrap();
            let sum = geometry + energization + potential + damping;
            assert!((sum - wanted).norm() < 1e-9 * wanted.norm());
            assert!(qd.dot(&damping) < 0.0, "it brakes");
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
    fn the_geometry_is_of_degree_two_in_velocity() {
        let (outputs, qd) = (outputs(1), velocity(1));
        let h = |speed: f64| {
            let fabric = outputs.fabric(&(qd * speed));
            fabric.factored_metric().unwrap().solve(&fabric.geometry_force())
        };
        assert!((h(3.0) - h(1.0) * 9.0).norm() < 1e-9 * h(3.0).norm());
    }

    #[test]
    fn a_fabric_at_rest_moves_down_its_potential() {
        let fabric = outputs(2).fabric(&JointVector::zeros());
        let qdd = fabric.acceleration(&JointVector::zeros()).unwrap();
        assert!(qdd.dot(&fabric.driving_force) < 0.0);
    }
}
