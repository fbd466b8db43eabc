//! The last shared layer of a PointNet with its maximum, as one operation with its gradient.
//!
//! Only the row that gives a maximum has a gradient there, so the way back costs a small part of the way there.

use super::memory::contiguous;
use super::slot::{Slot, leave};
use candle_core::backend::BackendStorage;
use candle_core::{CpuStorage, CustomOp3, Layout, Result, Shape, Tensor};
use policy::lanes::widest;
use std::sync::{Mutex, PoisonError};

/// x (G N, inputs), W (inputs, outputs), b (outputs) to the largest of relu(xW + b) over each N rows, (G, outputs). The
/// gradient goes to the first that is as large.
pub struct Strongest {
    /// N.
    pub rows: usize,
    /// Where the gradient of W is left, if not on the tape.
    pub slot: Option<Slot>,
    /// The row of its group that each maximum is of, kept until it is asked for.
    winners: Mutex<Vec<u32>>,
}

impl Strongest {
    /// Over each `rows` rows.
    pub fn new(rows: usize, slot: Option<Slot>) -> Self {
        Self { rows, slot, winners: Mutex::default() }
    }
}

/// For each group and channel the largest value, and the row of the group that it is of.
fn largest(values: &[f32], rows: usize, channels: usize) -> (Vec<f32>, Vec<u32>) {
    let count = values.len() / rows;
    let (mut best, mut place) = (vec![f32::NEG_INFINITY; count], vec![0u32; count]);
    let kept = best.chunks_exact_mut(channels).zip(place.chunks_exact_mut(channels));
    widest(
        #[inline(always)]
        || {
            for (group, (best, place)) in values.chunks_exact(rows * channels).zip(kept) {
                for (n, row) in (0u32..).zip(group.chunks_exact(channels)) {
                    for ((best, place), x) in best.iter_mut().zip(&mut *place).zip(row) {
                        let is_larger = x > best;
                        *place = if is_larger { n } else { *place };
                        *best = if is_larger { *x } else { *best };
                    }
                }
            }
        },
    );
    (best, place)
}

/// y += a x.
#[inline(always)]
fn add_scaled(y: &mut [f32], a: f32, x: &[f32]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += a * x);
}

impl CustomOp3 for Strongest {
    fn name(&self) -> &'static str {
        "strongest"
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
            candle_core::bail!("layers are made of single-precision numbers")
        };
        // Neither the bias nor the activation changes which row is the largest.
        let (mut y, winners) = largest(&product, self.rows, outputs);
        let bias = contiguous(bias, bias_layout)?;
        for row in y.chunks_exact_mut(outputs) {
            row.iter_mut().zip(bias).for_each(|(y, b)| *y = (*y + b).max(0.0));
        }
        *self.winners.lock().unwrap_or_else(PoisonError::into_inner) = winners;
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
            std::mem::take(&mut *self.winners.lock().unwrap_or_else(PoisonError::into_inner));
        if winners.len() != y.elem_count() {
            candle_core::bail!("a maximum is differentiated once, where it was found");
        }
        let (inputs, outputs) = weight.dims2()?;
        let flat = |tensor: &Tensor| tensor.flatten_all()?.to_vec1::<f32>();
        let (rows, y, gradient) = (flat(x)?, flat(y)?, flat(gradient)?);
        // A channel's weights in a row.
        let columns = flat(&weight.t()?)?;
        let mut of_columns = vec![0.0; columns.len()];
        let mut of_bias = vec![0.0; outputs];
        let mut of_rows = vec![0.0; rows.len()];
        widest(
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
            leave(self.slot.as_ref(), of_weight)?,
            Some(tensor(of_bias, bias.dims())?),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::dense::Dense;
    use candle_core::{Device, Var};
    use policy::mlp::Activation;

    fn wave(count: usize, by: f32) -> Vec<f32> {
        (0..count).map(|k| libm::sinf(by * (k * k % 997) as f32)).collect()
    }

    #[test]
    fn it_is_the_layer_and_then_the_largest_and_so_is_its_gradient() {
        let var =
            |values, shape: (usize, usize)| Var::from_vec(values, shape, &Device::Cpu).unwrap();
        let (x, weight) = (var(wave(5 * 4 * 3, 0.7), (20, 3)), var(wave(3 * 7, 1.3), (3, 7)));
        let bias = Var::from_vec(wave(7, 2.1), 7, &Device::Cpu).unwrap();
        let upstream = Tensor::from_vec(wave(5 * 7, 0.3), (5, 7), &Device::Cpu).unwrap();
        let one = x.apply_op3(&weight, &bias, Strongest::new(4, None)).unwrap();
        let layer = Dense { activation: Some(Activation::Relu), slot: None };
        let apart = x.apply_op3(&weight, &bias, layer).unwrap();
        let apart = apart.reshape((5, 4, 7)).unwrap().max(1).unwrap();
        let values = |tensor: &Tensor| tensor.flatten_all().unwrap().to_vec1::<f32>().unwrap();
        let close = |got: &Tensor, wanted: &Tensor| {
            let pairs = values(got).into_iter().zip(values(wanted));
            pairs.map(|(got, wanted)| (got - wanted).abs()).fold(0.0, f32::max) < 1e-6
        };
        assert!(close(&one, &apart) && values(&one).contains(&0.0), "{one}");
        let store = |y: &Tensor| (y * &upstream).unwrap().sum_all().unwrap().backward().unwrap();
        let (one, apart) = (store(&one), store(&apart));
        for var in [&x, &weight, &bias] {
            let (got, wanted) = (one.get(var).unwrap(), apart.get(var).unwrap());
            assert!(close(got, wanted) && values(got).iter().any(|g| *g != 0.0), "{got}");
        }
    }

    #[test]
    fn the_first_of_rows_that_are_alike_gets_the_gradient() {
        let x = Var::new(&[[1.0f32], [3.0], [3.0], [2.0], [2.0], [2.0]], &Device::Cpu).unwrap();
        let weight = Tensor::new(&[[2.0f32]], &Device::Cpu).unwrap();
        let bias = Tensor::new(&[-1.0f32], &Device::Cpu).unwrap();
        let strongest = x.apply_op3(&weight, &bias, Strongest::new(3, None)).unwrap();
        assert_eq!(strongest.to_vec2::<f32>().unwrap(), [[5.0], [3.0]]);
        let store = strongest.sum_all().unwrap().backward().unwrap();
        let got = store.get(&x).unwrap().flatten_all().unwrap().to_vec1::<f32>().unwrap();
        assert_eq!(got, [0.0, 2.0, 0.0, 2.0, 0.0, 0.0]);
    }
}
