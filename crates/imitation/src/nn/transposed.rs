//! x Wᵀ: back through a layer, as an operation with a gradient of its own.

use super::slot::{Slot, leave_product};
use candle_core::backend::BackendStorage;
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Shape, Storage, Tensor};

/// y (N, inputs) = x (N, outputs) Wᵀ for W (inputs, outputs).
pub struct Transposed {
    /// Where the gradient of W is left, if not on the tape.
    pub slot: Option<Slot>,
}

impl CustomOp2 for Transposed {
    fn name(&self) -> &'static str {
        "transposed"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        weight: &CpuStorage,
        weight_layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let ((rows, outputs), inputs) = (x_layout.shape().dims2()?, weight_layout.dims()[0]);
        // W xᵀ reads the weights as they lie; x Wᵀ would turn them over, which takes as long as the product.
        let sizes = (1, inputs, rows, outputs);
        let flipped = weight.matmul(x, sizes, weight_layout, &x_layout.transpose(0, 1)?)?;
        let y = flip(flipped.as_slice::<f32>()?, inputs, rows);
        Ok((CpuStorage::F32(y), Shape::from((rows, inputs))))
    }

    fn bwd(
        &self,
        x: &Tensor,
        weight: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let of_weight = leave_product(self.slot.as_ref(), gradient, x)?;
        Ok((Some(gradient.matmul(weight)?), of_weight))
    }
}

/// x Wᵀ of what is on no tape.
pub(super) fn through(x: &Tensor, weight: &Tensor) -> Result<Tensor> {
    let (x, weight) = (x.detach(), weight.detach());
    let (x_storage, x_layout) = x.storage_and_layout();
    let (weight_storage, weight_layout) = weight.storage_and_layout();
    let (Storage::Cpu(of_x), Storage::Cpu(of_weight)) = (&*x_storage, &*weight_storage) else {
        candle_core::bail!("layers run on the processor")
    };
    let made = Transposed { slot: None }.cpu_fwd(of_x, x_layout, of_weight, weight_layout)?;
    let (CpuStorage::F32(y), shape) = made else {
        candle_core::bail!("layers are made of single-precision numbers")
    };
    Tensor::from_vec(y, &shape, x.device())
}

/// Rows and columns at a time: what is read and what is written stays in the nearest cache.
const BLOCK: usize = 16;

/// A matrix of this many rows and columns, turned over.
fn flip(values: &[f32], rows: usize, columns: usize) -> Vec<f32> {
    let mut flipped = vec![0.0; values.len()];
    for first_row in (0..rows).step_by(BLOCK) {
        let of_block = first_row..rows.min(first_row + BLOCK);
        for first_column in (0..columns).step_by(BLOCK) {
            for column in first_column..columns.min(first_column + BLOCK) {
                let line = &mut flipped[column * rows..(column + 1) * rows];
                for (to, row) in line[of_block.clone()].iter_mut().zip(of_block.clone()) {
                    *to = values[row * columns + column];
                }
            }
        }
    }
    flipped
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::{Device, Var};

    #[test]
    fn it_is_the_product_with_the_weights_turned_over_and_so_is_its_gradient() {
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
            let ours = x.apply_op2(&weight, Transposed { slot: None }).unwrap();
            let plain = x.matmul(&weight.t().unwrap()).unwrap();
            let apart = |a: &Tensor, b: &Tensor| {
                let off = (a - b).unwrap().abs().unwrap().max_all().unwrap();
                off.to_scalar::<f32>().unwrap()
            };
            assert!(apart(&ours, &plain) < 1e-5);
            assert!(apart(&through(&x, &weight).unwrap(), &plain) < 1e-5);
            let store =
                |y: &Tensor| (y * &upstream).unwrap().sum_all().unwrap().backward().unwrap();
            let (ours, plain) = (store(&ours), store(&plain));
            for var in [&x, &weight] {
                assert!(apart(ours.get(var).unwrap(), plain.get(var).unwrap()) < 1e-5);
            }
        }
    }
}
