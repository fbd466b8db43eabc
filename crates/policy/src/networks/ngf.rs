//! The Neural Geometric Fabric: five networks over (q, q̇, z), combined by Eq. 3 (paper §III-B).
//!
//! q is in the canonical frame, with the object at azimuth 0 ([`crate::observation`]).

use crate::networks::NetworkInput;
#[cfg(doc)]
use crate::networks::ObservationKind;
use crate::networks::fabric_head::{NetworkOutputs, TRIANGLE_ENTRIES, unit_velocity};
use crate::networks::fourier::{FourierFeatures, InputBlock, NUM_FEATURES};
use crate::networks::mlp::{Activation, Mlp};
use crate::networks::surface_vectors::{self, SURFACE_DIM};
use crate::weights::{Tensors, WeightsError};
use robot::{DOF, JointVector, KinematicTree};

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
    /// Whether the vectors from the hand to the nearest seen surface ([`surface_vectors`]) follow the features of F_ψ
    /// as further inputs of its first layer. They need [`ObservationKind::CloudAndSurface`].
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub surface_vectors: bool,
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
            surface_vectors: false,
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
        match self.velocity {
            VelocityInput::Absent => FourierFeatures::new(&[q, z], seed),
            _ => FourierFeatures::new(&[q, qd, z], seed),
        }
    }

    /// Layer widths, features first.
    pub fn widths(&self, config: &NgfConfig) -> [usize; 5] {
        let has_vectors = config.surface_vectors && self.name == SUBNETWORKS[POTENTIAL].name;
        let inputs = NUM_FEATURES + if has_vectors { SURFACE_DIM } else { 0 };
        [inputs, config.hidden, config.hidden, config.hidden, self.num_outputs]
    }
}

/// Inputs of the features of the network of an index of [`SUBNETWORKS`] (dimensionless): normalised q, the velocity if
/// it has one, z.
pub fn inputs(index: usize, tree: &KinematicTree, input: &NetworkInput) -> Vec<f32> {
    let NetworkInput { state, latent, .. } = input;
    let mut x: Vec<f32> = tree.limits.normalize(&state.q).iter().map(|&q| q as f32).collect();
    match SUBNETWORKS[index].velocity {
        VelocityInput::Absent => {}
        VelocityInput::Unit => x.extend(unit_velocity(&state.qd).iter().map(|&v| v as f32)),
        VelocityInput::Full => x.extend(state.qd.iter().map(|&v| (v / SPEED_SCALE) as f32)),
    }
    x.extend(*latent);
    x
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
        let width = features.len() / batch.len().max(1);
        let row = |i: usize| {
            let entries = i * TRIANGLE_ENTRIES..(i + 1) * TRIANGLE_ENTRIES;
            let of_row = i * width..(i + 1) * width;
            NetworkOutputs {
                geometry_metric: geometry_metrics[entries.clone()].to_vec(),
                geometry: geometries[i * DOF..(i + 1) * DOF].to_vec(),
                driving_metric: driving_metrics[entries].to_vec(),
                potential_gradient: self.potential_gradient(
                    &batch[i],
                    &features[of_row.clone()],
                    &feature_gradients[of_row],
                ),
                damping: damping[i],
            }
        };
        (0..batch.len()).map(row).collect()
    }

    /// Inputs of the first layer of network `i`, shape (batch, NUM_FEATURES), or (batch, NUM_FEATURES + SURFACE_DIM):
    /// Fourier features, then surface vectors.
    fn features(&self, i: usize, batch: &[NetworkInput]) -> Vec<f32> {
        let row = |input: &NetworkInput| inputs(i, &self.tree, input);
        let features =
            self.networks[i].0.features(&batch.iter().flat_map(row).collect::<Vec<f32>>());
        if i != POTENTIAL || !self.config.surface_vectors {
            return features;
        }
        let rows = batch.iter().zip(features.chunks_exact(NUM_FEATURES));
        let with_vectors = rows.flat_map(|(input, features)| {
            let vectors =
                surface_vectors::surface_vectors(&self.tree, &input.state.q, input.surface);
            features.iter().copied().chain(vectors)
        });
        with_vectors.collect()
    }

    /// ∂ψ/∂q at a state, given the features and the gradient with respect to them.
    fn potential_gradient(&self, input: &NetworkInput, features: &[f32], of: &[f32]) -> Vec<f32> {
        let state = &input.state;
        let (of_features, of_vectors) = of.split_at(NUM_FEATURES);
        let of_joints = self.networks[POTENTIAL].0.vjp(&features[..NUM_FEATURES], of_features, DOF);
        // q is normalised over its range, which maps to two units.
        let limits = &self.tree.limits;
        let per_radian = (limits.upper - limits.lower).map(|range| 2.0 / range as f32);
        let scale = self.config.potential_scale;
        let joints = of_joints.iter().zip(&per_radian);
        let mut of_q: Vec<f32> = joints.map(|(g, per_radian)| g * scale * per_radian).collect();
        if !of_vectors.is_empty() {
            let jacobian = surface_vectors::surface_jacobian(&self.tree, &state.q, input.surface);
            for (joint, g) in of_q.iter_mut().enumerate() {
                let column = of_vectors.iter().enumerate().map(|(i, v)| jacobian[(i, joint)] * v);
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
    use crate::networks::ObservationKind;
    use crate::networks::mlp::Dense;
    use robot::JointState;

    /// An NGF with weights of order one, and an observation for it.
    fn wavy(config: NgfConfig) -> (Ngf, Vec<f32>) {
        let kind = match config.surface_vectors {
            true => ObservationKind::CloudAndSurface,
            false => ObservationKind::Cloud,
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
            (subnetwork.fourier(&config, kind.num_features(), i), mlp)
        };
        let networks = SUBNETWORKS.iter().enumerate().map(network).collect();
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        // A single surface point: ψ is not continuous where the nearest point changes.
        let surface_point = [0.4, 0.1, 0.05];
        let value = |i: usize| match i.checked_sub(kind.num_features()) {
            Some(i) => surface_point[i % 3],
            None => libm::cosf(i as f32),
        };
        let observation = (0..kind.dim()).map(value).collect();
        (Ngf { tree, config: config.clone(), networks }, observation)
    }

    #[test]
    fn driving_force_is_the_gradient_of_the_potential() {
        for surface_vectors in [false, true] {
            // Unit scale and no quadratic potential: single precision then resolves the network's gradient.
            let config = NgfConfig {
                base_stiffness: 0.0,
                potential_scale: 1.0,
                surface_vectors,
                ..NgfConfig::tiny()
            };
            let (mut ngf, z) = wavy(config);
            let at = |q: JointVector| NetworkInput::new(JointState::at_rest(q), &z);
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
