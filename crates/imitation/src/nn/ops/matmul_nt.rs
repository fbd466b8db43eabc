//! x Wᵀ, the vector-Jacobian product of a layer, as a differentiable operation.

use crate::nn::ops::grad_accumulator::{GradAccumulator, accumulate_product};
use candle_core::backend::BackendStorage;
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Shape, Storage, Tensor};

/// y = x Wᵀ for x (N, outputs) and W (inputs, outputs); y has shape (N, inputs).
pub struct MatmulNT {
    /// Accumulator for the gradient of W; without one the gradient is returned to candle's backward pass.
    pub accumulator: Option<GradAccumulator>,
}

impl CustomOp2 for MatmulNT {
    fn name(&self) -> &'static str {
        "matmul-nt"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        weight: &CpuStorage,
        weight_layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let ((rows, outputs), inputs) = (x_layout.shape().dims2()?, weight_layout.dims()[0]);
        // W xᵀ reads the weights in their memory order. x Wᵀ would transpose them first, which takes as long
        // as the product.
        let sizes = (1, inputs, rows, outputs);
        let product = weight.matmul(x, sizes, weight_layout, &x_layout.transpose(0, 1)?)?;
        let y = transpose(product.as_slice::<f32>()?, inputs, rows);
        Ok((CpuStorage::F32(y), Shape::from((rows, inputs))))
    }

    fn bwd(
        &self,
        x: &Tensor,
        weight: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let of_weight = accumulate_product(self.accumulator.as_ref(), gradient, x)?;
        Ok((Some(gradient.matmul(weight)?), of_weight))
    }
}

/// x Wᵀ outside of automatic differentiation.
pub(crate) fn matmul_nt(x: &Tensor, weight: &Tensor) -> Result<Tensor> {
    let (x, weight) = (x.detach(), weight.detach());
    let (x_storage, x_layout) = x.storage_and_layout();
    let (weight_storage, weight_layout) = weight.storage_and_layout();
    let (Storage::Cpu(of_x), Storage::Cpu(of_weight)) = (&*x_storage, &*weight_storage) else {
        candle_core::bail!("layers require CPU tensors")
    };
    let result =
        MatmulNT { accumulator: None }.cpu_fwd(of_x, x_layout, of_weight, weight_layout)?;
    let (CpuStorage::F32(y), shape) = result else {
        candle_core::bail!("layers require f32 tensors")
    };
    Tensor::from_vec(y, &shape, x.device())
}

/// Block size of the transposition; source and destination of a block stay in the L1 cache.
const BLOCK: usize = 16;

/// Transpose of a row-major matrix (rows, columns).
fn transpose(values: &[f32], rows: usize, columns: usize) -> Vec<f32> {
    let mut transposed = vec![0.0; values.len()];
    for first_row in (0..rows).step_by(BLOCK) {
        let of_block = first_row..rows.min(first_row + BLOCK);
        for first_column in (0..columns).step_by(BLOCK) {
            for column in first_column..columns.min(first_column + BLOCK) {
                let line = &mut transposed[column * rows..(column + 1) * rows];
                for (to, row) in line[of_block.clone()].iter_mut().zip(of_block.clone()) {
                    *to = values[row * columns + column];
                }
            }
        }
    }
    transposed
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::{Device, Var};

    #[test]
    fn matmul_nt_matches_candle_with_its_gradient() {
        let wave = |count: usize, by: f32| -> Vec<f32> {
            (0..count).map(|k| libm::sinf(by * (k * k % 997) as f32)).collect()
        };
        for (rows, inputs, outputs) in [(1, 1, 1), (5, 33, 17), (20, 16, 40)] {
            let x =
                Var::from_vec(wave(rows * outputs, 0.7), (rows, outputs), &Device::Cpu).unwrap();
            let weight = wave(inputs * outputs, 1.3);
            let weight = Var::from_vec(weight, (inputs, outputs), &Device::Cpu).unwrap();
            let upstream = Tensor::from_vec(wave(rows * inputs, 0.3), (rows, inputs), &Device::Cpu);
            let upstream = upstream.unwrap();
            let ours = x.apply_op2(&weight, MatmulNT { accumulator: None }).unwrap();
            let reference = x.matmul(&weight.t().unwrap()).unwrap();
            let max_error = |a: &Tensor, b: &Tensor| {
                let error = (a - b).unwrap().abs().unwrap().max_all().unwrap();
                error.to_scalar::<f32>().unwrap()
            };
            assert!(max_error(&ours, &reference) < 1e-5);
            assert!(max_error(&matmul_nt(&x, &weight).unwrap(), &reference) < 1e-5);
            let store =
                |y: &Tensor| (y * &upstream).unwrap().sum_all().unwrap().backward().unwrap();
            let (ours, reference) = (store(&ours), store(&reference));
            for var in [&x, &weight] {
                assert!(max_error(ours.get(var).unwrap(), reference.get(var).unwrap()) < 1e-5);
            }
        }
    }
}
