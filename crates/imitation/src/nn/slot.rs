//! Where the gradient of a weight is left.
//!
//! candle's own store begins each gradient as zeros and adds to them: four passes over memory for a sum of one. A
//! layer that leaves here what the gradient of its weight is made of needs none; two uses of a weight (a layer, and the
//! way back through it) are two parts of one product.

use candle_core::{Result, Tensor};
use std::sync::{Arc, Mutex, PoisonError};

/// What is left here.
#[derive(Clone, Default)]
pub struct Slot(Arc<Mutex<Left>>);

#[derive(Default)]
struct Left {
    whole: Option<Tensor>,
    /// a (N, inputs) and b (N, outputs) of shares aᵀ b.
    factors: [Vec<Tensor>; 2],
}

impl Slot {
    /// Adds a share of the gradient.
    fn add(&self, share: Tensor) -> Result<()> {
        let mut left = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        left.whole = Some(match left.whole.take() {
            Some(sum) => (sum + share)?,
            None => share,
        });
        Ok(())
    }

    /// Adds the share aᵀ b, which is not worked out before the gradient is taken.
    fn add_product(&self, a: &Tensor, b: &Tensor) {
        let mut left = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        left.factors[0].push(a.detach());
        left.factors[1].push(b.detach());
    }

    /// The gradient, if there was any; empties the slot.
    pub fn take(&self) -> Result<Option<Tensor>> {
        let left = std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner));
        let [a, b] = left.factors;
        let product = match (&a[..], &b[..]) {
            ([], []) => None,
            ([a], [b]) => Some(a.t()?.matmul(b)?),
            _ => Some(Tensor::cat(&a, 0)?.t()?.matmul(&Tensor::cat(&b, 0)?)?),
        };
        Ok(match (left.whole, product) {
            (Some(whole), Some(product)) => Some((whole + product)?),
            (whole, product) => whole.or(product),
        })
    }
}

/// Leaves the gradient of a weight in its slot, or gives it to the tape.
pub(super) fn leave(slot: Option<&Slot>, gradient: Tensor) -> Result<Option<Tensor>> {
    match slot {
        Some(slot) => slot.add(gradient).map(|()| None),
        None => Ok(Some(gradient)),
    }
}

/// The same for a gradient aᵀ b.
pub(super) fn leave_product(slot: Option<&Slot>, a: &Tensor, b: &Tensor) -> Result<Option<Tensor>> {
    match slot {
        Some(slot) => {
            slot.add_product(a, b);
            Ok(None)
        }
        None => Ok(Some(a.t()?.matmul(b)?)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::Device;

    #[test]
    fn shares_are_summed_and_taken_once() {
        let tensor =
            |x: &[f32], shape: (usize, usize)| Tensor::from_slice(x, shape, &Device::Cpu).unwrap();
        let taken = |slot: &Slot| slot.take().unwrap().unwrap().to_vec2::<f32>().unwrap();
        let slot = Slot::default();
        assert!(slot.take().unwrap().is_none());
        // One row, then two: (1, 2)ᵀ (3) and ((1, 0), (0, 1))ᵀ (5, 7)ᵀ.
        let [a, b] = [tensor(&[1.0, 2.0], (1, 2)), tensor(&[3.0], (1, 1))];
        let [c, d] = [tensor(&[1.0, 0.0, 0.0, 1.0], (2, 2)), tensor(&[5.0, 7.0], (2, 1))];
        assert!(leave_product(Some(&slot), &a, &b).unwrap().is_none());
        leave_product(Some(&slot.clone()), &c, &d).unwrap();
        assert_eq!(taken(&slot), [[8.0], [13.0]]);
        assert!(slot.take().unwrap().is_none());
        let whole = tensor(&[0.5, -2.0], (2, 1));
        assert!(leave(Some(&slot), whole.clone()).unwrap().is_none());
        leave(Some(&slot), whole.clone()).unwrap();
        leave_product(Some(&slot), &a, &b).unwrap();
        assert_eq!(taken(&slot), [[4.0], [2.0]]);
        let on_tape = leave_product(None, &a, &b).unwrap().unwrap();
        assert_eq!(on_tape.to_vec2::<f32>().unwrap(), [[3.0], [6.0]]);
        assert!(leave(None, whole).unwrap().is_some());
    }
}
