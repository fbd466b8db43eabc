//! Batched fabric head (Eq. 3 to 5) with an analytic gradient; counterpart of `policy::networks::fabric_head`.

use crate::nn::ops::storage::contiguous;
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Shape, Tensor};
use policy::networks::fabric_head::{
    BASE_DAMPING, METRIC_FLOOR, REST_EPS, TRIANGLE_ENTRIES, positive,
};
use policy::networks::mlp::elu_derivative;
use robot::{DOF, JointMatrix, JointVector};
use std::sync::{Mutex, PoisonError};

/// Row length of the packed network outputs: U_g, U_f, χ, ∂ψ/∂q, β_f.
pub const PACKED: usize = 2 * TRIANGLE_ENTRIES + 2 * DOF + 1;

/// Acceleration of the fabric (B, DOF) from packed outputs (B, PACKED) and velocities (B, DOF).
#[derive(Default)]
pub struct Head {
    /// Intermediate results of the last forward pass, one per state, for the backward pass.
    forward_states: Mutex<Vec<Option<ForwardState>>>,
}

/// Network outputs for one state, unpacked.
struct UnpackedOutputs {
    lower: [JointMatrix; 2],
    chi: JointVector,
    gradient: JointVector,
    damping: f64,
}

/// Intermediate results of the forward pass that the backward pass needs.
struct ForwardState {
    lower: [JointMatrix; 2],
    metric: nalgebra::Cholesky<f64, nalgebra::Const<DOF>>,
    pi: JointVector,
    /// M⁻¹ f_g and M⁻¹ f_f.
    y: JointVector,
    w: JointVector,
    qdd: JointVector,
}

impl UnpackedOutputs {
    fn unpack(row: &[f32]) -> Self {
        let triangle = |entries: &[f32]| {
            let mut lower = JointMatrix::zeros();
            let mut entries = entries.iter();
            for r in 0..DOF {
                for (c, x) in (0..=r).zip(entries.by_ref()) {
                    lower[(r, c)] = if r == c { positive(*x) } else { *x } as f64;
                }
            }
            lower
        };
        let vector = |at: usize| JointVector::from_fn(|i, _| row[at + i] as f64);
        Self {
            lower: [
                triangle(&row[..TRIANGLE_ENTRIES]),
                triangle(&row[TRIANGLE_ENTRIES..2 * TRIANGLE_ENTRIES]),
            ],
            chi: vector(2 * TRIANGLE_ENTRIES),
            gradient: vector(2 * TRIANGLE_ENTRIES + DOF),
            damping: positive(row[PACKED - 1]) as f64,
        }
    }

    fn resolve(self, qd: &JointVector) -> Option<ForwardState> {
        let mut metric = JointMatrix::from_diagonal_element(2.0 * METRIC_FLOOR);
        self.lower.iter().for_each(|lower| add_square(&mut metric, lower));
        let metric = metric.cholesky()?;
        let pi = self.chi * qd.norm_squared();
        let y = metric.solve(&apply(&self.lower[0], &pi));
        let w = metric.solve(&(self.gradient + qd * self.damping));
        let alpha = qd.dot(&y) / (qd.norm_squared() + REST_EPS);
        let qdd = -y + qd * (alpha - BASE_DAMPING) - w;
        Some(ForwardState { lower: self.lower, metric, pi, y, w, qdd })
    }
}

/// Adds U Uᵀ to the lower triangle of `sum`.
fn add_square(sum: &mut JointMatrix, lower: &JointMatrix) {
    for k in 0..DOF {
        let column = lower.column(k);
        let column = column.as_slice();
        for j in k..DOF {
            let to = &mut sum.as_mut_slice()[j * DOF..(j + 1) * DOF];
            to[j..].iter_mut().zip(&column[j..]).for_each(|(to, u)| *to += column[j] * u);
        }
    }
}

/// (U Uᵀ + floor) x.
fn apply(lower: &JointMatrix, x: &JointVector) -> JointVector {
    lower * lower.tr_mul(x) + x * METRIC_FLOOR
}

impl ForwardState {
    /// Gradient with respect to the packed row, from the gradient with respect to q̈.
    fn vjp(&self, row: &[f32], qd: &JointVector, of_qdd: &JointVector) -> Vec<f32> {
        // q̈ = -P y - w - β q̇ with P = I - q̇ q̇ᵀ / (q̇ᵀq̇ + ε).
        let projected = of_qdd - qd * (qd.dot(of_qdd) / (qd.norm_squared() + REST_EPS));
        let u = -self.metric.solve(&projected);
        let v = -self.metric.solve(of_qdd);
        // Gradient of M_g: u (π - y)ᵀ - v wᵀ. Gradient of M_f: -u yᵀ - v wᵀ. Gradient of U: (G + Gᵀ) U for a
        // metric gradient G.
        let mut out = Vec::with_capacity(PACKED);
        for (lower, of_u) in self.lower.iter().zip([self.pi - self.y, -self.y]) {
            let pairs = [(u, of_u), (of_u, u), (v, -self.w), (self.w, -v)];
            let pairs = pairs.map(|(left, right)| (left, lower.tr_mul(&right)));
            for r in 0..DOF {
                for c in 0..=r {
                    let of_lower: f64 = pairs.iter().map(|(a, b)| a[r] * b[c]).sum();
                    let slope = if r == c { elu_derivative(row[out.len()]) as f64 } else { 1.0 };
                    out.push((of_lower * slope) as f32);
                }
            }
        }
        let of_chi = apply(&self.lower[0], &u) * qd.norm_squared();
        out.extend(of_chi.iter().chain(v.iter()).map(|x| *x as f32));
        out.push((v.dot(qd) * elu_derivative(row[PACKED - 1]) as f64) as f32);
        out
    }
}

