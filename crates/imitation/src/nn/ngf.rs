//! The NGF on a batch; the twin of `policy::ngf`. ∂ψ/∂q is built from forward operations, so that
//! one ordinary backward pass trains it.

use super::head::Head;
use super::{Params, dense, mlp};
use anyhow::Result;
use candle_core::{Device, Tensor};
use policy::fourier::{FREQUENCIES, Fourier};
use policy::mlp::Activation;
use policy::ngf::{NgfConfig, PARTS, inputs};
use rand_chacha::ChaCha8Rng;
use robot::{DOF, JointState, JointVector, Limits};

/// β_f of a fresh network.
const FIRST_DAMPING: f32 = 50.0;
/// Layers of each network.
const LAYERS: usize = 4;
/// Index of F_ψ among the parts.
const POTENTIAL: usize = 3;

/// The five networks' fixed projections.
pub struct Ngf {
    limits: Limits,
    fourier: Vec<(Fourier, Tensor)>,
    /// ∂(normalised q)/∂q times the scale of ψ, shape (1, DOF).
    slope: Tensor,
    /// κ of the bowl, and its middle.
    bowl: f64,
    rest: JointVector,
}

/// Which of the networks take part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Active {
    /// All five.
    All,
    /// F_ψ; the others say what they say before any training: M = 2 I, χ = 0, constant damping.
    Potential,
}

/// Adds fresh parameters of the five networks. All but F_ψ begin with outputs of zero.
pub fn init(params: &mut Params, config: &NgfConfig, rng: &mut ChaCha8Rng) -> Result<()> {
    for (i, part) in PARTS.iter().enumerate() {
        let last = if i == POTENTIAL { 0.1 } else { 0.0 };
        params.add_mlp(part.name, &part.widths(config), last, rng)?;
    }
    // Damping begins at that of the expert instead of at one thirtieth of it: M begins near 2 I.
    let last = format!("{}.{}.bias", PARTS[4].name, LAYERS - 1);
    params.add(&last, &[1], vec![FIRST_DAMPING])
}

impl Ngf {
    /// Draws the frequencies; `object` numbers tell of the object.
    pub fn new(config: &NgfConfig, object: usize, limits: &Limits) -> Result<Self> {
        let fourier = PARTS
            .iter()
            .enumerate()
            .map(|(i, part)| {
                let fourier = part.fourier(config, object, i);
                let shape = (fourier.inputs, FREQUENCIES);
                let tensor = Tensor::from_vec(fourier.frequencies.clone(), shape, &Device::Cpu)?;
                Ok((fourier, tensor))
            })
            .collect::<Result<_>>()?;
        let range = limits.upper - limits.lower;
        let slope: Vec<f32> =
            range.iter().map(|r| config.potential_scale * (2.0 / r) as f32).collect();
        let slope = Tensor::from_vec(slope, (1, DOF), &Device::Cpu)?;
        let rest = JointVector::from(config.rest);
        Ok(Self { limits: limits.clone(), fourier, slope, bowl: config.bowl, rest })
    }

    /// Accelerations, shape (B, DOF), for states and latents of a batch.
    pub fn accelerations(
        &self,
        params: &Params,
        states: &[JointState],
        z: &[&[f32]],
    ) -> Result<Tensor> {
        Self::resolve(&self.outputs(params, states, z, Active::All)?, states)
    }

    /// What the networks say, as [`Head`] takes it: shape (B, PACKED).
    pub fn outputs(
        &self,
        params: &Params,
        states: &[JointState],
        z: &[&[f32]],
        active: Active,
    ) -> Result<Tensor> {
        let network = |part: usize| match active {
            Active::All => self.apply(params, part, states, z),
            Active::Potential => Self::untrained(part, states.len()),
        };
        let gradient = self.potential_gradient(params, states, z)?;
        let packed = [network(0)?, network(2)?, network(1)?, gradient, network(4)?];
        Ok(Tensor::cat(&packed, 1)?.contiguous()?)
    }

    /// What a network of [`init`] says.
    fn untrained(part: usize, rows: usize) -> Result<Tensor> {
        let says = if part == PARTS.len() - 1 { FIRST_DAMPING } else { 0.0 };
        Ok(Tensor::full(says, (rows, PARTS[part].outputs), &Device::Cpu)?)
    }

