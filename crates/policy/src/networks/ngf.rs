//! The Neural Geometric Fabric: five networks over (q, q̇, z), combined by Eq. 3 (paper §III-B).
//!
//! q is in the canonical frame, with the object at azimuth 0 ([`crate::observation`]).

use crate::networks::fabric_head::{NetworkOutputs, TRIANGLE_ENTRIES, unit_velocity};
use crate::networks::fourier::{FourierFeatures, InputBlock, NUM_FEATURES};
use crate::networks::hand_points::{self, HAND_DIM};
use crate::networks::mlp::{Activation, Mlp};
use crate::networks::{NetworkInput, ObservationKind};
use crate::weights::{Tensors, WeightsError};
use robot::{DOF, JointState, JointVector, KinematicTree};

/// Number of units of each hidden layer (paper: three layers of 512).
pub const HIDDEN_WIDTH: usize = 512;

/// Maximum number of units; larger values are rejected as invalid.
const MAX_HIDDEN: usize = 4096;

/// Speed (rad/s) per unit of network input.
pub const SPEED_SCALE: f64 = 1.0;

/// Architecture and scales of the five networks.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NgfConfig {
    /// Number of units of each hidden layer.
    pub hidden: usize,
    /// Seed of the Fourier frequencies.
    pub frequency_seed: u64,
    /// Length scale of q, which is normalised to ±1 at the limits.
    pub position_scale: f32,
    /// Length scale of q̇: of the unit velocity, and of the velocity over [`SPEED_SCALE`].
    pub velocity_scale: f32,
    /// Length scale of z after whitening.
    pub latent_scale: f32,
    /// Length scale of q in F_ψ, if it differs from `position_scale`. The policy uses the gradient of F_ψ: it
    /// decorrelates over half the distance of a value with the same length scale.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub potential_position_scale: Option<f32>,
    /// Length scale of z in F_ψ, if it differs from `latent_scale`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub potential_latent_scale: Option<f32>,
    /// Length scale of the hand's position relative to the object ([`hand_points`]), an additional input of F_ψ.
    /// `None`: no such input. It needs [`crate::ObservationKind::CloudAndBox`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hand_scale: Option<f32>,
    /// ψ per unit of network output, so that weights of order one yield accelerations of tens of rad/s².
    pub potential_scale: f32,
    /// κ: stiffness of a quadratic potential ½ κ |q - q̄|² that is added to ψ.
    ///
    /// *Departure: the paper's potential is a network only. For every object, the expert returns to its path
    /// with the same stiffness in every direction. This stiffness is given (225/s² where M is about 2 I, as
    /// in an untrained network), and F_ψ learns the centre of attraction.*
    pub base_stiffness: f64,
    /// q̄ (rad): centre of the quadratic potential; the mean of the demonstrations in the canonical frame.
    pub potential_center: [f64; DOF],
}

impl NgfConfig {
    /// The paper's sizes; seed and length scales are ours.
    pub fn paper() -> Self {
        Self {
            hidden: HIDDEN_WIDTH,
            frequency_seed: 2309,
            position_scale: 2.0,
            velocity_scale: 3.0,
            latent_scale: 16.0,
            potential_position_scale: None,
            potential_latent_scale: None,
            hand_scale: None,
            potential_scale: 100.0,
            base_stiffness: 450.0,
            potential_center: [0.0; DOF],
        }
    }

    /// Small networks for tests.
    pub fn tiny() -> Self {
        Self { hidden: 32, ..Self::paper() }
    }

    /// Rejects values from which no networks can be built; the error names the value.
    pub fn validate(&self) -> Result<(), WeightsError> {
        let reject = |name: &str, value: f64| {
            Err(WeightsError::InvalidValue { name: name.to_owned(), value: value.to_string() })
        };
        if !(1..=MAX_HIDDEN).contains(&self.hidden) {
            return reject("hidden", self.hidden as f64);
        }
        let [potential_position, potential_latent] = self.length_scales(POTENTIAL);
        let scales = [
            ("position_scale", self.position_scale),
            ("velocity_scale", self.velocity_scale),
            ("latent_scale", self.latent_scale),
            ("potential_position_scale", potential_position),
            ("potential_latent_scale", potential_latent),
            ("hand_scale", self.hand_scale.unwrap_or(1.0)),
        ];
        for (name, scale) in scales {
            if !(scale.is_finite() && scale > 0.0) {
                return reject(name, f64::from(scale));
            }
        }
        let numbers = [
            ("potential_scale", f64::from(self.potential_scale)),
            ("base_stiffness", self.base_stiffness),
        ];
        let center = self.potential_center.iter().map(|q| ("potential_center", *q));
        match numbers.into_iter().chain(center).find(|(_, value)| !value.is_finite()) {
            Some((name, value)) => reject(name, value),
            None => Ok(()),
        }
    }

