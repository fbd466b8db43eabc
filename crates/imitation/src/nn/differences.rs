//! Every operation of ours against its formula, written once more in double precision: the value, and the gradient by
//! central differences of the formula.

use super::chamfer::Chamfer;
use super::dense::Dense;
use super::features::Features;
use super::gate::Gate;
use super::head::{Head, PACKED};
use super::pool::Strongest;
use super::transposed::Transposed;
use candle_core::{Device, Tensor, Var};
use policy::fourier::{FEATURES, FREQUENCIES};
use policy::head::{DAMPING, METRIC_FLOOR, REST, TRIANGLE};
use policy::mlp::Activation;
use robot::{DOF, JointMatrix, JointVector};

/// Numbers in double precision, as many as a tensor has.
type Numbers = Vec<f64>;

const STEP: f64 = 1e-6;

/// Single precision, in shares of the largest number.
const EXACT: f64 = 2e-5;

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

fn assert_close(what: &str, got: &[f64], wanted: &[f64]) {
    assert_eq!(got.len(), wanted.len(), "{what}");
    let largest = wanted.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    assert!(largest > 1e-2, "{what} is nearly zero");
    for (k, (got, wanted)) in got.iter().zip(wanted).enumerate() {
        assert!((got - wanted).abs() < EXACT * largest, "{what} {k}: {got} against {wanted}");
    }
}

/// Holds an operation against its formula; the first `learned` of its inputs have a gradient.
fn check(
    name: &str,
    inputs: &[Var],
    learned: usize,
    operation: impl Fn(&[Var]) -> Tensor,
    formula: impl Fn(&[Numbers]) -> Numbers,
) {
    let made = operation(inputs);
    let values: Vec<Numbers> = inputs.iter().map(|input| numbers(input)).collect();
    assert_close(name, &numbers(&made), &formula(&values));
    let upstream = wave(made.dims(), 0.3);
    let store = (&made * upstream.as_tensor()).unwrap().sum_all().unwrap().backward().unwrap();
    let upstream = numbers(&upstream);
    for (which, input) in inputs.iter().take(learned).enumerate() {
        let mut moved = values.clone();
        let mut at = |k: usize, value: f64| {
            moved[which][k] = value;
            dot(&formula(&moved), &upstream)
        };
        let along = |(k, x): (usize, &f64)| {
            let slope = (at(k, x + STEP) - at(k, x - STEP)) / (2.0 * STEP);
            at(k, *x);
            slope
        };
        let wanted: Numbers = values[which].iter().enumerate().map(along).collect();
        let got = numbers(store.get(input).expect("a gradient"));
        assert_close(&format!("{name}, gradient of input {which}"), &got, &wanted);
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
fn dense() {
    type Case = (Option<Activation>, fn(f64) -> f64);
    let cases: [Case; 3] =
        [(None, |y| y), (Some(Activation::Elu), elu), (Some(Activation::Relu), |y| y.max(0.0))];
    for (activation, f) in cases {
        check(
            "dense",
            &[wave(&[6, 4], 0.7), wave(&[4, 5], 1.3), wave(&[5], 2.1)],
            3,
            |v| v[0].apply_op3(&v[1], &v[2], Dense { activation, slot: None }).unwrap(),
            |v| layer(&v[0], &v[1], &v[2]).into_iter().flatten().map(f).collect(),
        );
    }
}

#[test]
fn transposed() {
    check(
        "transposed",
        &[wave(&[6, 5], 0.7), wave(&[4, 5], 1.3)],
        2,
        |v| v[0].apply_op2(&v[1], Transposed { slot: None }).unwrap(),
        |v| {
            let row = |x| v[1].chunks_exact(5).map(move |weights| dot(x, weights));
            v[0].chunks_exact(5).flat_map(row).collect()
        },
    );
}

#[test]
fn gate() {
    check(
        "gate",
        &[wave(&[5, 8], 0.7), wave(&[5, 8], 1.9)],
        2,
        |v| v[0].apply_op2(&v[1], Gate).unwrap(),
        |v| v[0].iter().zip(&v[1]).map(|(g, h)| g * (h.min(0.0) + 1.0)).collect(),
    );
}

#[test]
fn strongest() {
    check(
        "strongest",
        &[wave(&[20, 3], 0.7), wave(&[3, 7], 1.3), wave(&[7], 2.1)],
        3,
        |v| v[0].apply_op3(&v[1], &v[2], Strongest::new(4, None)).unwrap(),
        |v| {
            let rows = layer(&v[0], &v[1], &v[2]);
            let most = |group: &[Numbers], channel: usize| {
                group.iter().fold(0.0, |most: f64, row| most.max(row[channel]))
            };
            let of_group = |group| (0..7).map(move |channel| most(group, channel));
            rows.chunks_exact(4).flat_map(of_group).collect()
        },
    );
}

#[test]
fn fourier_pull_back() {
    let phases = wave(&[2, FREQUENCIES], 0.9);
    let angles = numbers(&phases);
    check(
        "fourier pull-back",
        &[wave(&[2, FEATURES], 1.3)],
        1,
        |v| Features::of(&phases).unwrap().pull_back(&v[0]).unwrap(),
        |v| {
            let pulled = |(k, angle): (usize, &f64)| {
                let at = k / FREQUENCIES * FEATURES + k % FREQUENCIES;
                let (sin, cos) = libm::sincos(*angle);
                cos * v[0][at + FREQUENCIES] - sin * v[0][at]
            };
            angles.iter().enumerate().map(pulled).collect()
        },
    );
}

#[test]
fn chamfer() {
    check(
        "chamfer",
        &[wave(&[2, 7, 3], 0.7), wave(&[2, 9, 3], 1.1)],
        1,
        |v| v[0].apply_op2(&v[1], Chamfer::default()).unwrap(),
        |v| {
            let apart = |p: &[f64], q: &[f64]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>();
            let one_way = |a: &[f64], b: &[f64]| {
                let least = |p| b.chunks_exact(3).map(|q| apart(p, q)).fold(f64::MAX, f64::min);
                3.0 / a.len() as f64 * a.chunks_exact(3).map(least).sum::<f64>()
            };
            let clouds = v[0].chunks_exact(21).zip(v[1].chunks_exact(27));
            clouds.map(|(a, b)| one_way(a, b) + one_way(b, a)).collect()
        },
    );
}

/// Eq. 3 to 5 as they are printed; of the metrics their factors U are learned, and those are moved.
#[test]
fn head() {
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
        let (metrics, rest) = packed.split_at(2 * TRIANGLE);
        let qd = JointVector::from_column_slice(speeds);
        let vector = |at: usize| JointVector::from_column_slice(&rest[at..at + DOF]);
        let of_geometry = metric(&metrics[..TRIANGLE]);
        let inverse = (of_geometry + metric(&metrics[TRIANGLE..])).try_inverse().unwrap();
        let geometry = inverse * of_geometry * vector(0) * qd.norm_squared();
        let forcing = inverse * (vector(DOF) + qd * positive(rest[2 * DOF]));
        let energization = qd.dot(&geometry) / (qd.norm_squared() + REST);
        -geometry + qd * (energization - DAMPING) - forcing
    };
    check(
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
