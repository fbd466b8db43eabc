//! The NGF on a batch; the twin of `policy::ngf`. ∂ψ/∂q is built from forward operations, so that
//! one ordinary backward pass trains it.

use super::features::Features;
use super::gate::Gate;
use super::head::{Head, PACKED};
use super::transposed::Transposed;
use super::{Params, dense, mlp};
use anyhow::Result;
use candle_core::{DType, Device, Tensor};
use policy::fourier::{FREQUENCIES, Fourier};
use policy::mlp::Activation;
use policy::ngf::{
    DAMPING, DRIVING_METRIC, GEOMETRY, GEOMETRY_METRIC, NgfConfig, PARTS, POTENTIAL, inputs,
};
use rand_chacha::ChaCha8Rng;
use robot::{DOF, JointState, JointVector, Limits};
use std::ops::Range;

/// Bias of β_f in a fresh network, which then says one more: ELU + 1.
const FIRST_DAMPING: f32 = 50.0;
/// Layers of each network.
const LAYERS: usize = 4;

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

/// One of the five networks in a batch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Its index among the parts.
    pub part: usize,
    /// Where what it says stands among all outputs.
    pub columns: Range<usize>,
    /// How often its layers are gone through in a step.
    pub passes: usize,
}

/// Adds fresh parameters of the five networks. All but F_ψ begin with outputs of zero.
pub fn init(params: &mut Params, config: &NgfConfig, rng: &mut ChaCha8Rng) -> Result<()> {
    for (i, part) in PARTS.iter().enumerate() {
        let last = if i == POTENTIAL { 0.1 } else { 0.0 };
        params.add_mlp(part.name, &part.widths(config), last, rng)?;
    }
    // Damping begins at that of the expert instead of at one thirtieth of it: M begins near 2 I.
    let last = format!("{}.{}.bias", PARTS[DAMPING].name, LAYERS - 1);
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

    /// Those of the networks that take part.
    pub fn pieces(&self, active: Active) -> Vec<Piece> {
        let takes_part = |piece: &Piece| active == Active::All || piece.part == POTENTIAL;
        let mut end = 0;
        let mut piece = |part: usize| {
            let width = if part == POTENTIAL { DOF } else { PARTS[part].outputs };
            end += width;
            // Forward, and back by weight and by input; the slope of ψ goes back and forth once more.
            let passes = if part == POTENTIAL { 6 } else { 3 };
            Piece { part, columns: end - width..end, passes }
        };
        // As `Head` takes them.
        [GEOMETRY_METRIC, DRIVING_METRIC, GEOMETRY, POTENTIAL, DAMPING]
            .map(&mut piece)
            .into_iter()
            .filter(takes_part)
            .collect()
    }

    /// What a network says, shape (B, columns of the piece); of F_ψ its slope ∂ψ/∂q.
    pub fn output(
        &self,
        params: &Params,
        piece: &Piece,
        states: &[JointState],
        z: &[&[f32]],
    ) -> Result<Tensor> {
        match piece.part {
            POTENTIAL => self.potential_gradient(params, states, z),
            part => self.apply(params, part, states, z),
        }
    }

    /// What untrained networks say, a row as [`Head`] takes it: M = 2 I, χ = 0, constant damping.
    pub fn silence() -> Vec<f32> {
        let mut row = vec![0.0; PACKED];
        row[PACKED - 1] = FIRST_DAMPING;
        row
    }

    /// The fabric's accelerations, shape (B, DOF), from the networks' outputs.
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
        Ok(mlp(&features.tensor(), params, PARTS[part].name, LAYERS, Activation::Elu)?)
    }

    /// The features of one of the networks.
    fn features(&self, part: usize, states: &[JointState], z: &[&[f32]]) -> Result<Features> {
        let (fourier, frequencies) = &self.fourier[part];
        let mut x = Vec::with_capacity(states.len() * fourier.inputs);
        for (state, z) in states.iter().zip(z) {
            x.extend(inputs(&PARTS[part], &self.limits, state, z));
        }
        let x = Tensor::from_vec(x, (states.len(), fourier.inputs), &Device::Cpu)?;
        Ok(Features::of(&x.matmul(frequencies)?)?)
    }

    /// ∂ψ/∂q, shape (B, DOF): back through the layers, the features and the normalisation.
    fn potential_gradient(
        &self,
        params: &Params,
        states: &[JointState],
        z: &[&[f32]],
    ) -> Result<Tensor> {
        let name = PARTS[POTENTIAL].name;
        let features = self.features(POTENTIAL, states, z)?;
        let mut hidden = vec![features.tensor()];
        for layer in 0..LAYERS - 1 {
            let name = format!("{name}.{layer}");
            hidden.push(dense(&hidden[layer], params, &name, Some(Activation::Elu))?);
        }
        let last = params.tensor(&format!("{name}.{}.weight", LAYERS - 1))?;
        // The same in each row, as a product: it knows its gradient, and takes no time.
        let each = Tensor::ones((states.len(), 1), DType::F32, &Device::Cpu)?;
        let mut gradient = each.matmul(&last.t()?)?;
        for layer in (0..LAYERS - 1).rev() {
            let (weight, slot) = params.weight(&format!("{name}.{layer}.weight"))?;
            gradient = gradient.apply_op2(&hidden[layer + 1], Gate)?;
            gradient = gradient.apply_op2(&weight, Transposed { slot })?;
        }
        let of_phases = features.pull_back(&gradient)?;
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
        let mut params = Params::default();
        let config = NgfConfig::tiny();
        init(&mut params, &config, &mut ChaCha8Rng::seed_from_u64(9)).unwrap();
        let network = Ngf::new(&config, LATENT, &tree.limits).unwrap();
        let state = JointState {
            q: JointVector::from_fn(|i, _| 0.1 * i as f64),
            qd: JointVector::from_element(0.3),
        };
        let silence = Ngf::silence();
        let mut end = 0;
        for piece in network.pieces(Active::All) {
            assert_eq!(piece.columns.start, end);
            end = piece.columns.end;
            let says = network.output(&params, &piece, &[state], &[&[0.5; LATENT]]).unwrap();
            let says = says.to_vec2::<f32>().unwrap().remove(0);
            let is_silent = says == silence[piece.columns.clone()];
            assert_eq!(is_silent, network.pieces(Active::Potential) != [piece]);
        }
        assert_eq!(end, PACKED);
    }

    #[test]
    fn what_is_left_in_slots_is_what_the_tape_finds() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let config = NgfConfig::tiny();
        let mut params = Params::default();
        init(&mut params, &config, &mut ChaCha8Rng::seed_from_u64(2)).unwrap();
        let wave = |k: usize| 0.2 * libm::sinf((k * k % 1013) as f32);
        params.set_values(&(0..params.count()).map(wave).collect::<Vec<_>>()).unwrap();
        let network = Ngf::new(&config, LATENT, &tree.limits).unwrap();
        let state = |k: usize| JointState {
            q: JointVector::from_fn(|i, _| libm::sin((3 * k + i) as f64)),
            qd: JointVector::from_fn(|i, _| libm::cos((k + 2 * i) as f64)),
        };
        let (states, z) = ([state(0), state(1)], [0.3; LATENT]);
        let gradients = |params: &Params| {
            let output = |piece| network.output(params, piece, &states, &[&z, &z]).unwrap();
            let outputs: Vec<Tensor> = network.pieces(Active::All).iter().map(output).collect();
            let packed = Tensor::cat(&outputs, 1).unwrap().contiguous().unwrap();
            let made = Ngf::resolve(&packed, &states).unwrap();
            let store = made.sqr().unwrap().mean_all().unwrap().backward().unwrap();
            params.gradients(&store).unwrap()
        };
        let (of_tape, of_slots) = (gradients(&params), gradients(&params.of_shard()));
        for (name, (tape, slot)) in params.names().zip(of_tape.iter().zip(&of_slots)) {
            let values = |g: &Option<Tensor>| {
                let flat = g.as_ref().map(|g| g.flatten_all().unwrap());
                flat.map(|g| g.to_vec1::<f32>().unwrap())
            };
            let (Some(tape), Some(slot)) = (values(tape), values(slot)) else {
                // ψ itself is not needed: only its slope is.
                assert_eq!(name, "potential.3.bias");
                assert!(tape.is_none() && slot.is_none());
                continue;
            };
            let size = tape.iter().map(|g| g.abs()).fold(0.0, f32::max);
            let off = tape.iter().zip(&slot).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(size > 0.0 && off <= 1e-5 * size, "{name}: {off} of {size}");
        }
    }
}
