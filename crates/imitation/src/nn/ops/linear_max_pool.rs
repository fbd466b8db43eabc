//! Last shared layer of a PointNet with max pooling, as one operation with its gradient.
//!
//! Only the row that attains a maximum has a gradient, so the backward pass costs a small part of the forward
//! pass.

use crate::nn::ops::grad_accumulator::{GradAccumulator, accumulate};
use crate::nn::ops::storage::contiguous;
use candle_core::backend::BackendStorage;
use candle_core::{CpuStorage, CustomOp3, Layout, Result, Shape, Tensor};
use policy::simd::with_simd;
use std::sync::{Mutex, PoisonError};

/// Max over each group of N rows of relu(xW + b): x (G N, inputs), W (inputs, outputs), b (outputs) to (G,
/// outputs). On ties the first row receives the gradient.
pub struct LinearMaxPool {
    /// Rows per group, N.
    pub rows: usize,
    /// Accumulator for the gradient of W; without one the gradient is returned to candle's backward pass.
    pub accumulator: Option<GradAccumulator>,
    /// Row within the group that attains each maximum, from the forward to the backward pass.
    argmax: Mutex<Vec<u32>>,
}

impl LinearMaxPool {
    /// Pools over groups of `rows` rows.
    pub fn new(rows: usize, slot: Option<GradAccumulator>) -> Self {
        Self { rows, accumulator: slot, argmax: Mutex::default() }
    }
}

/// Maximum of each group and channel, and the row within the group that attains it.
fn max_and_argmax(values: &[f32], rows: usize, channels: usize) -> (Vec<f32>, Vec<u32>) {
    let count = values.len() / rows;
    let (mut best, mut argmax) = (vec![f32::NEG_INFINITY; count], vec![0u32; count]);
    let results = best.chunks_exact_mut(channels).zip(argmax.chunks_exact_mut(channels));
    with_simd(
        #[inline(always)]
        || {
            for (group, (best, argmax)) in values.chunks_exact(rows * channels).zip(results) {
                for (n, row) in (0u32..).zip(group.chunks_exact(channels)) {
                    for ((best, argmax), x) in best.iter_mut().zip(&mut *argmax).zip(row) {
                        let is_larger = x > best;
                        *argmax = if is_larger { n } else { *argmax };
                        *best = if is_larger { *x } else { *best };
                    }
                }
            }
        },
    );
    (best, argmax)
}

/// y += a x.
#[inline(always)]
fn add_scaled(y: &mut [f32], a: f32, x: &[f32]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += a * x);
}