    /// Length scales of q and z in the network of an index of [`SUBNETWORKS`].
    fn length_scales(&self, index: usize) -> [f32; 2] {
        let common = [self.position_scale, self.latent_scale];
        let of_potential = [self.potential_position_scale, self.potential_latent_scale];
        match index {
            POTENTIAL => std::array::from_fn(|i| of_potential[i].unwrap_or(common[i])),
            _ => common,
        }
    }
}

/// Velocity input of a network, in addition to q and z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VelocityInput {
    /// Unit velocity q̇ / |q̇|.
    Unit,
    /// No velocity input.
    Absent,
    /// Velocity q̇ over [`SPEED_SCALE`].
    Full,
}

/// One of the five networks of the NGF.
#[derive(Clone, Copy, Debug)]
pub struct Subnetwork {
    /// Prefix of its tensor names in the weights.
    pub name: &'static str,
    /// Velocity input.
    pub velocity: VelocityInput,
    /// Number of outputs.
    pub num_outputs: usize,
}

/// F_g, F_χ, F_f, F_ψ, F_β (paper §III-B).
pub const SUBNETWORKS: [Subnetwork; 5] = [
    Subnetwork {
        name: "geometry_metric",
        velocity: VelocityInput::Unit,
        num_outputs: TRIANGLE_ENTRIES,
    },
    Subnetwork { name: "geometry", velocity: VelocityInput::Unit, num_outputs: DOF },
    Subnetwork {
        name: "driving_metric",
        velocity: VelocityInput::Absent,
        num_outputs: TRIANGLE_ENTRIES,
    },
    Subnetwork { name: "potential", velocity: VelocityInput::Absent, num_outputs: 1 },
    Subnetwork { name: "damping", velocity: VelocityInput::Full, num_outputs: 1 },
];

/// Index of F_g in [`SUBNETWORKS`].
pub const GEOMETRY_METRIC: usize = 0;
/// Index of F_χ in [`SUBNETWORKS`].
pub const GEOMETRY: usize = 1;
/// Index of F_f in [`SUBNETWORKS`].
pub const DRIVING_METRIC: usize = 2;
/// Index of F_ψ in [`SUBNETWORKS`].
pub const POTENTIAL: usize = 3;
/// Index of F_β in [`SUBNETWORKS`].
pub const DAMPING: usize = 4;

impl Subnetwork {
    /// Fourier features of this network: q first, then velocity, then the `observation_dim` values of z.
    pub fn fourier(
        &self,
        config: &NgfConfig,
        observation_dim: usize,
        index: usize,
    ) -> FourierFeatures {
        let [position_scale, latent_scale] = config.length_scales(index);
        let q = InputBlock { size: DOF, length_scale: position_scale };
        let qd = InputBlock { size: DOF, length_scale: config.velocity_scale };
        let z = InputBlock { size: observation_dim, length_scale: latent_scale };
        let seed = config.frequency_seed.wrapping_add(index as u64);
        if let Some(length_scale) = config.hand_scale.filter(|_| index == POTENTIAL) {
            let hand = InputBlock { size: HAND_DIM, length_scale };
            return FourierFeatures::new(&[q, hand, z], seed);
        }
        match self.velocity {
            VelocityInput::Absent => FourierFeatures::new(&[q, z], seed),
            _ => FourierFeatures::new(&[q, qd, z], seed),
        }
    }

    /// Layer widths, features first.
    pub fn widths(&self, config: &NgfConfig) -> [usize; 5] {
        [NUM_FEATURES, config.hidden, config.hidden, config.hidden, self.num_outputs]
    }
}

/// Inputs of the network of an index of [`SUBNETWORKS`] (dimensionless): normalised q, the hand's position or the
/// velocity if it has one, z.
pub fn inputs(
    index: usize,
    config: &NgfConfig,
    tree: &KinematicTree,
    input: &NetworkInput,
) -> Vec<f32> {
    let NetworkInput { state, latent } = input;
    let mut x: Vec<f32> = tree.limits.normalize(&state.q).iter().map(|&q| q as f32).collect();
    if index == POTENTIAL && config.hand_scale.is_some() {
        x.extend(hand_points::hand_inputs(tree, &state.q, latent));
    }
    match SUBNETWORKS[index].velocity {
        VelocityInput::Absent => {}
        VelocityInput::Unit => x.extend(unit_velocity(&state.qd).iter().map(|&v| v as f32)),
        VelocityInput::Full => x.extend(state.qd.iter().map(|&v| (v / SPEED_SCALE) as f32)),
    }
    x.extend(*latent);
    x
}

