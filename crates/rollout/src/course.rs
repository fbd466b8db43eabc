//! The course of a roll-out: what is plotted of each, tick by tick.

use policy::{Encoding, Model};
use robot::{JointState, Limits};

/// One moment between start and lift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// ½ q̇ᵀq̇ (rad²/s²), the energy that α_L keeps along the geometry.
    pub energy: f64,
    /// Distance (rad) of the joint that is nearest to a limit from it.
    pub margin: f64,
    /// λ_max(B) + β (1/s), where a fabric acts.
    pub damping: Option<f64>,
}

impl Moment {
    /// Of a commanded state, and of the model that acts there on what it is told, if one does.
    pub(crate) fn of(
        state: &JointState,
        limits: &Limits,
        acts: Option<(&Model, &Encoding)>,
    ) -> Self {
        let damping = |(model, seen): (&Model, &Encoding)| {
            model.network.greatest_damping(&seen.state_in_front(state), &seen.z)
        };
        Self {
            energy: 0.5 * state.qd.norm_squared(),
            margin: limits.margin(&state.q),
            damping: acts.and_then(damping),
        }
    }
}
