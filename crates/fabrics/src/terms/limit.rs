//! Keeps joints off their limits.

use super::Pull;
use robot::{DOF, JointState, Limits};

/// Parameters of the joint-limit term.
#[derive(Clone, Copy, Debug)]
pub struct LimitConfig {
    /// Acceleration away from the limit (rad/s²).
    pub gain: f64,
    /// Damping of motion towards it (1/s).
    pub damping: f64,
    /// Distance (rad) at which the priority has its pole.
    pub offset: f64,
    /// Scale of the priority (rad²).
    pub scale: f64,
    /// Greatest priority.
    pub cap: f64,
}

/// Speed towards a limit (rad/s) at which the term acts in full.
const GATE_SPEED: f64 = 1.0;

/// Adds the term for both limits of every joint; it acts only on joints that move towards a limit.
pub fn add(pull: &mut Pull, state: &JointState, limits: &Limits, config: &LimitConfig) {
    for i in 0..DOF {
        for side in [-1.0, 1.0] {
            let limit = if side > 0.0 { limits.upper[i] } else { limits.lower[i] };
            let distance = side * (limit - state.q[i]);
            let speed = -side * state.qd[i];
            // A switch between acting and not acting would chatter at 30 Hz; this fades in.
            let gate = if distance < 0.0 { 1.0 } else { (-speed / GATE_SPEED).clamp(0.0, 1.0) };
            if gate == 0.0 {
                continue;
            }
            let room = (distance - config.offset).max(libm::sqrt(config.scale / config.cap));
            let metric = gate * (config.scale / (room * room)).min(config.cap);
            let away = config.gain - config.damping * speed.min(0.0);
            pull.geometry.metric[(i, i)] += metric;
            pull.potential[i] -= metric * (-side * away);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot::{JointVector, Tree};

    const CONFIG: LimitConfig =
        LimitConfig { gain: 8.0, damping: 8.0, offset: 0.1, scale: 0.02, cap: 100.0 };

    #[test]
    fn only_motion_towards_a_limit_meets_resistance() {
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        let mut q = (limits.lower + limits.upper) * 0.5;
        q[3] = limits.upper[3] - 0.05;
        let force = |speed: f64| {
            let mut pull = Pull::zero();
            let mut qd = JointVector::zeros();
            qd[3] = speed;
            add(&mut pull, &JointState { q, qd }, &limits, &CONFIG);
            (pull.potential[3], pull.geometry.metric[(3, 3)])
        };
        let (towards, priority) = force(1.0);
        assert!(towards > 0.0, "force {towards} must accelerate backwards");
        assert!(priority > 50.0, "priority {priority} close to a limit");
        // Moving away, only the far limit is left to feel.
        let (away, _) = force(-1.0);
        assert!(away.abs() < 0.01 * towards, "force {away} against {towards}");
        assert_eq!(force(0.0).0, 0.0);
    }
}
