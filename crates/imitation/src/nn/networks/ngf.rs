//! Batched NGF; counterpart of `policy::networks::ngf`. ∂ψ/∂q consists of forward operations, so that one ordinary
//! backward pass trains it.

use crate::nn::ops::elu_backward::EluBackward;
use crate::nn::ops::fabric_head::{Head, PACKED};
use crate::nn::ops::fourier::FeatureBatch;
use crate::nn::ops::matmul_nt::MatmulNT;
use crate::nn::{Params, linear, mlp};
use anyhow::Result;
use candle_core::{DType, Device, Tensor};
use policy::NetworkInput;
use policy::networks::fourier::{FourierFeatures, NUM_FEATURES, NUM_FREQUENCIES};
use policy::networks::mlp::Activation;
use policy::networks::ngf::{
    DAMPING, DRIVING_METRIC, GEOMETRY, GEOMETRY_METRIC, NgfConfig, POTENTIAL, SUBNETWORKS, inputs,
};
use policy::networks::surface_vectors::{SURFACE_DIM, surface_jacobian, surface_vectors};
use rand_chacha::ChaCha8Rng;
use robot::{DOF, JointState, JointVector, KinematicTree};
use std::ops::Range;

/// Initial output bias of the β_f network. The initial β_f is larger by one: ELU + 1.
const INITIAL_DAMPING_BIAS: f32 = 50.0;
/// Number of layers of each network.
const NUM_LAYERS: usize = 4;

/// Fixed quantities of the fabric: joint limits, Fourier projections of the five networks, base potential.
pub struct Ngf {
    tree: KinematicTree,
    config: NgfConfig,
    fourier: Vec<(FourierFeatures, Tensor)>,
    /// ∂(normalised q)/∂q times the scale of ψ, shape (1, DOF).
    slope: Tensor,
}

/// Subset of the networks that is trained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrainableSet {
    /// All five networks.
    All,
    /// Only F_ψ, the network of the potential. The others have their initial outputs: M near 2 I, χ = 0,
    /// constant damping.
    Potential,
}

/// One of the five networks, and the location of its output in the packed row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SubnetOutput {
    /// Index into [`policy::networks::ngf::SUBNETWORKS`].
    pub subnetwork: usize,
    /// Columns of its output in the packed row.
    pub columns: Range<usize>,
    /// Number of passes through its layers per training step, as a cost estimate.
    pub passes: usize,
}

/// Adds random initial parameters of the five networks. All except F_ψ have zero initial outputs.
pub fn init(params: &mut Params, config: &NgfConfig, rng: &mut ChaCha8Rng) -> Result<()> {
    for (i, part) in SUBNETWORKS.iter().enumerate() {
        let last = if i == POTENTIAL { 0.1 } else { 0.0 };
        params.add_mlp(part.name, &part.widths(config), last, rng)?;
    }
    // With M near 2 I initially, this bias gives the damping of the expert; without it, one thirtieth of
    // that.
    let last = format!("{}.{}.bias", SUBNETWORKS[DAMPING].name, NUM_LAYERS - 1);
    params.add(&last, &[1], vec![INITIAL_DAMPING_BIAS])
}

impl Ngf {
    /// Samples the Fourier frequencies for observations of dimension `observation_dim`.
    pub fn new(config: &NgfConfig, observation_dim: usize, tree: &KinematicTree) -> Result<Self> {
        let fourier = SUBNETWORKS
            .iter()
            .enumerate()
            .map(|(i, part)| {
                let fourier = part.fourier(config, observation_dim, i);
                let shape = (fourier.num_inputs, NUM_FREQUENCIES);
                let tensor = Tensor::from_vec(fourier.frequencies.clone(), shape, &Device::Cpu)?;
                Ok((fourier, tensor))
            })
            .collect::<Result<_>>()?;
        let range = tree.limits.upper - tree.limits.lower;
        let slope: Vec<f32> =
            range.iter().map(|r| config.potential_scale * (2.0 / r) as f32).collect();
        let slope = Tensor::from_vec(slope, (1, DOF), &Device::Cpu)?;
        Ok(Self { tree: tree.clone(), config: config.clone(), fourier, slope })
    }

    /// The networks in the set `active`, in the order of the packed row.
    pub fn subnets(&self, active: TrainableSet) -> Vec<SubnetOutput> {
        let is_active =
            |subnet: &SubnetOutput| active == TrainableSet::All || subnet.subnetwork == POTENTIAL;
        let mut end = 0;
        let mut subnet = |part: usize| {
            let width = if part == POTENTIAL { DOF } else { SUBNETWORKS[part].num_outputs };
            end += width;
            // Forward, gradient by weight, gradient by input; ∂ψ/∂q doubles these.
            let passes = if part == POTENTIAL { 6 } else { 3 };
            SubnetOutput { subnetwork: part, columns: end - width..end, passes }
        };
        // Column order of `Head`.
        [GEOMETRY_METRIC, DRIVING_METRIC, GEOMETRY, POTENTIAL, DAMPING]
            .map(&mut subnet)
            .into_iter()
            .filter(is_active)
            .collect()
    }

