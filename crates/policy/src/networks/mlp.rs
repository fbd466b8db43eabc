//! Multilayer perceptrons, and the gradient of their first output (paper §III-B).

use crate::simd::{self, f16_to_f32};
use crate::weights::{Tensors, WeightsError};
use half::f16;

/// A fully connected layer: y = xW + b.
#[derive(Clone, Debug)]
pub struct Dense {
    /// W, shape (num_inputs, num_outputs), row-major. Half precision also in memory, because a policy step is
    /// limited by memory bandwidth.
    pub weight: Vec<f16>,
    /// b, shape (num_outputs).
    pub bias: Vec<f32>,
}

/// Activation function between two layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// Exponential linear unit; smooth, for networks whose gradient is used.
    Elu,
    /// Rectified linear unit.
    Relu,
}

/// A multilayer perceptron: layers with an activation after each but the last.
#[derive(Clone, Debug)]
pub struct Mlp {
    /// The layers, from input to output.
    pub layers: Vec<Dense>,
    /// Activation after each layer but the last.
    pub activation: Activation,
}

impl Activation {
    /// Value at `x`.
    pub fn apply(self, x: f32) -> f32 {
        match self {
            Self::Elu => elu(x),
            Self::Relu => x.max(0.0),
        }
    }

    /// Derivative at `x`.
    pub fn derivative(self, x: f32) -> f32 {
        match self {
            Self::Elu => elu_derivative(x),
            Self::Relu => f32::from(x > 0.0),
        }
    }
}

/// ELU: x for positive x, otherwise e^x - 1.
pub fn elu(x: f32) -> f32 {
    if x > 0.0 { x } else { libm::expm1f(x) }
}

/// Derivative of ELU: 1 for positive x, otherwise e^x.
pub fn elu_derivative(x: f32) -> f32 {
    if x > 0.0 { 1.0 } else { libm::expf(x) }
}

impl Dense {
    /// Loads `name.weight` and `name.bias` with the given sizes.
    pub fn load(
        tensors: &Tensors,
        name: &str,
        inputs: usize,
        outputs: usize,
    ) -> Result<Self, WeightsError> {
        Ok(Self {
            weight: tensors.get_half(&format!("{name}.weight"), &[inputs, outputs])?,
            bias: tensors.get(&format!("{name}.bias"), &[outputs])?,
        })
    }

    /// Number of outputs.
    pub fn num_outputs(&self) -> usize {
        self.bias.len()
    }

    /// y = xW + b for a batch of inputs, shape (batch, num_inputs), row-major; shape (batch, num_outputs).
    ///
    /// Each output sums its inputs in order, so its bits do not depend on the batch.
    pub fn apply(&self, x: &[f32]) -> Vec<f32> {
        let num_inputs = self.weight.len() / self.num_outputs();
        debug_assert_eq!(x.len() % num_inputs, 0);
        let mut y = self.bias.repeat(x.len() / num_inputs);
        simd::with_simd(
            #[inline(always)]
            || add_products(&self.weight, x, &mut y, self.num_outputs()),
        );
        y
    }

    /// Vector-Jacobian products Wḡ: gradients with respect to the inputs, shape (batch, num_inputs), for
    /// gradients with respect to the outputs, shape (batch, num_outputs).
    fn vjp(&self, gradients: &[f32]) -> Vec<f32> {
        let width = self.num_outputs();
        let num_inputs = self.weight.len() / width;
        let mut products = vec![0.0; gradients.len() / width * num_inputs];
        let mut row = vec![0.0; width];
        simd::with_simd(
            #[inline(always)]
            || {
                for (i, weights) in self.weight.chunks_exact(width).enumerate() {
                    widen(weights, &mut row);
                    let rows = products.chunks_exact_mut(num_inputs);
                    for (product, gradient) in rows.zip(gradients.chunks_exact(width)) {
                        product[i] = simd::dot::<16>(&row, gradient);
                    }
                }
            },
        );
        products
    }
}

/// y += xW for each row of the batch.
#[inline(always)]
fn add_products(weight: &[f16], x: &[f32], y: &mut [f32], width: usize) {
    // Four rows per pass: fewer passes over y, and still a fixed order of each sum. They are converted once
    // for the batch; the conversion reads memory in sequence, which is the bottleneck of a single input.
    let num_inputs = weight.len() / width;
    let mut rows = vec![0.0; 4 * width];
    for (k, four) in weight.chunks(4 * width).enumerate() {
        let rows = &mut rows[..four.len()];
        widen(four, rows);
        for (x, y) in x.chunks_exact(num_inputs).zip(y.chunks_exact_mut(width)) {
            match x[4 * k..num_inputs.min(4 * k + 4)] {
                [x0, x1, x2, x3] => {
                    let (r0, rest) = rows.split_at(width);
                    let (r1, rest) = rest.split_at(width);
                    let (r2, r3) = rest.split_at(width);
                    for ((((y, a), b), c), d) in y.iter_mut().zip(r0).zip(r1).zip(r2).zip(r3) {
                        *y = (((*y + x0 * a) + x1 * b) + x2 * c) + x3 * d;
                    }
                }
                ref rest => {
                    for (x, row) in rest.iter().zip(rows.chunks_exact(width)) {
                        for (y, w) in y.iter_mut().zip(row) {
                            *y += x * w;
                        }
                    }
                }
            }
        }
    }
}

