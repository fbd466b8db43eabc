//! Telemetry of an attempt, one sample per control period.

use crate::attempt::Attempt;
use crate::rollout_context::RolloutContext;
use policy::networks::fabric_head::{AccelerationTerms, NeuralFabric};
use policy::{Model, Observation};
use robot::{JointLimits, JointState};

/// Telemetry of one control period.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct TelemetrySample {
    /// Energy ½ q̇ᵀq̇ (rad²/s²). The energization term conserves it along the geometry.
    pub energy: f64,
    /// Min distance (rad) of any joint to its nearest limit.
    pub limit_margin: f64,
    /// Max damping rate (1/s), λ_max(B) + β in Eq. 3; `None` without a fabric.
    pub damping: Option<f64>,
    /// Norms of the acceleration terms; `None` without a fabric.
    pub terms: Option<TermNorms>,
}

/// Norms (rad/s²) of the acceleration terms of a fabric ([`AccelerationTerms`]).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct TermNorms {
    /// Norm of the geometry term.
    pub geometry: f64,
    /// Norm of the energization term.
    pub energization: f64,
    /// Norm of the potential term.
    pub potential: f64,
    /// Norm of the damping term.
    pub damping: f64,
}

impl From<AccelerationTerms> for TermNorms {
    fn from(terms: AccelerationTerms) -> Self {
        Self {
            geometry: terms.geometry.norm(),
            energization: terms.energization.norm(),
            potential: terms.potential.norm(),
            damping: terms.damping.norm(),
        }
    }
}

impl TelemetrySample {
    /// Computes the telemetry of a commanded state, with fabric terms if a network computes the commands.
    pub(crate) fn new(
        state: &JointState,
        limits: &JointLimits,
        network: Option<(&Model, &Observation)>,
    ) -> Self {
        let fabric = network.and_then(|(model, observation)| {
            model.network.fabric(observation.network_input(state))
        });
        Self {
            energy: 0.5 * state.qd.norm_squared(),
            limit_margin: limits.min_margin(&state.q),
            damping: fabric.as_ref().map(NeuralFabric::max_damping_rate),
            terms: fabric.and_then(|fabric| fabric.terms(&state.qd)).map(TermNorms::from),
        }
    }
}

impl Attempt {
    /// Telemetry at a tick, or at the last one. Fabric terms are available between start and lift.
    pub fn telemetry_at(&self, context: &RolloutContext, tick: usize) -> TelemetrySample {
        let state = self.history().get(tick).unwrap_or(self.commanded_state());
        let network = self.network(context).filter(|_| self.policy_ticks().contains(&tick));
        TelemetrySample::new(state, &context.robot.tree.limits, network)
    }

    /// Telemetry of each tick between start and lift; empty if the policy phase was not reached.
    pub fn telemetry(&self, context: &RolloutContext) -> Vec<TelemetrySample> {
        let ticks = self.policy_ticks().take_while(|tick| *tick < self.history().len());
        ticks.map(|tick| self.telemetry_at(context, tick)).collect()
    }
}