impl CustomOp3 for LinearMaxPool {
    fn name(&self) -> &'static str {
        "linear-max-pool"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        weight: &CpuStorage,
        weight_layout: &Layout,
        bias: &CpuStorage,
        bias_layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let ((all, inputs), outputs) = (x_layout.shape().dims2()?, bias_layout.dims()[0]);
        let product = x.matmul(weight, (1, all, outputs, inputs), x_layout, weight_layout)?;
        let CpuStorage::F32(product) = product else {
            candle_core::bail!("layers require f32 tensors")
        };
        // Bias and activation are monotonic and equal for all rows, so they do not change the argmax.
        let (mut y, winners) = max_and_argmax(&product, self.rows, outputs);
        let bias = contiguous(bias, bias_layout)?;
        for row in y.chunks_exact_mut(outputs) {
            row.iter_mut().zip(bias).for_each(|(y, b)| *y = (*y + b).max(0.0));
        }
        *self.argmax.lock().unwrap_or_else(PoisonError::into_inner) = winners;
        Ok((CpuStorage::F32(y), Shape::from((all / self.rows, outputs))))
    }

    fn bwd(
        &self,
        x: &Tensor,
        weight: &Tensor,
        bias: &Tensor,
        y: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let winners =
            std::mem::take(&mut *self.argmax.lock().unwrap_or_else(PoisonError::into_inner));
        if winners.len() != y.elem_count() {
            candle_core::bail!(
                "the backward pass of a max pool can run only once, after its forward pass"
            );
        }
        let (inputs, outputs) = weight.dims2()?;
        let flat = |tensor: &Tensor| tensor.flatten_all()?.to_vec1::<f32>();
        let (rows, y, gradient) = (flat(x)?, flat(y)?, flat(gradient)?);
        // Transposed, so that the weights of a channel are contiguous.
        let columns = flat(&weight.t()?)?;
        let mut of_columns = vec![0.0; columns.len()];
        let mut of_bias = vec![0.0; outputs];
        let mut of_rows = vec![0.0; rows.len()];
        with_simd(
            #[inline(always)]
            || {
                for (i, ((y, g), winner)) in y.iter().zip(&gradient).zip(&winners).enumerate() {
                    if *y <= 0.0 {
                        continue;
                    }
                    let (group, channel) = (i / outputs, i % outputs);
                    let row = (group * self.rows + *winner as usize) * inputs;
                    let (row, column) =
                        (row..row + inputs, channel * inputs..(channel + 1) * inputs);
                    of_bias[channel] += g;
                    add_scaled(&mut of_columns[column.clone()], *g, &rows[row.clone()]);
                    add_scaled(&mut of_rows[row], *g, &columns[column]);
                }
            },
        );
        let tensor = |values, shape: &[usize]| Tensor::from_vec(values, shape, x.device());
        let of_weight = tensor(of_columns, &[outputs, inputs])?.t()?.contiguous()?;
        Ok((
            Some(tensor(of_rows, x.dims())?),
            accumulate(self.accumulator.as_ref(), of_weight)?,
            Some(tensor(of_bias, bias.dims())?),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::ops::linear::LinearAct;
    use candle_core::{Device, Var};
    use policy::networks::mlp::Activation;

    fn wave(count: usize, by: f32) -> Vec<f32> {
        (0..count).map(|k| libm::sinf(by * (k * k % 997) as f32)).collect()
    }

    #[test]
    fn linear_max_pool_matches_layer_then_max_with_gradient() {
        let var =
            |values, shape: (usize, usize)| Var::from_vec(values, shape, &Device::Cpu).unwrap();
        let (x, weight) = (var(wave(5 * 4 * 3, 0.7), (20, 3)), var(wave(3 * 7, 1.3), (3, 7)));
        let bias = Var::from_vec(wave(7, 2.1), 7, &Device::Cpu).unwrap();
        let upstream = Tensor::from_vec(wave(5 * 7, 0.3), (5, 7), &Device::Cpu).unwrap();
        let fused = x.apply_op3(&weight, &bias, LinearMaxPool::new(4, None)).unwrap();
        let layer = LinearAct { activation: Some(Activation::Relu), accumulator: None };
        let separate = x.apply_op3(&weight, &bias, layer).unwrap();
        let separate = separate.reshape((5, 4, 7)).unwrap().max(1).unwrap();
        let values = |tensor: &Tensor| tensor.flatten_all().unwrap().to_vec1::<f32>().unwrap();
        let is_close = |got: &Tensor, expected: &Tensor| {
            let pairs = values(got).into_iter().zip(values(expected));
            pairs.map(|(got, expected)| (got - expected).abs()).fold(0.0, f32::max) < 1e-6
        };
        assert!(is_close(&fused, &separate) && values(&fused).contains(&0.0), "{fused}");
        let store = |y: &Tensor| (y * &upstream).unwrap().sum_all().unwrap().backward().unwrap();
        let (fused, separate) = (store(&fused), store(&separate));
        for var in [&x, &weight, &bias] {
            let (got, expected) = (fused.get(var).unwrap(), separate.get(var).unwrap());
            assert!(is_close(got, expected) && values(got).iter().any(|g| *g != 0.0), "{got}");
        }
    }

    #[test]
    fn first_of_equal_rows_receives_the_gradient() {
        let x = Var::new(&[[1.0f32], [3.0], [3.0], [2.0], [2.0], [2.0]], &Device::Cpu).unwrap();
        let weight = Tensor::new(&[[2.0f32]], &Device::Cpu).unwrap();
        let bias = Tensor::new(&[-1.0f32], &Device::Cpu).unwrap();
        let pooled = x.apply_op3(&weight, &bias, LinearMaxPool::new(3, None)).unwrap();
        assert_eq!(pooled.to_vec2::<f32>().unwrap(), [[5.0], [3.0]]);
        let store = pooled.sum_all().unwrap().backward().unwrap();
        let got = store.get(&x).unwrap().flatten_all().unwrap().to_vec1::<f32>().unwrap();
        assert_eq!(got, [0.0, 2.0, 0.0, 2.0, 0.0, 0.0]);
    }
}