    /// Output of a network, shape (B, number of its columns). For F_ψ the output is ∂ψ/∂q.
    pub fn output(
        &self,
        params: &Params,
        subnet: &SubnetOutput,
        states: &[JointState],
        z: &[&[f32]],
    ) -> Result<Tensor> {
        match subnet.subnetwork {
            POTENTIAL => self.potential_gradient(params, states, z),
            part => self.apply(params, part, states, z),
        }
    }

    /// Packed output row of the initial networks, as input of [`Head`]: M near 2 I, χ = 0, constant damping.
    pub fn inactive_output() -> Vec<f32> {
        let mut row = vec![0.0; PACKED];
        row[PACKED - 1] = INITIAL_DAMPING_BIAS;
        row
    }

    /// Accelerations of the fabric (rad/s²), shape (B, DOF), from the packed outputs (B, PACKED).
    pub fn resolve(packed: &Tensor, states: &[JointState]) -> Result<Tensor> {
        let qd: Vec<f32> = states.iter().flat_map(|s| s.qd.iter().map(|x| *x as f32)).collect();
        let qd = Tensor::from_vec(qd, (states.len(), DOF), &Device::Cpu)?;
        Ok(packed.apply_op2(&qd, Head::default())?)
    }

    fn apply(
        &self,
        params: &Params,
        part: usize,
        states: &[JointState],
        z: &[&[f32]],
    ) -> Result<Tensor> {
        let features = self.features(part, states, z)?;
        // Only F_ψ has further inputs, and it does not get here.
        Ok(mlp(&features.tensor(), params, SUBNETWORKS[part].name, NUM_LAYERS, Activation::Elu)?)
    }

    /// Fourier features of the inputs of one network.
    fn features(&self, part: usize, states: &[JointState], z: &[&[f32]]) -> Result<FeatureBatch> {
        let (fourier, frequencies) = &self.fourier[part];
        let mut x = Vec::with_capacity(states.len() * fourier.num_inputs);
        for (state, z) in states.iter().zip(z) {
            x.extend(inputs(part, &self.tree, &NetworkInput::new(*state, z)));
        }
        let x = Tensor::from_vec(x, (states.len(), fourier.num_inputs), &Device::Cpu)?;
        Ok(FeatureBatch::from_phases(&x.matmul(frequencies)?)?)
    }

    /// ∂ψ/∂q, shape (B, DOF): vector-Jacobian products of the layers, the features and the normalisation.
    fn potential_gradient(
        &self,
        params: &Params,
        states: &[JointState],
        z: &[&[f32]],
    ) -> Result<Tensor> {
        let name = SUBNETWORKS[POTENTIAL].name;
        let features = self.features(POTENTIAL, states, z)?;
        let mut hidden = vec![self.with_vectors(&features, states, z)?];
        for layer in 0..NUM_LAYERS - 1 {
            let name = format!("{name}.{layer}");
            hidden.push(linear(&hidden[layer], params, &name, Some(Activation::Elu))?);
        }
        let last = params.tensor(&format!("{name}.{}.weight", NUM_LAYERS - 1))?;
        // Repeats the weights in each row as a product, which is differentiable at negligible cost.
        let each = Tensor::ones((states.len(), 1), DType::F32, &Device::Cpu)?;
        let mut gradient = each.matmul(&last.t()?)?;
        for layer in (0..NUM_LAYERS - 1).rev() {
            let (weight, accumulator) = params.weight(&format!("{name}.{layer}.weight"))?;
            gradient = gradient.apply_op2(&hidden[layer + 1], EluBackward)?;
            gradient = gradient.apply_op2(&weight, MatmulNT { accumulator })?;
        }
        let of_phases = features.vjp(&gradient.narrow(1, 0, NUM_FEATURES)?)?;
        let frequencies = &self.fourier[POTENTIAL].1;
        let of_joints = of_phases.matmul(&frequencies.narrow(0, 0, DOF)?.t()?)?;
        let mut of_network = of_joints.broadcast_mul(&self.slope)?;
        if self.config.surface_vectors {
            let of_vectors = gradient.narrow(1, NUM_FEATURES, SURFACE_DIM)?;
            of_network = (of_network + self.pull_back(&of_vectors, states, z)?)?;
        }
        let NgfConfig { base_stiffness, potential_center, .. } = self.config;
        let center = JointVector::from(potential_center);
        let base: Vec<JointVector> =
            states.iter().map(|s| (s.q - center) * base_stiffness).collect();
        let base = base.iter().flat_map(|row| row.iter().map(|x| *x as f32)).collect();
        Ok((of_network + Tensor::from_vec::<_, f32>(base, (states.len(), DOF), &Device::Cpu)?)?)
    }

