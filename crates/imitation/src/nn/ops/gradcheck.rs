//! Gradient checks of all custom operations. The value is compared with the formula in double precision, the
//! gradient with central differences of the formula.

use crate::nn::ops::chamfer::Chamfer;
use crate::nn::ops::elu_backward::EluBackward;
use crate::nn::ops::fabric_head::{Head, PACKED};
use crate::nn::ops::fourier::FeatureBatch;
use crate::nn::ops::linear::LinearAct;
use crate::nn::ops::linear_max_pool::LinearMaxPool;
use crate::nn::ops::matmul_nt::MatmulNT;
use candle_core::{Device, Tensor, Var};
use policy::networks::fabric_head::{BASE_DAMPING, METRIC_FLOOR, REST_EPS, TRIANGLE_ENTRIES};
use policy::networks::fourier::{NUM_FEATURES, NUM_FREQUENCIES};
use policy::networks::mlp::Activation;
use robot::{DOF, JointMatrix, JointVector};

/// Values of a tensor in double precision.
type Numbers = Vec<f64>;

const STEP: f64 = 1e-6;

/// Tolerance of single precision, relative to the max. absolute value.
const TOLERANCE: f64 = 2e-5;

fn wave(shape: &[usize], by: f64) -> Var {
    let count: usize = shape.iter().product();
    let values = (0..count).map(|k| libm::sin(by * (k * k % 997) as f64) as f32).collect();
    Var::from_vec::<_, f32>(values, shape, &Device::Cpu).unwrap()
}

