//! The Neural Geometric Fabric: five networks over (q, q̇, z), combined by Eq. 3 (paper §III-B).
//!
//! q is that with the object in front of the robot ([`crate::encoding`]).

use crate::fourier::{Block, FEATURES, Fourier};
use crate::head::{Outputs, TRIANGLE, unit_velocity};
use crate::mlp::{Activation, Mlp};
use crate::weights::{Tensors, WeightsError};
use robot::{DOF, JointState, JointVector, Limits};

/// Units of each hidden layer (paper: three of 512).
pub const HIDDEN: usize = 512;

/// More of them are taken for a mistake.
const MOST_HIDDEN: usize = 4096;

/// Speed (rad/s) that counts as one in the network's input.
pub const SPEED_SCALE: f64 = 1.0;

/// What decides the networks beside their weights.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NgfConfig {
    /// Units of each hidden layer.
    pub hidden: usize,
    /// Seed of the Fourier frequencies.
    pub frequency_seed: u64,
    /// Length scale of q, normalised to ±1 at the limits.
    pub position_scale: f32,
    /// Length scale of q̇: of the unit velocity, and of the velocity over [`SPEED_SCALE`].
    pub velocity_scale: f32,
    /// Length scale of z, whitened.
    pub latent_scale: f32,
    /// ψ in units of the network's output: brings accelerations of tens of rad/s² within reach of
    /// weights of order one.
    pub potential_scale: f32,
    /// κ: stiffness of a bowl ½ κ |q - q̄|² that is added to ψ.
    ///
    /// *Departure: the paper's potential is a network alone. Whatever the object, the expert pulls back
    /// with the same stiffness in every direction off its path; that part is given (225/s² where M is
    /// about 2 I, as in a fresh network), and F_ψ learns where to.*
    pub bowl: f64,
    /// q̄, its middle (rad): the mean of the demonstrations, with the object in front.
    pub rest: [f64; DOF],
}

impl NgfConfig {
    /// Sizes of the paper; seed and length scales are ours.
    pub fn paper() -> Self {
        Self {
            hidden: HIDDEN,
            frequency_seed: 2309,
            position_scale: 2.0,
            velocity_scale: 3.0,
            latent_scale: 16.0,
            potential_scale: 100.0,
            bowl: 450.0,
            rest: [0.0; DOF],
        }
    }

    /// Small networks for tests.
    pub fn tiny() -> Self {
        Self { hidden: 32, ..Self::paper() }
    }

    /// Refuses what no networks can be built from; the message names the value.
    pub fn check(&self) -> Result<(), WeightsError> {
        let refuse = |name: &str, value: f64| {
            Err(WeightsError::Setting { name: name.to_owned(), value: value.to_string() })
        };
        if !(1..=MOST_HIDDEN).contains(&self.hidden) {
            return refuse("hidden", self.hidden as f64);
        }
        let scales = [
            ("position_scale", self.position_scale),
            ("velocity_scale", self.velocity_scale),
            ("latent_scale", self.latent_scale),
        ];
        for (name, scale) in scales {
            if !(scale.is_finite() && scale > 0.0) {
                return refuse(name, f64::from(scale));
            }
        }
        let numbers = [("potential_scale", f64::from(self.potential_scale)), ("bowl", self.bowl)];
        let rest = self.rest.iter().map(|q| ("rest", *q));
        match numbers.into_iter().chain(rest).find(|(_, value)| !value.is_finite()) {
            Some((name, value)) => refuse(name, value),
            None => Ok(()),
        }
    }
}

/// Which inputs a network has beside q and z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Velocity {
    /// The unit velocity.
    Unit,
    /// None.
    Absent,
    /// The velocity.
    Full,
}

/// One of the five networks: its name in the weights, its velocity input, its outputs.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Name in the weights file.
    pub name: &'static str,
    /// Velocity input.
    pub velocity: Velocity,
    /// Outputs.
    pub outputs: usize,
}

