//! The course of a roll-out: what is plotted of each, tick by tick.

use policy::head::{Fabric, Terms};
use policy::{Encoding, Model};
use robot::{JointState, Limits};

/// One moment of an attempt.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Moment {
    /// ½ q̇ᵀq̇ (rad²/s²), the energy that α_L keeps along the geometry.
    pub energy: f64,
    /// Distance (rad) of the joint that is nearest to a limit from it.
    pub margin: f64,
    /// λ_max(B) + β (1/s), where a fabric acts.
    pub damping: Option<f64>,
    /// What its acceleration is the sum of, where a fabric acts.
    pub terms: Option<TermNorms>,
}

/// Norms (rad/s²) of a fabric's [`Terms`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct TermNorms {
    /// Of the geometry.
    pub geometry: f64,
    /// Of what keeps the energy along it.
    pub energization: f64,
    /// Of the potential.
    pub potential: f64,
    /// Of the damping.
    pub damping: f64,
}

impl From<Terms> for TermNorms {
    fn from(terms: Terms) -> Self {
        Self {
            geometry: terms.geometry.norm(),
            energization: terms.energization.norm(),
            potential: terms.potential.norm(),
            damping: terms.damping.norm(),
        }
    }
}

impl Moment {
    /// Of a commanded state, and of the model that acts there on what it is told, if one does.
    pub(crate) fn of(
        state: &JointState,
        limits: &Limits,
        acts: Option<(&Model, &Encoding)>,
    ) -> Self {
        let fabric = acts
            .and_then(|(model, seen)| model.network.fabric(&seen.state_in_front(state), &seen.z));
        Self {
            energy: 0.5 * state.qd.norm_squared(),
            margin: limits.margin(&state.q),
            damping: fabric.as_ref().map(Fabric::greatest_damping),
            terms: fabric.and_then(|fabric| fabric.terms(&state.qd)).map(TermNorms::from),
        }
    }
}