fn numbers(tensor: &Tensor) -> Numbers {
    let values = tensor.flatten_all().unwrap().to_vec1::<f32>().unwrap();
    values.into_iter().map(f64::from).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn assert_close(name: &str, got: &[f64], expected: &[f64]) {
    assert_eq!(got.len(), expected.len(), "{name}");
    let max = expected.iter().fold(0.0, |max: f64, x| max.max(x.abs()));
    assert!(max > 1e-2, "{name} is nearly zero");
    for (k, (got, expected)) in got.iter().zip(expected).enumerate() {
        assert!(
            (got - expected).abs() < TOLERANCE * max,
            "{name} {k}: got {got}, expected {expected}"
        );
    }
}

/// Compares an operation with its formula. The first `num_trainable` inputs have a gradient.
fn check_gradient(
    name: &str,
    inputs: &[Var],
    num_trainable: usize,
    operation: impl Fn(&[Var]) -> Tensor,
    formula: impl Fn(&[Numbers]) -> Numbers,
) {
    let output = operation(inputs);
    let values: Vec<Numbers> = inputs.iter().map(|input| numbers(input)).collect();
    assert_close(name, &numbers(&output), &formula(&values));
    let upstream = wave(output.dims(), 0.3);
    let store = (&output * upstream.as_tensor()).unwrap().sum_all().unwrap().backward().unwrap();
    let upstream = numbers(&upstream);
    for (index, input) in inputs.iter().take(num_trainable).enumerate() {
        let mut perturbed = values.clone();
        let mut at = |k: usize, value: f64| {
            perturbed[index][k] = value;
            dot(&formula(&perturbed), &upstream)
        };
        let derivative = |(k, x): (usize, &f64)| {
            let derivative = (at(k, x + STEP) - at(k, x - STEP)) / (2.0 * STEP);
            at(k, *x);
            derivative
        };
        let expected: Numbers = values[index].iter().enumerate().map(derivative).collect();
        let got = numbers(store.get(input).expect("no gradient of the input"));
        assert_close(&format!("{name}, gradient of input {index}"), &got, &expected);
    }
}

/// xW + b, row by row.
fn layer(x: &[f64], weight: &[f64], bias: &[f64]) -> Vec<Numbers> {
    let inputs = weight.len() / bias.len();
    let entry = |row: &[f64], column: usize| {
        let terms = row.iter().enumerate().map(|(i, x)| x * weight[i * bias.len() + column]);
        terms.sum::<f64>() + bias[column]
    };
    let row = |row: &[f64]| (0..bias.len()).map(|column| entry(row, column)).collect();
    x.chunks_exact(inputs).map(row).collect()
}

fn elu(x: f64) -> f64 {
    if x > 0.0 { x } else { libm::expm1(x) }
}

#[test]
fn linear_layer_matches_formula() {
    type Case = (Option<Activation>, fn(f64) -> f64);
    let cases: [Case; 3] =
        [(None, |y| y), (Some(Activation::Elu), elu), (Some(Activation::Relu), |y| y.max(0.0))];
    for (activation, f) in cases {
        check_gradient(
            "linear layer",
            &[wave(&[6, 4], 0.7), wave(&[4, 5], 1.3), wave(&[5], 2.1)],
            3,
            |v| v[0].apply_op3(&v[1], &v[2], LinearAct { activation, accumulator: None }).unwrap(),
            |v| layer(&v[0], &v[1], &v[2]).into_iter().flatten().map(f).collect(),
        );
    }
}

#[test]
fn matmul_nt_matches_formula() {
    check_gradient(
        "matmul nt",
        &[wave(&[6, 5], 0.7), wave(&[4, 5], 1.3)],
        2,
        |v| v[0].apply_op2(&v[1], MatmulNT { accumulator: None }).unwrap(),
        |v| {
            let row = |x| v[1].chunks_exact(5).map(move |weights| dot(x, weights));
            v[0].chunks_exact(5).flat_map(row).collect()
        },
    );
}

#[test]
fn elu_backward_matches_formula() {
    check_gradient(
        "elu backward",
        &[wave(&[5, 8], 0.7), wave(&[5, 8], 1.9)],
        2,
        |v| v[0].apply_op2(&v[1], EluBackward).unwrap(),
        |v| v[0].iter().zip(&v[1]).map(|(g, h)| g * (h.min(0.0) + 1.0)).collect(),
    );
}

#[test]
fn linear_max_pool_matches_formula() {
    check_gradient(
        "linear max pool",
        &[wave(&[20, 3], 0.7), wave(&[3, 7], 1.3), wave(&[7], 2.1)],
        3,
        |v| v[0].apply_op3(&v[1], &v[2], LinearMaxPool::new(4, None)).unwrap(),
        |v| {
            let rows = layer(&v[0], &v[1], &v[2]);
            let max = |group: &[Numbers], channel: usize| {
                group.iter().fold(0.0, |max: f64, row| max.max(row[channel]))
            };
            let of_group = |group| (0..7).map(move |channel| max(group, channel));
            rows.chunks_exact(4).flat_map(of_group).collect()
        },
    );
}

#[test]
fn fourier_backward_matches_formula() {
    let phases = wave(&[2, NUM_FREQUENCIES], 0.9);
    let angles = numbers(&phases);
    check_gradient(
        "fourier backward",
        &[wave(&[2, NUM_FEATURES], 1.3)],
        1,
        |v| FeatureBatch::from_phases(&phases).unwrap().vjp(&v[0]).unwrap(),
        |v| {
            let of_phase = |(k, angle): (usize, &f64)| {
                let at = k / NUM_FREQUENCIES * NUM_FEATURES + k % NUM_FREQUENCIES;
                let (sin, cos) = libm::sincos(*angle);
                cos * v[0][at + NUM_FREQUENCIES] - sin * v[0][at]
            };
            angles.iter().enumerate().map(of_phase).collect()
        },
    );
}

#[test]
fn chamfer_matches_formula() {
    check_gradient(
        "chamfer",
        &[wave(&[2, 7, 3], 0.7), wave(&[2, 9, 3], 1.1)],
        1,
        |v| v[0].apply_op2(&v[1], Chamfer::default()).unwrap(),
        |v| {
            let squared = |p: &[f64], q: &[f64]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>();
            let one_way = |a: &[f64], b: &[f64]| {
                let min = |p| b.chunks_exact(3).map(|q| squared(p, q)).fold(f64::MAX, f64::min);
                3.0 / a.len() as f64 * a.chunks_exact(3).map(min).sum::<f64>()
            };
            let clouds = v[0].chunks_exact(21).zip(v[1].chunks_exact(27));
            clouds.map(|(a, b)| one_way(a, b) + one_way(b, a)).collect()
        },
    );
}

/// Eq. 3 to 5 as printed. The trainable inputs of the metrics are their factors U, which are perturbed.
#[test]
fn fabric_head_matches_eq3_to_eq5() {
    let positive = |x: f64| elu(x) + 1.0 + 1e-3;
    let factor = |entries: &[f64]| {
        let mut u = JointMatrix::zeros();
        let mut entries = entries.iter();
        for r in 0..DOF {
            for (c, x) in (0..=r).zip(entries.by_ref()) {
                u[(r, c)] = if r == c { positive(*x) } else { *x };
            }
        }
        u
    };
    let metric = |entries: &[f64]| {
        let u = factor(entries);
        u * u.transpose() + JointMatrix::identity() * METRIC_FLOOR
    };
    let acceleration = |packed: &[f64], speeds: &[f64]| {
        let (metrics, rest) = packed.split_at(2 * TRIANGLE_ENTRIES);
        let qd = JointVector::from_column_slice(speeds);
        let vector = |at: usize| JointVector::from_column_slice(&rest[at..at + DOF]);
        let of_geometry = metric(&metrics[..TRIANGLE_ENTRIES]);
        let inverse = (of_geometry + metric(&metrics[TRIANGLE_ENTRIES..])).try_inverse().unwrap();
        let geometry = inverse * of_geometry * vector(0) * qd.norm_squared();
        let forcing = inverse * (vector(DOF) + qd * positive(rest[2 * DOF]));
        let energization = qd.dot(&geometry) / (qd.norm_squared() + REST_EPS);
        -geometry + qd * (energization - BASE_DAMPING) - forcing
    };
    check_gradient(
        "head",
        &[wave(&[2, PACKED], 0.37), wave(&[2, DOF], 1.1)],
        1,
        |v| v[0].apply_op2(&v[1], Head::default()).unwrap(),
        |v| {
            let states = v[0].chunks_exact(PACKED).zip(v[1].chunks_exact(DOF));
            states.flat_map(|(packed, qd)| acceleration(packed, qd).data.0[0]).collect()
        },
    );
}
