//! A policy of any kind on a batch; the twin of `policy::network`.

use super::Params;
use super::baseline::{self, Baseline};
use super::ngf::{self, Active, Ngf, Piece};
use anyhow::Result;
use candle_core::Tensor;
use policy::PolicyConfig;
use policy::head::TRIANGLE;
use policy::network::NetworkConfig;
use rand_chacha::ChaCha8Rng;
use robot::{DOF, JointState, Limits};

/// What is trained.
pub enum Network {
    /// A Neural Geometric Fabric.
    Ngf(Ngf),
    /// The baseline.
    Mlp(Baseline),
}

/// What a network does with a batch.
pub struct Response {
    /// Accelerations, shape (B, DOF).
    pub accelerations: Tensor,
    /// Mean square of the entries of the metrics' factors U, of a fabric.
    pub metrics: Option<Tensor>,
}

/// Adds fresh parameters.
pub fn init(params: &mut Params, config: &PolicyConfig, rng: &mut ChaCha8Rng) -> Result<()> {
    match &config.network {
        NetworkConfig::Ngf(ngf) => ngf::init(params, ngf, rng),
        NetworkConfig::Mlp(mlp) => baseline::init(params, mlp, config.observation.size(), rng),
    }
}

impl Network {
    /// Draws what is fixed.
    pub fn new(config: &PolicyConfig, limits: &Limits) -> Result<Self> {
        let object = config.observation.size();
        Ok(match &config.network {
            NetworkConfig::Ngf(ngf) => Self::Ngf(Ngf::new(ngf, object, limits)?),
            NetworkConfig::Mlp(mlp) => Self::Mlp(Baseline::new(mlp, object, limits)?),
        })
    }

    /// The networks that it consists of, those that are `active`; the baseline is one.
    pub fn pieces(&self, active: Active) -> Vec<Piece> {
        match self {
            Self::Ngf(ngf) => ngf.pieces(active),
            Self::Mlp(_) => vec![Piece { part: 0, columns: 0..DOF, passes: 3 }],
        }
    }

    /// What one of them says about the states of a batch, for what is told of their objects.
    pub fn output(
        &self,
        params: &Params,
        piece: &Piece,
        states: &[JointState],
        objects: &[&[f32]],
    ) -> Result<Tensor> {
        match self {
            Self::Ngf(ngf) => ngf.output(params, piece, states, objects),
            Self::Mlp(mlp) => mlp.accelerations(params, states, objects),
        }
    }

    /// A row of outputs for those that are not active.
    pub fn silence(&self) -> Vec<f32> {
        match self {
            Self::Ngf(_) => Ngf::silence(),
            Self::Mlp(_) => vec![0.0; DOF],
        }
    }

    /// What it does, from all that its networks say: shape (B, length of a row).
    pub fn head(&self, outputs: &Tensor, states: &[JointState]) -> Result<Response> {
        Ok(match self {
            Self::Ngf(_) => Response {
                accelerations: Ngf::resolve(outputs, states)?,
                metrics: Some(outputs.narrow(1, 0, 2 * TRIANGLE)?.sqr()?.mean_all()?),
            },
            Self::Mlp(_) => Response { accelerations: outputs.clone(), metrics: None },
        })
    }

    /// What it does in the states of a batch, on one tape.
    pub fn respond(
        &self,
        params: &Params,
        states: &[JointState],
        objects: &[&[f32]],
    ) -> Result<Response> {
        let output = |piece| self.output(params, piece, states, objects);
        let outputs: Vec<Tensor> =
            self.pieces(Active::All).iter().map(output).collect::<Result<_>>()?;
        self.head(&Tensor::cat(&outputs, 1)?.contiguous()?, states)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::baseline::BaselineConfig;
    use policy::{Observation, weights::Tensors};
    use rand::SeedableRng;
    use robot::{JointVector, Tree};

    /// Networks of every kind, of little size.
    fn configs() -> Vec<PolicyConfig> {
        let mut configs = Vec::new();
        for observation in [Observation::Cloud, Observation::Position] {
            let tiny = PolicyConfig { observation, ..PolicyConfig::tiny() };
            let mlp = |mlp| PolicyConfig { network: NetworkConfig::Mlp(mlp), ..tiny.clone() };
            let large = BaselineConfig { hidden: vec![24; 3], ..BaselineConfig::large() };
            configs.extend([mlp(BaselineConfig::paper()), mlp(large), tiny]);
        }
        configs
    }

    #[test]
    fn the_twins_agree_with_the_networks_that_run() {
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        for config in configs() {
            let mut params = Params::default();
            init(&mut params, &config, &mut ChaCha8Rng::seed_from_u64(4)).unwrap();
            // Last layers begin at zero: here they say something, and the twins are compared on the same
            // rounded weights.
            let wave = |k: usize| half::f16::from_f32(0.1 * libm::sinf((k * k % 997) as f32));
            let values: Vec<f32> = (0..params.count()).map(|k| wave(k).to_f32()).collect();
            params.set_values(&values).unwrap();
            let bytes = params.export(&[]).unwrap();
            let runs = policy::Network::load(&Tensors::parse(&bytes).unwrap(), &config, &limits);
            let runs = runs.unwrap();
            let twin = Network::new(&config, &limits).unwrap();

            let state = |k: usize| JointState {
                q: JointVector::from_fn(|i, _| libm::sin((k * 5 + i) as f64) * 0.8),
                qd: JointVector::from_fn(|i, _| libm::cos((k * 3 + i) as f64)),
            };
            let states: Vec<JointState> = (0..8).map(state).collect();
            let object: Vec<f32> =
                (0..config.observation.size()).map(|i| libm::sinf(i as f32)).collect();
            let objects = vec![object.as_slice(); 8];
            let got = twin.respond(&params, &states, &objects).unwrap();
            for (state, got) in states.iter().zip(got.accelerations.to_vec2::<f32>().unwrap()) {
                let wanted = runs.acceleration(state, &object).unwrap();
                let off = |i: usize| (f64::from(got[i]) - wanted[i]).abs();
                let error = (0..DOF).map(off).fold(0.0, f64::max);
                assert!(wanted.norm() > 0.1 && error < 1e-4 * wanted.norm(), "{config:?}: {error}");
            }
        }
    }
}