fn velocity(row: &[f32]) -> JointVector {
    JointVector::from_fn(|i, _| row[i] as f64)
}

impl CustomOp2 for Head {
    fn name(&self) -> &'static str {
        "fabric-head"
    }

    fn cpu_fwd(
        &self,
        s1: &CpuStorage,
        l1: &Layout,
        s2: &CpuStorage,
        l2: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (packed, qd) = (contiguous(s1, l1)?, contiguous(s2, l2)?);
        let samples = packed.chunks_exact(PACKED).zip(qd.chunks_exact(DOF));
        let resolved: Vec<Option<ForwardState>> =
            samples.map(|(row, qd)| UnpackedOutputs::unpack(row).resolve(&velocity(qd))).collect();
        let mut out = Vec::with_capacity(qd.len());
        for resolved in &resolved {
            let qdd = resolved.as_ref().map_or(JointVector::from_element(f64::NAN), |r| r.qdd);
            out.extend(qdd.iter().map(|x| *x as f32));
        }
        *self.forward_states.lock().unwrap_or_else(PoisonError::into_inner) = resolved;
        let shape = Shape::from((out.len() / DOF, DOF));
        Ok((CpuStorage::F32(out), shape))
    }

    fn bwd(
        &self,
        packed: &Tensor,
        qd: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let rows = packed.flatten_all()?.to_vec1::<f32>()?;
        let velocities = qd.flatten_all()?.to_vec1::<f32>()?;
        let gradients = gradient.flatten_all()?.to_vec1::<f32>()?;
        let mut out = Vec::with_capacity(rows.len());
        let resolved = self.forward_states.lock().unwrap_or_else(PoisonError::into_inner);
        let vectors = velocities.chunks_exact(DOF).zip(gradients.chunks_exact(DOF));
        for ((row, resolved), (qd, g)) in rows.chunks_exact(PACKED).zip(&*resolved).zip(vectors) {
            match resolved {
                Some(resolved) => out.extend(resolved.vjp(row, &velocity(qd), &velocity(g))),
                // AdamW rejects a gradient that is not finite, and training stops with an error.
                None => out.extend([f32::NAN; PACKED]),
            }
        }
        Ok((Some(Tensor::from_vec(out, packed.shape(), packed.device())?), None))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::{Device, Var};

    #[test]
    fn gradient_is_nan_when_the_metric_is_not_positive_definite() {
        let mut rows = vec![0.1; 2 * PACKED];
        rows[PACKED + 3] = f32::INFINITY;
        let packed = Var::from_vec(rows, (2, PACKED), &Device::Cpu).unwrap();
        let qd = Tensor::ones((2, DOF), candle_core::DType::F32, &Device::Cpu).unwrap();
        let qdd = packed.apply_op2(&qd, Head::default()).unwrap();
        let store = qdd.sum_all().unwrap().backward().unwrap();
        let gradient = store.get(&packed).unwrap().to_vec2::<f32>().unwrap();
        assert!(gradient[0].iter().all(|g| g.is_finite()));
        assert!(gradient[1].iter().all(|g| g.is_nan()));
    }

    #[test]
    fn batched_head_matches_the_inference_head() {
        let row: Vec<f32> = (0..PACKED).map(|k| libm::cosf((3 * k) as f32)).collect();
        let qd = JointVector::from_fn(|i, _| 0.1 * i as f64 - 1.0);
        let outputs = policy::networks::fabric_head::NetworkOutputs {
            geometry_metric: row[..TRIANGLE_ENTRIES].to_vec(),
            geometry: row[2 * TRIANGLE_ENTRIES..2 * TRIANGLE_ENTRIES + DOF].to_vec(),
            driving_metric: row[TRIANGLE_ENTRIES..2 * TRIANGLE_ENTRIES].to_vec(),
            potential_gradient: row[2 * TRIANGLE_ENTRIES + DOF..PACKED - 1].to_vec(),
            damping: row[PACKED - 1],
        };
        let expected = outputs.fabric(&qd).acceleration(&qd).unwrap();
        let packed = Var::from_vec(row, (1, PACKED), &Device::Cpu).unwrap();
        let speeds: Vec<f32> = qd.iter().map(|x| *x as f32).collect();
        let qd = Tensor::from_vec(speeds, (1, DOF), &Device::Cpu).unwrap();
        let got = packed.apply_op2(&qd, Head::default()).unwrap().to_vec2::<f32>().unwrap();
        for i in 0..DOF {
            assert!((got[0][i] as f64 - expected[i]).abs() < 1e-4 * expected.norm());
        }
    }
}