/// F_g, F_χ, F_f, F_ψ, F_β (paper §III-B).
pub const PARTS: [Part; 5] = [
    Part { name: "geometry_metric", velocity: Velocity::Unit, outputs: TRIANGLE },
    Part { name: "geometry", velocity: Velocity::Unit, outputs: DOF },
    Part { name: "driving_metric", velocity: Velocity::Absent, outputs: TRIANGLE },
    Part { name: "potential", velocity: Velocity::Absent, outputs: 1 },
    Part { name: "damping", velocity: Velocity::Full, outputs: 1 },
];

/// Index of F_g among [`PARTS`].
pub const GEOMETRY_METRIC: usize = 0;
/// Index of F_χ.
pub const GEOMETRY: usize = 1;
/// Index of F_f.
pub const DRIVING_METRIC: usize = 2;
/// Index of F_ψ.
pub const POTENTIAL: usize = 3;
/// Index of F_β.
pub const DAMPING: usize = 4;

impl Part {
    /// The Fourier features of this network: q first, then velocity, then the `object` numbers of z.
    pub fn fourier(&self, config: &NgfConfig, object: usize, index: usize) -> Fourier {
        let q = Block { size: DOF, length_scale: config.position_scale };
        let qd = Block { size: DOF, length_scale: config.velocity_scale };
        let z = Block { size: object, length_scale: config.latent_scale };
        let seed = config.frequency_seed.wrapping_add(index as u64);
        match self.velocity {
            Velocity::Absent => Fourier::new(&[q, z], seed),
            _ => Fourier::new(&[q, qd, z], seed),
        }
    }

    /// Widths of the layers, features first.
    pub fn widths(&self, config: &NgfConfig) -> [usize; 5] {
        [FEATURES, config.hidden, config.hidden, config.hidden, self.outputs]
    }
}

/// The inputs of one network (dimensionless): normalised q, velocity if it has one, z.
pub fn inputs(part: &Part, limits: &Limits, state: &JointState, z: &[f32]) -> Vec<f32> {
    let mut x: Vec<f32> = limits.normalize(&state.q).iter().map(|&q| q as f32).collect();
    match part.velocity {
        Velocity::Absent => {}
        Velocity::Unit => x.extend(unit_velocity(&state.qd).iter().map(|&v| v as f32)),
        Velocity::Full => x.extend(state.qd.iter().map(|&v| (v / SPEED_SCALE) as f32)),
    }
    x.extend(z);
    x
}

/// The policy, ready to run.
#[derive(Clone, Debug)]
pub struct Ngf {
    limits: Limits,
    config: NgfConfig,
    networks: Vec<(Fourier, Mlp)>,
}

impl Ngf {
    /// Reads the five networks; `object` numbers tell of the object.
    pub fn load(
        tensors: &Tensors,
        config: &NgfConfig,
        object: usize,
        limits: &Limits,
    ) -> Result<Self, WeightsError> {
        config.check()?;
        let network = |(i, part): (usize, &Part)| {
            let mlp = Mlp::load(tensors, part.name, &part.widths(config), Activation::Elu)?;
            Ok((part.fourier(config, object, i), mlp))
        };
        let networks =
            PARTS.iter().enumerate().map(network).collect::<Result<_, WeightsError>>()?;
        Ok(Self { limits: limits.clone(), config: config.clone(), networks })
    }

    /// What the networks say about a state, with ∂ψ/∂q by the chain rule through the features.
    pub fn outputs(&self, state: &JointState, z: &[f32]) -> Outputs {
        let features =
            |i: usize| self.networks[i].0.features(&inputs(&PARTS[i], &self.limits, state, z));
        let apply = |i: usize| self.networks[i].1.apply(&features(i));
        let (fourier, potential) = &self.networks[POTENTIAL];
        let at = features(POTENTIAL);
        let gradient = fourier.pull_back(&at, &potential.gradient(&at), DOF);
        // q is normalised over its range, which spans two units.
        let per_radian = (self.limits.upper - self.limits.lower).map(|range| 2.0 / range as f32);
        let bowl = (state.q - JointVector::from(self.config.rest)) * self.config.bowl;
        Outputs {
            geometry_metric: apply(GEOMETRY_METRIC),
            geometry: apply(GEOMETRY),
            driving_metric: apply(DRIVING_METRIC),
            potential_gradient: gradient
                .iter()
                .zip(&per_radian)
                .zip(&bowl)
                .map(|((g, slope), bowl)| g * self.config.potential_scale * slope + *bowl as f32)
                .collect(),
            damping: apply(DAMPING)[0],
        }
    }

