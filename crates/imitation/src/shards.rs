//! Work over several threads, with results that do not depend on their timing.

use crate::nn::Params;
use anyhow::{Result, anyhow};
use candle_core::Tensor;

/// What a part of the batch is differentiated by, its mean loss or what leads there by the chain rule, and its gradient.
pub struct Gradient {
    /// Its value.
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
        Ok(Self { loss: loss.to_scalar::<f32>()?, of_params: params.gradients(&store)? })
    }
}

impl Gradients {
    /// Mean loss of the batch.
    pub fn loss(&self) -> f32 {
        self.shards.iter().map(|(share, gradient)| share * gradient.loss).sum()
    }
}

/// Applies `f` to all `items`, the costliest ones first, each on the thread with the least to do; gives the results in
/// the order of the items.
pub fn over_threads<T: Sync, R: Send>(
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

/// Splits `batch` into parts of `size`, which the threads share out: the result does not depend on their number.
pub fn differentiate<T: Sync>(
    batch: &[T],
    size: usize,
    threads: usize,
    gradient: impl Fn(&[T]) -> Result<Gradient> + Sync,
) -> Result<Gradients> {
    let parts: Vec<&[T]> = batch.chunks(size.max(1)).collect();
    let share = |part: &[T]| part.len() as f32 / batch.len() as f32;
    let of_part = |part: &&[T]| Ok((share(part), gradient(part)?));
    Ok(Gradients { shards: over_threads(&parts, threads, |part| part.len(), of_part)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_the_order_of_the_items_and_errors_come_through() {
        let items = [3, 1, 4, 1, 5, 9, 2, 6];
        let found = over_threads(&items, 3, |cost| *cost, |item| Ok(10 * item)).unwrap();
        assert_eq!(found, items.map(|item| 10 * item));
        let refuse = |item: &usize| if *item == 9 { Err(anyhow!("no nine")) } else { Ok(()) };
        let error = over_threads(&items, 2, |cost| *cost, refuse).unwrap_err();
        assert_eq!(error.to_string(), "no nine");
    }

    #[test]
    fn shards_of_unequal_size_give_the_mean() {
        let mean = |part: &[f32]| {
            let loss = part.iter().sum::<f32>() / part.len() as f32;
            Ok(Gradient { loss, of_params: Vec::new() })
        };
        for threads in 1..4 {
            let gradients = differentiate(&[1.0, 2.0, 6.0], 2, threads, mean).unwrap();
            assert_eq!(gradients.shards.len(), 2, "on {threads} threads");
            assert!((gradients.loss() - 3.0).abs() < 1e-6);
        }
    }
}
