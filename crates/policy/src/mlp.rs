//! Fully connected layers, and the gradient of a scalar output (paper §III-B).

use crate::lanes::{self, widen};
use crate::weights::{Tensors, WeightsError};
use half::f16;

/// y = xW + b.
#[derive(Clone, Debug)]
pub struct Dense {
    /// W, shape (inputs, outputs), row-major; in memory as in the file, because a step of the policy
    /// takes as long as its weights take from memory.
    pub weight: Vec<f16>,
    /// b, shape (outputs).
    pub bias: Vec<f32>,
}

/// What stands between two layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// The exponential linear unit: smooth, for what is differentiated.
    Elu,
    /// The rectifier.
    Relu,
}

/// Layers with an activation after each but the last.
#[derive(Clone, Debug)]
pub struct Mlp {
    /// The layers from input to output.
    pub layers: Vec<Dense>,
    /// What stands between them.
    pub activation: Activation,
}

impl Activation {
    /// Its value.
    pub fn apply(self, x: f32) -> f32 {
        match self {
            Self::Elu => elu(x),
            Self::Relu => x.max(0.0),
        }
    }

    /// Its derivative.
    pub fn slope(self, x: f32) -> f32 {
        match self {
            Self::Elu => elu_slope(x),
            Self::Relu => f32::from(x > 0.0),
        }
    }
}

/// The exponential linear unit: x above zero, e^x - 1 below.
pub fn elu(x: f32) -> f32 {
    if x > 0.0 { x } else { libm::expm1f(x) }
}

/// Its derivative: 1 above zero, e^x below.
pub fn elu_slope(x: f32) -> f32 {
    if x > 0.0 { 1.0 } else { libm::expf(x) }
}

impl Dense {
    /// Reads `name.weight` and `name.bias` of the wanted sizes.
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

    /// Outputs.
    pub fn outputs(&self) -> usize {
        self.bias.len()
    }

    /// y = xW + b; every output sums its inputs in order.
    pub fn apply(&self, x: &[f32]) -> Vec<f32> {
        debug_assert_eq!(x.len() * self.bias.len(), self.weight.len());
        let mut y = self.bias.clone();
        lanes::widest(
            #[inline(always)]
            || add_product(&self.weight, x, &mut y),
        );
        y
    }

    /// Wḡ: the gradient with respect to the inputs.
    fn pull_back(&self, gradient: &[f32]) -> Vec<f32> {
        let rows = self.weight.chunks_exact(gradient.len());
        lanes::widest(
            #[inline(always)]
            || rows.map(|row| lanes::dot::<16, _>(row, gradient, widen)).collect(),
        )
    }
}

/// y += xW.
#[inline(always)]
fn add_product(weight: &[f16], x: &[f32], y: &mut [f32]) {
    let width = y.len();
    // Four rows at a time: fewer passes over y, and still one fixed order of sums.
    let mut inputs = x.chunks_exact(4);
    let mut fours = weight.chunks_exact(4 * width);
    for (x, four) in inputs.by_ref().zip(fours.by_ref()) {
        let (r0, rest) = four.split_at(width);
        let (r1, rest) = rest.split_at(width);
        let (r2, r3) = rest.split_at(width);
        let (x0, x1, x2, x3) = (x[0], x[1], x[2], x[3]);
        for ((((y, a), b), c), d) in y.iter_mut().zip(r0).zip(r1).zip(r2).zip(r3) {
            *y = (((*y + x0 * widen(*a)) + x1 * widen(*b)) + x2 * widen(*c)) + x3 * widen(*d);
        }
    }
    for (x, row) in inputs.remainder().iter().zip(fours.remainder().chunks_exact(width)) {
        for (y, w) in y.iter_mut().zip(row) {
            *y += x * widen(*w);
        }
    }
}

impl Mlp {
    /// Reads layers `name.0`, `name.1`, ... of the given widths, inputs first.
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

    /// Output of the last layer, which is linear.
    pub fn apply(&self, x: &[f32]) -> Vec<f32> {
        let (last, hidden) = self.split();
        let mut h = x.to_vec();
        for layer in hidden {
            h = layer.apply(&h);
            h.iter_mut().for_each(|h| *h = self.activation.apply(*h));
        }
        last.apply(&h)
    }

    /// Gradient of the first output with respect to the inputs.
    pub fn gradient(&self, x: &[f32]) -> Vec<f32> {
        let (last, hidden) = self.split();
        let mut h = x.to_vec();
        let mut slopes = Vec::with_capacity(hidden.len());
        for layer in hidden {
            h = layer.apply(&h);
            slopes.push(h.iter().map(|&h| self.activation.slope(h)).collect::<Vec<f32>>());
            h.iter_mut().for_each(|h| *h = self.activation.apply(*h));
        }
        let mut gradient: Vec<f32> =
            last.weight.chunks_exact(last.outputs()).map(|row| widen(row[0])).collect();
        for (layer, slope) in hidden.iter().zip(&slopes).rev() {
            gradient.iter_mut().zip(slope).for_each(|(g, s)| *g *= s);
            gradient = layer.pull_back(&gradient);
        }
        gradient
    }

    fn split(&self) -> (&Dense, &[Dense]) {
        // An MLP is read with at least one layer.
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
    fn a_layer_is_xw_plus_b() {
        let layer = dense(7, 5);
        let x: Vec<f32> = (0..7).map(|k| k as f32 - 3.0).collect();
        for (o, got) in layer.apply(&x).iter().enumerate() {
            let wanted: f32 = layer.bias[o]
                + (0..7).map(|i| x[i] * layer.weight[5 * i + o].to_f32()).sum::<f32>();
            assert!((got - wanted).abs() < 1e-5, "{got} against {wanted}");
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
    fn elu_and_its_slope_are_continuous_at_zero() {
        assert!((elu(-1e-6) - elu(1e-6)).abs() < 1e-5 && (elu_slope(-1e-6) - 1.0).abs() < 1e-5);
        assert!((elu(-50.0) + 1.0).abs() < 1e-6);
    }
}