    /// q̈ (rad/s²) at a state for an object z in front; `None` if it is not finite.
    pub fn acceleration(&self, state: &JointState, z: &[f32]) -> Option<JointVector> {
        let qdd = self.outputs(state, z).fabric(&state.qd).acceleration(&state.qd)?;
        qdd.iter().all(|x| x.is_finite()).then_some(qdd)
    }

    /// The potential ψ(q, z): bowl and network.
    pub fn potential(&self, state: &JointState, z: &[f32]) -> f32 {
        let (fourier, mlp) = &self.networks[POTENTIAL];
        let bowl =
            0.5 * self.config.bowl * (state.q - JointVector::from(self.config.rest)).norm_squared();
        let network =
            mlp.apply(&fourier.features(&inputs(&PARTS[POTENTIAL], &self.limits, state, z)))[0];
        bowl as f32 + self.config.potential_scale * network
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoder::LATENT;
    use crate::mlp::Dense;
    use robot::Tree;

    #[test]
    fn the_driving_force_is_the_slope_of_the_potential() {
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        // The scale of a fresh network's ψ, without the bowl: single precision resolves its slope.
        let config = NgfConfig { bowl: 0.0, potential_scale: 1.0, ..NgfConfig::tiny() };
        let dense = |(i, pair): (usize, &[usize])| {
            let wave = |k: usize| libm::sinf((k * k + i) as f32);
            let weight = (0..pair[0] * pair[1]).map(|k| 2.0 * wave(k) / (pair[0] as f32).sqrt());
            Dense {
                weight: weight.map(half::f16::from_f32).collect(),
                bias: (0..pair[1]).map(wave).collect(),
            }
        };
        let network = |(i, part): (usize, &Part)| {
            let layers = part.widths(&config).windows(2).enumerate().map(dense).collect();
            (part.fourier(&config, LATENT, i), Mlp { layers, activation: Activation::Elu })
        };
        let networks = PARTS.iter().enumerate().map(network).collect();
        let mut ngf = Ngf { limits, config: config.clone(), networks };
        let z: Vec<f32> = (0..LATENT).map(|i| libm::cosf(i as f32)).collect();
        let at = |q: JointVector| JointState { q, qd: JointVector::zeros() };
        let q = JointVector::from_fn(|i, _| 0.5 * libm::sin(i as f64));
        let gradient = ngf.outputs(&at(q), &z).potential_gradient;
        let step = 0.02;
        for i in 0..DOF {
            let mut shift = JointVector::zeros();
            shift[i] = step;
            let rise = ngf.potential(&at(q + shift), &z) - ngf.potential(&at(q - shift), &z);
            let wanted = rise / (2.0 * step as f32);
            assert!((gradient[i] - wanted).abs() < 1e-2, "{i}: {} against {wanted}", gradient[i]);
        }
        // The bowl adds κ (q - q̄).
        ngf.config.bowl = 450.0;
        ngf.config.rest = std::array::from_fn(|i| 0.1 * i as f64);
        let off = q - JointVector::from(ngf.config.rest);
        for (i, steep) in ngf.outputs(&at(q), &z).potential_gradient.iter().enumerate() {
            let wanted = gradient[i] + 450.0 * off[i] as f32;
            assert!((steep - wanted).abs() < 1e-3, "{i}: {steep} against {wanted}");
        }
    }
}
