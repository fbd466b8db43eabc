//! AdamW in one pass over flat parameters, with a state that can be saved.

/// Decay of the first and second moment, and what keeps the quotient finite.
const BETA1: f32 = 0.9;
const BETA2: f32 = 0.99;
const EPSILON: f32 = 1e-8;

/// The optimiser's state.
#[derive(Clone, Debug)]
pub struct AdamW {
    /// First moment.
    pub first: Vec<f32>,
    /// Second moment.
    pub second: Vec<f32>,
    /// Steps so far.
    pub steps: u64,
    /// Decoupled weight decay.
    pub decay: f32,
}

impl AdamW {
    /// A fresh optimiser for `count` parameters.
    pub fn new(count: usize, decay: f32) -> Self {
        Self { first: vec![0.0; count], second: vec![0.0; count], steps: 0, decay }
    }

    /// One step along `gradients`, clipped to norm `clip`.
    pub fn step(&mut self, values: &mut [f32], gradients: &[f32], rate: f32, clip: f32) {
        self.steps += 1;
        let norm = gradients.iter().map(|g| (*g as f64) * (*g as f64)).sum::<f64>().sqrt() as f32;
        let scale = if norm > clip { clip / norm } else { 1.0 };
        let correct1 = 1.0 - BETA1.powi(self.steps.min(10_000) as i32);
        let correct2 = 1.0 - BETA2.powi(self.steps.min(10_000) as i32);
        let moments = self.first.iter_mut().zip(&mut self.second);
        for ((value, gradient), (m, v)) in values.iter_mut().zip(gradients).zip(moments) {
            let g = gradient * scale;
            *m = BETA1 * *m + (1.0 - BETA1) * g;
            *v = BETA2 * *v + (1.0 - BETA2) * g * g;
            let step = (*m / correct1) / ((*v / correct2).sqrt() + EPSILON);
            *value -= rate * (step + self.decay * *value);
        }
    }
}

/// Learning rate that rises over `warmup` steps and falls on a cosine to a hundredth at `total`.
pub fn schedule(step: u64, warmup: u64, total: u64, peak: f32) -> f32 {
    if step < warmup {
        return peak * (step + 1) as f32 / warmup as f32;
    }
    let share = ((step - warmup) as f32 / (total - warmup).max(1) as f32).min(1.0);
    peak * (0.01 + 0.99 * 0.5 * (1.0 + (std::f32::consts::PI * share).cos()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_finds_the_bottom_of_a_bowl() {
        let mut x = vec![3.0f32, -2.0];
        let mut adam = AdamW::new(2, 0.0);
        for step in 0..2000 {
            let gradient = vec![2.0 * (x[0] - 1.0), 20.0 * (x[1] - 0.5)];
            adam.step(&mut x, &gradient, schedule(step, 10, 2000, 0.05), 1e9);
        }
        assert!((x[0] - 1.0).abs() < 1e-3 && (x[1] - 0.5).abs() < 1e-3, "{x:?}");
    }

    #[test]
    fn the_first_step_has_the_size_of_the_rate() {
        let mut x = vec![0.0f32];
        AdamW::new(1, 0.0).step(&mut x, &[123.0], 0.01, 1.0);
        assert!((x[0] + 0.01).abs() < 1e-6, "{}", x[0]);
    }
}