    /// Inputs of the first layer of F_ψ: features, then surface vectors if it has them.
    fn with_vectors(
        &self,
        features: &FeatureBatch,
        states: &[JointState],
        z: &[&[f32]],
    ) -> Result<Tensor> {
        if !self.config.surface_vectors {
            return Ok(features.tensor());
        }
        let vectors = states.iter().zip(z).flat_map(|(state, z)| {
            surface_vectors(&self.tree, &state.q, NetworkInput::new(*state, z).surface)
        });
        let shape = (states.len(), SURFACE_DIM);
        let vectors = Tensor::from_vec(vectors.collect::<Vec<f32>>(), shape, &Device::Cpu)?;
        Ok(Tensor::cat(&[features.tensor(), vectors], 1)?)
    }

    /// Gradient of ψ with respect to q, shape (B, DOF), from that with respect to the surface vectors.
    fn pull_back(
        &self,
        of_vectors: &Tensor,
        states: &[JointState],
        z: &[&[f32]],
    ) -> Result<Tensor> {
        let scale = self.config.potential_scale;
        let jacobians: Vec<f32> = states
            .iter()
            .zip(z)
            .flat_map(|(state, z)| {
                let surface = NetworkInput::new(*state, z).surface;
                // Column-major: the values of one joint are contiguous, as in a row-major transpose.
                let jacobian = surface_jacobian(&self.tree, &state.q, surface) * scale;
                jacobian.iter().copied().collect::<Vec<_>>()
            })
            .collect();
        let shape = (states.len(), DOF, SURFACE_DIM);
        let transposed = Tensor::from_vec(jacobians, shape, &Device::Cpu)?;
        let of_vectors = of_vectors.contiguous()?.unsqueeze(2)?;
        Ok(transposed.matmul(&of_vectors)?.squeeze(2)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::LATENT_DIM;
    use rand::SeedableRng;

    #[test]
    fn initial_networks_return_the_inactive_output() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let mut params = Params::default();
        let config = NgfConfig::tiny();
        init(&mut params, &config, &mut ChaCha8Rng::seed_from_u64(9)).unwrap();
        let network = Ngf::new(&config, LATENT_DIM, &tree).unwrap();
        let state = JointState {
            q: JointVector::from_fn(|i, _| 0.1 * i as f64),
            qd: JointVector::from_element(0.3),
        };
        let inactive = Ngf::inactive_output();
        let mut end = 0;
        for subnet in network.subnets(TrainableSet::All) {
            assert_eq!(subnet.columns.start, end);
            end = subnet.columns.end;
            let output = network.output(&params, &subnet, &[state], &[&[0.5; LATENT_DIM]]).unwrap();
            let output = output.to_vec2::<f32>().unwrap().remove(0);
            let is_inactive = output == inactive[subnet.columns.clone()];
            assert_eq!(is_inactive, network.subnets(TrainableSet::Potential) != [subnet]);
        }
        assert_eq!(end, PACKED);
    }

    #[test]
    fn accumulated_gradients_match_candle() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let config = NgfConfig::tiny();
        let mut params = Params::default();
        init(&mut params, &config, &mut ChaCha8Rng::seed_from_u64(2)).unwrap();
        let wave = |k: usize| 0.2 * libm::sinf((k * k % 1013) as f32);
        params.set_values(&(0..params.count()).map(wave).collect::<Vec<_>>()).unwrap();
        let network = Ngf::new(&config, LATENT_DIM, &tree).unwrap();
        let state = |k: usize| JointState {
            q: JointVector::from_fn(|i, _| libm::sin((3 * k + i) as f64)),
            qd: JointVector::from_fn(|i, _| libm::cos((k + 2 * i) as f64)),
        };
        let (states, z) = ([state(0), state(1)], [0.3; LATENT_DIM]);
        let gradients = |params: &Params| {
            let output = |subnet| network.output(params, subnet, &states, &[&z, &z]).unwrap();
            let outputs: Vec<Tensor> =
                network.subnets(TrainableSet::All).iter().map(output).collect();
            let packed = Tensor::cat(&outputs, 1).unwrap().contiguous().unwrap();
            let qdd = Ngf::resolve(&packed, &states).unwrap();
            let store = qdd.sqr().unwrap().mean_all().unwrap().backward().unwrap();
            params.gradients(&store).unwrap()
        };
        let (reference, accumulated) = (gradients(&params), gradients(&params.with_accumulators()));
        for (name, (expected, got)) in params.names().zip(reference.iter().zip(&accumulated)) {
            let values = |g: &Option<Tensor>| {
                let flat = g.as_ref().map(|g| g.flatten_all().unwrap());
                flat.map(|g| g.to_vec1::<f32>().unwrap())
            };
            let (Some(expected), Some(got)) = (values(expected), values(got)) else {
                // ψ itself is not evaluated, only its gradient.
                assert_eq!(name, "potential.3.bias");
                assert!(expected.is_none() && got.is_none());
                continue;
            };
            let size = expected.iter().map(|g| g.abs()).fold(0.0, f32::max);
            let error = expected.iter().zip(&got).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(size > 0.0 && error <= 1e-5 * size, "{name}: error {error} of {size}");
        }
    }
}
