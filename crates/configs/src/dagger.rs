//! Configuration of policy training with DAgger (Eq. 1 and 2, paper §II-B).

use policy::PolicyConfig;

/// Hyperparameters of policy training. The scheme is the paper's; the values are ours.
///
/// ```rust
/// use configs::DaggerConfig;
/// use policy::PolicyConfig;
/// let policy = PolicyConfig::by_name("ngf-pcd").expect("a policy of the paper");
/// let config = DaggerConfig::preset("small", policy).expect("a preset");
/// // The horizon grows from one step, behaviour cloning, to its full length.
/// assert_eq!(config.horizon_fraction(0), 0.0);
/// assert_eq!(config.horizon_fraction(config.steps), 1.0);
/// // The expert is stable at 30 Hz.
/// let (gains, dt) = (config.gains, 1.0 / 30.0);
/// assert!(0.5 * gains.position * dt < gains.velocity && gains.velocity < 2.0 / dt);
/// ```
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DaggerConfig {
    /// Number of optimiser steps.
    pub steps: u64,
    /// Fraction of the steps, from the first, that train only F_ψ of a fabric. Such a step needs a third of
    /// the matrix products, and the target position is most of what the policy has to learn. The other
    /// networks keep their initial weights during this phase.
    pub potential_only_fraction: f64,
    /// Batch size: states per step.
    pub batch: usize,
    /// Number of rollout batches; step k uses batch k modulo this number. With few batches, the states of a
    /// step would be those of a few steps before, 33 ms later, and the weights would overfit to the few
    /// groups in them.
    pub num_buffers: usize,
    /// Number of threads.
    pub threads: usize,
    /// Peak learning rate.
    pub learning_rate: f32,
    /// Warm-up steps of the learning rate, limited to a tenth of all steps.
    pub warmup: u64,
    /// Decoupled weight decay, relative to the learning rate.
    pub weight_decay: f32,
    /// Max. gradient norm. Gradients are always larger (100 to 5,000), so all steps have the same weight,
    /// independent of the error of their batch.
    pub grad_clip_norm: f32,
    /// Horizon H: policy steps of a rollout before its state is resampled, ± 25 %. 1 is behaviour cloning of
    /// noisy states.
    pub horizon: usize,
    /// Fractions of the steps at which the horizon starts to grow from one step and reaches its full length.
    /// Rollouts of an untrained policy only reach states that are useless for training.
    pub horizon_ramp: [f64; 2],
    /// Bounds of the uniform noise on sampled states: arm position (rad), hand position (rad), velocity
    /// (rad/s).
    pub noise: [f64; 3],
    /// Bound of the uniform noise on each value of the observation (z has unit variance), drawn for every
    /// state of every step.
    pub observation_noise: f64,
    /// Weight (rad/m) of the fingertip term in the loss.
    pub fingertip_weight: f64,
    /// Weight of the mean square of the metric networks' outputs, the entries of U.
    ///
    /// *Departure: Eq. 2 alone does not fix the unit of mass: metrics, potential and damping can grow
    /// together without a change in acceleration. Without this term they grew by a factor of 10⁶ in 6,000
    /// steps and training failed.*
    pub metric_weight: f64,
    /// Fraction of sampled states, at full horizon, that are initial states of attempts: the start
    /// configuration of one of the nearest other object poses, at rest (paper §III-F).
    pub start_fraction: f64,
    /// PD gains of the expert.
    pub gains: Gains,
    /// Min. lookahead distance (rad, weighted) of the expert. Multiplied by k_p / k_d, it is the expert's
    /// min. speed.
    pub lookahead: f64,
    /// Steps between checkpoints. The rollouts continue from the stored states, so a resumed run takes the
    /// same steps as an uninterrupted one.
    pub checkpoint_every: u64,
    /// Architecture and observation of the policy.
    pub policy: PolicyConfig,
    /// Seed of initial weights, sampled states and noise.
    pub seed: u64,
}

impl DaggerConfig {
    /// Full-size training.
    pub fn standard(policy: PolicyConfig) -> Self {
        Self {
            steps: 72_000,
            potential_only_fraction: 0.95,
            batch: 128,
            num_buffers: 64,
            threads: 2,
            learning_rate: 5e-4,
            warmup: 500,
            weight_decay: 1e-4,
            grad_clip_norm: 10.0,
            horizon: 90,
            horizon_ramp: [0.3, 0.6],
            noise: [0.12, 0.1, 0.3],
            observation_noise: 0.0,
            fingertip_weight: 3.0,
            metric_weight: 10.0,
            start_fraction: 0.25,
            gains: Gains { position: 225.0, velocity: 30.0 },
            lookahead: 0.2,
            checkpoint_every: 5000,
            policy,
            seed: 0,
        }
    }

    /// Training length that suits the dataset preset of the same name ([`crate::dataset::PRESETS`]).
    pub fn preset(name: &str, policy: PolicyConfig) -> Option<Self> {
        let standard = Self::standard(policy);
        Some(match name {
            "smoke" => Self { steps: 200, batch: 32, ..standard },
            "small" => Self { steps: 12_000, ..standard },
            "variants" | "families" | "generated" => Self { steps: 160_000, ..standard },
            "paper" => standard,
            _ => return None,
        })
    }

    /// Horizon of rollouts from start configurations: a third longer.
    pub fn start_horizon(&self) -> usize {
        self.horizon + self.horizon / 3
    }

    /// Fraction of the full horizon after `step` steps.
    pub fn horizon_fraction(&self, step: u64) -> f64 {
        let [start, end] = self.horizon_ramp.map(|fraction| fraction * self.steps as f64);
        if step as f64 >= end {
            1.0
        } else {
            ((step as f64 - start) / (end - start)).clamp(0.0, 1.0)
        }
    }
}

/// PD gains of the expert.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gains {
    /// k_p (1/s²).
    pub position: f64,
    /// k_d (1/s). Stable at 30 Hz if ½ k_p dt < k_d < 2 / dt = 60.
    pub velocity: f64,
}

impl Gains {
    /// Steady-state lag behind the target, in rows: k_d / k_p seconds, because Eq. 1 has no velocity
    /// feed-forward.
    pub fn lag_rows(&self, dt: f64) -> usize {
        (self.velocity / self.position / dt).round() as usize
    }
}