/// Number of inputs of F_ψ that depend on q; they come first.
pub fn num_position_inputs(config: &NgfConfig) -> usize {
    DOF + if config.hand_scale.is_some() { HAND_DIM } else { 0 }
}

/// The NGF with its weights.
#[derive(Clone, Debug)]
pub struct Ngf {
    tree: KinematicTree,
    config: NgfConfig,
    networks: Vec<(FourierFeatures, Mlp)>,
}

impl Ngf {
    /// Loads the five networks, for an observation of `observation_dim` values.
    pub fn load(
        tensors: &Tensors,
        config: &NgfConfig,
        observation_dim: usize,
        tree: &KinematicTree,
    ) -> Result<Self, WeightsError> {
        config.validate()?;
        if config.hand_scale.is_some() && observation_dim != ObservationKind::CloudAndBox.dim() {
            return Err(WeightsError::InvalidValue {
                name: "hand_scale".into(),
                value: "set, but the observation has no box".into(),
            });
        }
        let network = |(i, subnetwork): (usize, &Subnetwork)| {
            let mlp =
                Mlp::load(tensors, subnetwork.name, &subnetwork.widths(config), Activation::Elu)?;
            Ok((subnetwork.fourier(config, observation_dim, i), mlp))
        };
        let networks =
            SUBNETWORKS.iter().enumerate().map(network).collect::<Result<_, WeightsError>>()?;
        Ok(Self { tree: tree.clone(), config: config.clone(), networks })
    }

    /// Outputs of the networks for a batch, with ∂ψ/∂q by the chain rule through the features.
    pub fn outputs(&self, batch: &[NetworkInput]) -> Vec<NetworkOutputs> {
        let apply = |i: usize| self.networks[i].1.apply(&self.features(i, batch));
        let (geometry_metrics, geometries) = (apply(GEOMETRY_METRIC), apply(GEOMETRY));
        let (driving_metrics, damping) = (apply(DRIVING_METRIC), apply(DAMPING));
        let features = self.features(POTENTIAL, batch);
        let feature_gradients = self.networks[POTENTIAL].1.gradient(&features);
        let row = |i: usize| {
            let entries = i * TRIANGLE_ENTRIES..(i + 1) * TRIANGLE_ENTRIES;
            let of_row = i * NUM_FEATURES..(i + 1) * NUM_FEATURES;
            NetworkOutputs {
                geometry_metric: geometry_metrics[entries.clone()].to_vec(),
                geometry: geometries[i * DOF..(i + 1) * DOF].to_vec(),
                driving_metric: driving_metrics[entries].to_vec(),
                potential_gradient: self.potential_gradient(
                    &batch[i].state,
                    &features[of_row.clone()],
                    &feature_gradients[of_row],
                ),
                damping: damping[i],
            }
        };
        (0..batch.len()).map(row).collect()
    }

    /// Fourier features of network `i`, shape (batch, NUM_FEATURES).
    fn features(&self, i: usize, batch: &[NetworkInput]) -> Vec<f32> {
        let row = |input: &NetworkInput| inputs(i, &self.config, &self.tree, input);
        self.networks[i].0.features(&batch.iter().flat_map(row).collect::<Vec<f32>>())
    }

    /// ∂ψ/∂q at a state, given the features and the gradient with respect to them.
    fn potential_gradient(&self, state: &JointState, features: &[f32], of: &[f32]) -> Vec<f32> {
        let count = num_position_inputs(&self.config);
        let gradient = self.networks[POTENTIAL].0.vjp(features, of, count);
        let (of_joints, of_hand) = gradient.split_at(DOF);
        // q is normalised over its range, which maps to two units.
        let limits = &self.tree.limits;
        let per_radian = (limits.upper - limits.lower).map(|range| 2.0 / range as f32);
        let scale = self.config.potential_scale;
        let joints = of_joints.iter().zip(&per_radian);
        let mut of_q: Vec<f32> = joints.map(|(g, per_radian)| g * scale * per_radian).collect();
        if !of_hand.is_empty() {
            let jacobian = hand_points::hand_jacobian(&self.tree, &state.q);
            for (joint, g) in of_q.iter_mut().enumerate() {
                let column = of_hand.iter().enumerate().map(|(i, h)| jacobian[(i, joint)] * h);
                *g += scale * column.sum::<f32>();
            }
        }
        let center = JointVector::from(self.config.potential_center);
        let quadratic = (state.q - center) * self.config.base_stiffness;
        of_q.iter().zip(&quadratic).map(|(g, k)| g + *k as f32).collect()
    }

