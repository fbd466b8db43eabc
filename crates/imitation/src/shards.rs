//! One batch over several threads: each shard differentiates its part, the gradients are summed in order.

use anyhow::{Result, anyhow};

/// Mean loss and its gradient over all parameters.
pub struct Gradient {
    /// Mean loss.
    pub loss: f32,
    /// Gradient of the mean loss.
    pub values: Vec<f32>,
}

/// Splits `batch` into `shards` parts, one thread each; the result does not depend on their timing.
pub fn sum_over_shards<T: Sync>(
    batch: &[T],
    shards: usize,
    gradient: impl Fn(&[T]) -> Result<Gradient> + Sync,
) -> Result<Gradient> {
    let size = batch.len().div_ceil(shards.max(1));
    let parts: Vec<Result<(usize, Gradient)>> = std::thread::scope(|scope| {
        let threads: Vec<_> = batch
            .chunks(size)
            .map(|part| scope.spawn(|| Ok((part.len(), gradient(part)?))))
            .collect();
        let joined = |thread: std::thread::ScopedJoinHandle<_>| {
            thread.join().unwrap_or_else(|_| Err(anyhow!("a training thread panicked")))
        };
        threads.into_iter().map(joined).collect()
    });
    let mut sum = Gradient { loss: 0.0, values: Vec::new() };
    for part in parts {
        let (count, part) = part?;
        let share = count as f32 / batch.len() as f32;
        sum.loss += share * part.loss;
        sum.values.resize(part.values.len(), 0.0);
        sum.values.iter_mut().zip(&part.values).for_each(|(sum, x)| *sum += share * x);
    }
    Ok(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_of_unequal_size_give_the_mean() {
        let mean = |part: &[f32]| {
            let loss = part.iter().sum::<f32>() / part.len() as f32;
            Ok(Gradient { loss, values: vec![loss, 1.0] })
        };
        let sum = sum_over_shards(&[1.0, 2.0, 6.0], 2, mean).unwrap();
        assert!((sum.loss - 3.0).abs() < 1e-6 && (sum.values[0] - 3.0).abs() < 1e-6);
    }
}