    /// The fabric's accelerations, shape (B, DOF), from the networks' outputs.
    pub fn resolve(packed: &Tensor, states: &[JointState]) -> Result<Tensor> {
        let qd: Vec<f32> = states.iter().flat_map(|s| s.qd.iter().map(|x| *x as f32)).collect();
        let qd = Tensor::from_vec(qd, (states.len(), DOF), &Device::Cpu)?;
        Ok(packed.apply_op2(&qd, Head)?)
    }

    fn apply(
        &self,
        params: &Params,
        part: usize,
        states: &[JointState],
        z: &[&[f32]],
    ) -> Result<Tensor> {
        let (cos, sin) = self.features(part, states, z)?;
        let features = Tensor::cat(&[cos, sin], 1)?;
        Ok(mlp(&features, params, PARTS[part].name, LAYERS, Activation::Elu)?)
    }

    /// Cosines and sines, each (B, FREQUENCIES); constants of the graph.
    fn features(
        &self,
        part: usize,
        states: &[JointState],
        z: &[&[f32]],
    ) -> Result<(Tensor, Tensor)> {
        let (fourier, frequencies) = &self.fourier[part];
        let x: Vec<f32> = states
            .iter()
            .zip(z)
            .flat_map(|(state, z)| inputs(&PARTS[part], &self.limits, state, z))
            .collect();
        let x = Tensor::from_vec(x, (states.len(), fourier.inputs), &Device::Cpu)?;
        let phases = x.matmul(frequencies)?;
        Ok((phases.cos()?, phases.sin()?))
    }

    /// ∂ψ/∂q, shape (B, DOF): back through the layers, the features and the normalisation.
    fn potential_gradient(
        &self,
        params: &Params,
        states: &[JointState],
        z: &[&[f32]],
    ) -> Result<Tensor> {
        let name = PARTS[POTENTIAL].name;
        let (cos, sin) = self.features(POTENTIAL, states, z)?;
        let mut h = Tensor::cat(&[&cos, &sin], 1)?;
        let mut slopes = Vec::new();
        for layer in 0..LAYERS - 1 {
            h = dense(&h, params, &format!("{name}.{layer}"), Some(Activation::Elu))?;
            // ELU's derivative, told from its value: e^x = (e^x - 1) + 1.
            slopes.push((h.minimum(0f64)? + 1.0)?);
        }
        let last = params.tensor(&format!("{name}.{}.weight", LAYERS - 1))?;
        let mut gradient = slopes[LAYERS - 2].broadcast_mul(&last.t()?)?;
        for layer in (0..LAYERS - 1).rev() {
            let weight = params.tensor(&format!("{name}.{layer}.weight"))?;
            gradient = gradient.matmul(&weight.t()?)?;
            if layer > 0 {
                gradient = (gradient * &slopes[layer - 1])?;
            }
        }
        let of_cos = gradient.narrow(1, 0, FREQUENCIES)?;
        let of_sin = gradient.narrow(1, FREQUENCIES, FREQUENCIES)?;
        let of_phases = ((of_sin * &cos)? - (of_cos * &sin)?)?;
        let frequencies = self.fourier[POTENTIAL].1.narrow(0, 0, DOF)?.t()?;
        let of_network = of_phases.matmul(&frequencies)?.broadcast_mul(&self.slope)?;
        let pulls: Vec<JointVector> =
            states.iter().map(|s| (s.q - self.rest) * self.bowl).collect();
        let bowl = pulls.iter().flat_map(|pull| pull.iter().map(|x| *x as f32)).collect();
        Ok((of_network + Tensor::from_vec::<_, f32>(bowl, (states.len(), DOF), &Device::Cpu)?)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::encoder::LATENT;
    use rand::SeedableRng;
    use robot::Tree;

    #[test]
    fn untrained_networks_say_what_is_said_for_them() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let config = NgfConfig { bowl: 450.0, ..NgfConfig::tiny() };
        let mut params = Params::default();
        init(&mut params, &config, &mut ChaCha8Rng::seed_from_u64(9)).unwrap();
        let network = Ngf::new(&config, LATENT, &tree.limits).unwrap();
        let state = JointState {
            q: JointVector::from_fn(|i, _| 0.1 * i as f64),
            qd: JointVector::from_element(0.3),
        };
        let z = [0.5; LATENT];
        let says = |active| {
            let outputs = network.outputs(&params, &[state], &[&z], active).unwrap();
            outputs.to_vec2::<f32>().unwrap().remove(0)
        };
        assert_eq!(says(Active::All), says(Active::Potential));
    }
}
