//! Where the gradient of a weight is left.
//!
//! candle's own store begins each gradient as zeros and adds to them: four passes over memory for a sum of one. A
//! layer that leaves the gradient of its weight here needs none.

use super::head::contiguous;
use candle_core::{CpuStorage, InplaceOp2, Layout, Result, Tensor};
use std::sync::{Arc, Mutex, PoisonError};

/// The sum of what is left here.
#[derive(Clone, Default)]
pub struct Slot(Arc<Mutex<Option<Tensor>>>);

impl Slot {
    /// Adds a share of the gradient; the first one is kept as it is.
    pub fn add(&self, share: Tensor) -> Result<()> {
        let mut sum = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match &*sum {
            Some(sum) => sum.inplace_op2(&share, &Add),
            None => {
                *sum = Some(share);
                Ok(())
            }
        }
    }

    /// The gradient, if there was any; empties the slot.
    pub fn take(&self) -> Option<Tensor> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// Leaves the gradient of a weight in its slot, or gives it to the tape.
pub(super) fn leave(slot: Option<&Slot>, gradient: Tensor) -> Result<Option<Tensor>> {
    match slot {
        Some(slot) => slot.add(gradient).map(|()| None),
        None => Ok(Some(gradient)),
    }
}

/// a += b.
struct Add;

impl InplaceOp2 for Add {
    fn name(&self) -> &'static str {
        "add"
    }

    fn cpu_fwd(&self, a: &mut CpuStorage, la: &Layout, b: &CpuStorage, lb: &Layout) -> Result<()> {
        let (CpuStorage::F32(a), Some((start, end))) = (a, la.contiguous_offsets()) else {
            candle_core::bail!("gradients are contiguous and of single precision")
        };
        let b = contiguous(b, lb)?;
        a[start..end].iter_mut().zip(b).for_each(|(a, b)| *a += b);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::Device;

    #[test]
    fn shares_are_summed_and_taken_once() {
        let slot = Slot::default();
        let share = |x: &[f32]| Tensor::from_slice(x, x.len(), &Device::Cpu).unwrap();
        assert!(slot.take().is_none());
        slot.clone().add(share(&[1.0, 2.0])).unwrap();
        slot.add(share(&[0.5, -2.0])).unwrap();
        assert_eq!(slot.take().unwrap().to_vec1::<f32>().unwrap(), [1.5, 0.0]);
        assert!(slot.take().is_none());
    }
}
