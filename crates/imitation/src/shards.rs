//! One batch over several threads: each shard differentiates its part.

use crate::nn::Params;
use anyhow::{Result, anyhow};
use candle_core::Tensor;

/// The mean loss of a part of the batch, and its gradient.
pub struct Gradient {
    /// Mean loss of the part.
    pub loss: f32,
    /// Gradient of the mean loss by parameter, in the order of the parameters; `None` is zero.
    pub of_params: Vec<Option<Tensor>>,
}

/// The gradients of all parts; their sum by share is that of the batch.
pub struct Gradients {
    /// Part of the batch, gradient of its mean loss.
    pub shards: Vec<(f32, Gradient)>,
}

impl Gradient {
    /// Differentiates a loss.
    pub fn of(loss: &Tensor, params: &Params) -> Result<Self> {
        let store = loss.backward()?;
        Ok(Self { loss: loss.to_scalar::<f32>()?, of_params: params.gradients(&store) })
    }
}

impl Gradients {
    /// Mean loss of the batch.
    pub fn loss(&self) -> f32 {
        self.shards.iter().map(|(share, gradient)| share * gradient.loss).sum()
    }
}

/// Splits `batch` into `shards` parts, one thread each; the result does not depend on their timing.
pub fn differentiate<T: Sync>(
    batch: &[T],
    shards: usize,
    gradient: impl Fn(&[T]) -> Result<Gradient> + Sync,
) -> Result<Gradients> {
    let size = batch.len().div_ceil(shards.max(1)).max(1);
    let parts: Vec<Result<(f32, Gradient)>> = std::thread::scope(|scope| {
        let share = |part: &[T]| part.len() as f32 / batch.len() as f32;
        let gradient = &gradient;
        let threads: Vec<_> = batch
            .chunks(size)
            .map(|part| scope.spawn(move || Ok((share(part), gradient(part)?))))
            .collect();
        let joined = |thread: std::thread::ScopedJoinHandle<_>| {
            thread.join().unwrap_or_else(|_| Err(anyhow!("a training thread panicked")))
        };
        threads.into_iter().map(joined).collect()
    });
    Ok(Gradients { shards: parts.into_iter().collect::<Result<_>>()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_of_unequal_size_give_the_mean() {
        let mean = |part: &[f32]| {
            let loss = part.iter().sum::<f32>() / part.len() as f32;
            Ok(Gradient { loss, of_params: Vec::new() })
        };
        let gradients = differentiate(&[1.0, 2.0, 6.0], 2, mean).unwrap();
        assert_eq!(gradients.shards.len(), 2);
        assert!((gradients.loss() - 3.0).abs() < 1e-6);
    }
}
