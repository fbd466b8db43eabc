//! Data-parallel gradients: work on several threads, with results independent of thread timing.

use crate::nn::Params;
use anyhow::{Result, anyhow};
use candle_core::Tensor;

/// Loss and gradient of a part of the batch. The loss is the mean loss of the part or, for chain-rule steps,
/// a surrogate.
pub struct Gradient {
    /// Value of the loss.
    pub loss: f32,
    /// Gradient of the loss, one tensor per parameter in parameter order; `None` means zero.
    pub by_param: Vec<Option<Tensor>>,
}

/// Gradients of all parts of a batch. Their weighted sum is the gradient of the batch.
pub struct Gradients {
    /// Weight of each part (its fraction of the batch), and its gradient.
    pub partials: Vec<(f32, Gradient)>,
}

impl Gradient {
    /// Gradient of a scalar loss by backpropagation.
    pub fn compute(loss: &Tensor, params: &Params) -> Result<Self> {
        let store = loss.backward()?;
        Ok(Self { loss: loss.to_scalar::<f32>()?, by_param: params.gradients(&store)? })
    }
}

impl Gradients {
    /// Mean loss of the batch.
    pub fn loss(&self) -> f32 {
        self.partials.iter().map(|(weight, gradient)| weight * gradient.loss).sum()
    }
}

/// Applies `f` to all `items` on several threads. Items are assigned in order of decreasing cost to the
/// thread with the lowest total cost. Returns the results in the order of the items.
pub fn parallel_map<T: Sync, R: Send>(
    items: &[T],
    threads: usize,
    cost: impl Fn(&T) -> usize,
    f: impl Fn(&T) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    let mut order: Vec<usize> = (0..items.len()).collect();
    order.sort_by_key(|&i| std::cmp::Reverse(cost(&items[i])));
    let mut queues = vec![(0, Vec::new()); threads.max(1)];
    for i in order {
        if let Some((load, queue)) = queues.iter_mut().min_by_key(|(load, _)| *load) {
            *load += cost(&items[i]);
            queue.push(i);
        }
    }
    let mut results: Vec<(usize, R)> = std::thread::scope(|scope| {
        let f = &f;
        let work = |queue: Vec<usize>| {
            queue.into_iter().map(|i| Ok((i, f(&items[i])?))).collect::<Result<Vec<_>>>()
        };
        let own = queues.swap_remove(0).1;
        let running: Vec<_> =
            queues.into_iter().map(|(_, queue)| scope.spawn(move || work(queue))).collect();
        let mut results = work(own)?;
        for thread in running {
            results.extend(thread.join().map_err(|_| anyhow!("a training thread panicked"))??);
        }
        anyhow::Ok(results)
    })?;
    results.sort_by_key(|(i, _)| *i);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}

/// Splits `batch` into parts of `size` and computes their gradients in parallel. The result does not depend
/// on the number of threads.
pub fn differentiate<T: Sync>(
    batch: &[T],
    size: usize,
    threads: usize,
    gradient: impl Fn(&[T]) -> Result<Gradient> + Sync,
) -> Result<Gradients> {
    let parts: Vec<&[T]> = batch.chunks(size.max(1)).collect();
    let weight = |part: &[T]| part.len() as f32 / batch.len() as f32;
    let of_part = |part: &&[T]| Ok((weight(part), gradient(part)?));
    Ok(Gradients { partials: parallel_map(&parts, threads, |part| part.len(), of_part)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parallel_map_keeps_item_order_and_returns_errors() {
        let items = [3, 1, 4, 1, 5, 9, 2, 6];
        let results = parallel_map(&items, 3, |cost| *cost, |item| Ok(10 * item)).unwrap();
        assert_eq!(results, items.map(|item| 10 * item));
        let reject = |item: &usize| if *item == 9 { Err(anyhow!("rejected 9")) } else { Ok(()) };
        let error = parallel_map(&items, 2, |cost| *cost, reject).unwrap_err();
        assert_eq!(error.to_string(), "rejected 9");
    }

    #[test]
    fn parts_of_unequal_size_give_the_mean_loss() {
        let mean = |part: &[f32]| {
            let loss = part.iter().sum::<f32>() / part.len() as f32;
            Ok(Gradient { loss, by_param: Vec::new() })
        };
        for threads in 1..4 {
            let gradients = differentiate(&[1.0, 2.0, 6.0], 2, threads, mean).unwrap();
            assert_eq!(gradients.partials.len(), 2, "{threads} threads");
            assert!((gradients.loss() - 3.0).abs() < 1e-6);
        }
    }
}