    /// q̈ (rad/s²) for each input of a batch; `None` where it is not finite.
    pub fn accelerations(&self, batch: &[NetworkInput]) -> Vec<Option<JointVector>> {
        let acceleration = |(outputs, input): (NetworkOutputs, &NetworkInput)| {
            let qd = &input.state.qd;
            let qdd = outputs.fabric(qd).acceleration(qd)?;
            qdd.iter().all(|x| x.is_finite()).then_some(qdd)
        };
        self.outputs(batch).into_iter().zip(batch).map(acceleration).collect()
    }

    /// The potential ψ(q, z): quadratic potential plus network.
    pub fn potential(&self, input: &NetworkInput) -> f32 {
        let center = JointVector::from(self.config.potential_center);
        let distance = (input.state.q - center).norm_squared();
        let features = self.features(POTENTIAL, std::slice::from_ref(input));
        let network = self.networks[POTENTIAL].1.apply(&features)[0];
        (0.5 * self.config.base_stiffness * distance) as f32 + self.config.potential_scale * network
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::networks::mlp::Dense;

    /// An NGF with weights of order one, and an observation for it.
    fn wavy(config: NgfConfig) -> (Ngf, Vec<f32>) {
        let kind = match config.hand_scale {
            Some(_) => ObservationKind::CloudAndBox,
            None => ObservationKind::Cloud,
        };
        let dense = |(i, pair): (usize, &[usize])| {
            let wave = |k: usize| libm::sinf((k * k + i) as f32);
            let weight = (0..pair[0] * pair[1]).map(|k| 2.0 * wave(k) / (pair[0] as f32).sqrt());
            Dense {
                weight: weight.map(half::f16::from_f32).collect(),
                bias: (0..pair[1]).map(wave).collect(),
            }
        };
        let network = |(i, subnetwork): (usize, &Subnetwork)| {
            let layers = subnetwork.widths(&config).windows(2).enumerate().map(dense).collect();
            let mlp = Mlp { layers, activation: Activation::Elu };
            (subnetwork.fourier(&config, kind.dim(), i), mlp)
        };
        let networks = SUBNETWORKS.iter().enumerate().map(network).collect();
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let observation = (0..kind.dim()).map(|i| libm::cosf(i as f32)).collect();
        (Ngf { tree, config: config.clone(), networks }, observation)
    }

    #[test]
    fn driving_force_is_the_gradient_of_the_potential() {
        for hand_scale in [None, Some(12.0)] {
            // Unit scale and no quadratic potential: single precision then resolves the network's gradient.
            let config = NgfConfig {
                base_stiffness: 0.0,
                potential_scale: 1.0,
                hand_scale,
                ..NgfConfig::tiny()
            };
            let (mut ngf, z) = wavy(config);
            let at = |q: JointVector| NetworkInput { state: JointState::at_rest(q), latent: &z };
            let q = JointVector::from_fn(|i, _| 0.5 * libm::sin(i as f64));
            let gradient = ngf.outputs(&[at(q)])[0].potential_gradient.clone();
            let step = 0.005;
            let size = gradient.iter().map(|g| g.abs()).fold(1.0, f32::max);
            for i in 0..DOF {
                let mut shift = JointVector::zeros();
                shift[i] = step;
                let rise = ngf.potential(&at(q + shift)) - ngf.potential(&at(q - shift));
                let wanted = rise / (2.0 * step as f32);
                let error = (gradient[i] - wanted).abs();
                assert!(error < 1e-2 * size, "{i}: {} against {wanted}", gradient[i]);
            }
            // The quadratic potential adds κ (q - q̄).
            ngf.config.base_stiffness = 450.0;
            ngf.config.potential_center = std::array::from_fn(|i| 0.1 * i as f64);
            let offset = q - JointVector::from(ngf.config.potential_center);
            for (i, got) in ngf.outputs(&[at(q)])[0].potential_gradient.iter().enumerate() {
                let wanted = gradient[i] + 450.0 * offset[i] as f32;
                assert!((got - wanted).abs() < 1e-3, "{i}: {got} against {wanted}");
            }
        }
    }
}