/// Converts half precision to single precision.
#[inline(always)]
fn widen(halves: &[f16], singles: &mut [f32]) {
    for (single, half) in singles.iter_mut().zip(halves) {
        *single = f16_to_f32(*half);
    }
}

impl Mlp {
    /// Loads the layers `name.0`, `name.1`, ... of the given widths, inputs first.
    pub fn load(
        tensors: &Tensors,
        name: &str,
        widths: &[usize],
        activation: Activation,
    ) -> Result<Self, WeightsError> {
        let layer = |(i, pair): (usize, &[usize])| {
            Dense::load(tensors, &format!("{name}.{i}"), pair[0], pair[1])
        };
        let layers = widths.windows(2).enumerate().map(layer).collect::<Result<_, _>>()?;
        Ok(Self { layers, activation })
    }

    /// Output of the last layer, without activation, for a batch of inputs, shape (batch, num_inputs);
    /// shape (batch, num_outputs).
    pub fn apply(&self, x: &[f32]) -> Vec<f32> {
        let (last, hidden) = self.split();
        let mut h = x.to_vec();
        for layer in hidden {
            h = layer.apply(&h);
            h.iter_mut().for_each(|h| *h = self.activation.apply(*h));
        }
        last.apply(&h)
    }

    /// Gradient of the first output with respect to the inputs, for a batch of inputs; both have the shape
    /// (batch, num_inputs).
    pub fn gradient(&self, x: &[f32]) -> Vec<f32> {
        let (last, hidden) = self.split();
        let mut h = x.to_vec();
        let mut derivatives = Vec::with_capacity(hidden.len());
        for layer in hidden {
            h = layer.apply(&h);
            derivatives
                .push(h.iter().map(|&h| self.activation.derivative(h)).collect::<Vec<f32>>());
            h.iter_mut().for_each(|h| *h = self.activation.apply(*h));
        }
        let of_last: Vec<f32> =
            last.weight.chunks_exact(last.num_outputs()).map(|row| f16_to_f32(row[0])).collect();
        let mut gradient = of_last.repeat(h.len() / of_last.len());
        for (layer, derivative) in hidden.iter().zip(&derivatives).rev() {
            gradient.iter_mut().zip(derivative).for_each(|(g, s)| *g *= s);
            gradient = layer.vjp(&gradient);
        }
        gradient
    }

    fn split(&self) -> (&Dense, &[Dense]) {
        // A loaded MLP has at least one layer.
        (&self.layers[self.layers.len() - 1], &self.layers[..self.layers.len() - 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dense(inputs: usize, outputs: usize) -> Dense {
        let wave = |k: usize| libm::sinf((3 * k + inputs) as f32) * 0.3;
        Dense {
            weight: (0..inputs * outputs).map(wave).map(f16::from_f32).collect(),
            bias: (0..outputs).map(|k| wave(k + 7)).collect(),
        }
    }

    #[test]
    fn layer_output_is_xw_plus_b() {
        let layer = dense(7, 5);
        let x: Vec<f32> = (0..7).map(|k| k as f32 - 3.0).collect();
        for (o, got) in layer.apply(&x).iter().enumerate() {
            let wanted: f32 = layer.bias[o]
                + (0..7).map(|i| x[i] * layer.weight[5 * i + o].to_f32()).sum::<f32>();
            assert!((got - wanted).abs() < 1e-5, "{got} against {wanted}");
        }
    }

    #[test]
    fn bits_do_not_depend_on_the_batch() {
        // Widths that are no multiples of the four rows and of the registers.
        let layers = vec![dense(6, 33), dense(33, 17), dense(17, 3)];
        let mlp = Mlp { layers, activation: Activation::Elu };
        let x: Vec<f32> = (0..6 * 32).map(|k| libm::sinf((k * k) as f32)).collect();
        for batch in [1, 7, 32] {
            let (rows, all) = (x.chunks(6 * batch), mlp.apply(&x));
            let apart: Vec<f32> = rows.clone().flat_map(|x| mlp.apply(x)).collect();
            assert_eq!(apart, all, "outputs in batches of {batch}");
            let apart: Vec<f32> = rows.flat_map(|x| mlp.gradient(x)).collect();
            assert_eq!(apart, mlp.gradient(&x), "gradients in batches of {batch}");
        }
    }

    #[test]
    fn gradient_agrees_with_central_differences() {
        let layers = vec![dense(6, 33), dense(33, 17), dense(17, 1)];
        let mlp = Mlp { layers, activation: Activation::Elu };
        let x: Vec<f32> = (0..6).map(|k| 0.4 * k as f32 - 1.0).collect();
        let gradient = mlp.gradient(&x);
        for i in 0..6 {
            let value = |h: f32| {
                let mut x = x.clone();
                x[i] += h;
                mlp.apply(&x)[0]
            };
            let wanted = (value(1e-2) - value(-1e-2)) / 2e-2;
            assert!((gradient[i] - wanted).abs() < 2e-3, "{} against {wanted}", gradient[i]);
        }
    }

    #[test]
    fn elu_and_its_derivative_are_continuous_at_zero() {
        assert!(
            (elu(-1e-6) - elu(1e-6)).abs() < 1e-5 && (elu_derivative(-1e-6) - 1.0).abs() < 1e-5
        );
        assert!((elu(-50.0) + 1.0).abs() < 1e-6);
    }
}
