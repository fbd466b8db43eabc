//! Gradient accumulator of a weight.
//!
//! candle zero-initialises every gradient and adds to it: four memory passes for a single term. The
//! accumulator stores the factors of the terms and multiplies once. Two uses of a weight (the layer and its
//! vector-Jacobian product) are concatenated into one product.

use candle_core::{Result, Tensor};
use std::sync::{Arc, Mutex, PoisonError};

/// Shared accumulator for the gradient of one weight.
#[derive(Clone, Default)]
pub struct GradAccumulator(Arc<Mutex<Pending>>);

#[derive(Default)]
struct Pending {
    sum: Option<Tensor>,
    /// Factors a (N, inputs) and b (N, outputs) of the terms aᵀ b.
    factors: [Vec<Tensor>; 2],
}

impl GradAccumulator {
    /// Adds a term of the gradient.
    fn add(&self, term: Tensor) -> Result<()> {
        let mut pending = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        pending.sum = Some(match pending.sum.take() {
            Some(sum) => (sum + term)?,
            None => term,
        });
        Ok(())
    }

    /// Adds the term aᵀ b, which is evaluated in [`GradAccumulator::take`].
    fn add_product(&self, a: &Tensor, b: &Tensor) {
        let mut pending = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        pending.factors[0].push(a.detach());
        pending.factors[1].push(b.detach());
    }

    /// Returns the accumulated gradient, `None` if no term was added, and resets the accumulator.
    pub fn take(&self) -> Result<Option<Tensor>> {
        let pending = std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner));
        let [a, b] = pending.factors;
        let product = match (&a[..], &b[..]) {
            ([], []) => None,
            ([a], [b]) => Some(a.t()?.matmul(b)?),
            _ => Some(Tensor::cat(&a, 0)?.t()?.matmul(&Tensor::cat(&b, 0)?)?),
        };
        Ok(match (pending.sum, product) {
            (Some(sum), Some(product)) => Some((sum + product)?),
            (sum, product) => sum.or(product),
        })
    }
}

/// Adds the gradient of a weight to its accumulator. Without one, returns it for candle's backward pass.
pub(crate) fn accumulate(
    accumulator: Option<&GradAccumulator>,
    gradient: Tensor,
) -> Result<Option<Tensor>> {
    match accumulator {
        Some(accumulator) => accumulator.add(gradient).map(|()| None),
        None => Ok(Some(gradient)),
    }
}

/// [`accumulate`] for a gradient aᵀ b.
pub(crate) fn accumulate_product(
    accumulator: Option<&GradAccumulator>,
    a: &Tensor,
    b: &Tensor,
) -> Result<Option<Tensor>> {
    match accumulator {
        Some(accumulator) => {
            accumulator.add_product(a, b);
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
    fn accumulator_sums_terms_and_resets_on_take() {
        let tensor =
            |x: &[f32], shape: (usize, usize)| Tensor::from_slice(x, shape, &Device::Cpu).unwrap();
        let take = |accumulator: &GradAccumulator| {
            accumulator.take().unwrap().unwrap().to_vec2::<f32>().unwrap()
        };
        let accumulator = GradAccumulator::default();
        assert!(accumulator.take().unwrap().is_none());
        // One row, then two: (1, 2)ᵀ (3) and ((1, 0), (0, 1))ᵀ (5, 7)ᵀ.
        let [a, b] = [tensor(&[1.0, 2.0], (1, 2)), tensor(&[3.0], (1, 1))];
        let [c, d] = [tensor(&[1.0, 0.0, 0.0, 1.0], (2, 2)), tensor(&[5.0, 7.0], (2, 1))];
        assert!(accumulate_product(Some(&accumulator), &a, &b).unwrap().is_none());
        accumulate_product(Some(&accumulator.clone()), &c, &d).unwrap();
        assert_eq!(take(&accumulator), [[8.0], [13.0]]);
        assert!(accumulator.take().unwrap().is_none());
        let gradient = tensor(&[0.5, -2.0], (2, 1));
        assert!(accumulate(Some(&accumulator), gradient.clone()).unwrap().is_none());
        accumulate(Some(&accumulator), gradient.clone()).unwrap();
        accumulate_product(Some(&accumulator), &a, &b).unwrap();
        assert_eq!(take(&accumulator), [[4.0], [2.0]]);
        let returned = accumulate_product(None, &a, &b).unwrap().unwrap();
        assert_eq!(returned.to_vec2::<f32>().unwrap(), [[3.0], [6.0]]);
        assert!(accumulate(None, gradient).unwrap().is_some());
    }
}
