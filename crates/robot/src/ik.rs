//! Inverse kinematics of the palm: damped least squares with a pull to a nominal posture in the null space.

use crate::{ARM, Isometry, JointVector, Tree, rotation};
use nalgebra::{SMatrix, SVector};

/// How an inverse-kinematics solution is looked for.
#[derive(Clone, Debug)]
pub struct IkConfig {
    /// Steps at most.
    pub iterations: usize,
    /// Position error that is good enough (m).
    pub position_tolerance: f64,
    /// Orientation error that is good enough (rad).
    pub angle_tolerance: f64,
    /// Damping of the least squares (m or rad per rad).
    pub damping: f64,
    /// Share of the way to the nominal posture that the first steps take in the null space.
    pub null_space_pull: f64,
    /// Distance kept to the joint limits (rad).
    pub margin: f64,
    /// Least bend of elbow and wrist (rad), to the side to which they are bent in the nominal posture. Straight ones
    /// are where two families of solutions meet; with both allowed, neighbouring targets jump between them.
    pub bend: f64,
    /// Greatest roll of upper arm and forearm (rad) from the nominal posture: far from it, an elbow on the left is as
    /// near as one on the right, and neighbouring targets jump between them, too.
    pub roll: f64,
}

const UPPER_ARM: usize = 2;
const ELBOW: usize = 3;
const FOREARM: usize = 4;
const WRIST: usize = 5;

impl IkConfig {
    /// Values that place the palm to a tenth of a millimetre; ours, the paper names none.
    pub fn precise() -> Self {
        Self {
            iterations: 200,
            position_tolerance: 1e-4,
            angle_tolerance: 1e-3,
            damping: 0.02,
            null_space_pull: 0.1,
            margin: 0.02,
            bend: 0.4,
            roll: 1.9,
        }
    }
}

/// Arm joints that bring the palm to `world_from_palm`, or `None` if none were found from `nominal`.
///
/// The hand's joints are taken over from `nominal`. The search starts at `nominal` and is pulled to
/// it in the null space, so neighbouring targets get neighbouring solutions.
pub fn solve(
    tree: &Tree,
    world_from_palm: &Isometry,
    nominal: &JointVector,
    config: &IkConfig,
) -> Option<JointVector> {
    let mut q = tree.limits.clamp(nominal, config.margin);
    for iteration in 0..config.iterations {
        let kinematics = tree.kinematics(&q);
        let palm = kinematics.palm();
        let position = world_from_palm.translation.vector - palm.translation.vector;
        let angle = rotation::log(&(world_from_palm.rotation * palm.rotation.inverse()));
        if position.norm() < config.position_tolerance && angle.norm() < config.angle_tolerance {
            return Some(q);
        }
        // Far targets are approached in steps that keep the linearisation honest.
        let position = position * (0.1 / position.norm().max(0.1));
        let angle = angle * (0.4 / angle.norm().max(0.4));
        let error =
            SVector::<f64, 6>::from_fn(|r, _| if r < 3 { position[r] } else { angle[r - 3] });

        let jacobian = kinematics.palm_jacobian();
        let damped = jacobian * jacobian.transpose()
            + SMatrix::<f64, 6, 6>::identity() * (config.damping * config.damping);
        let inverse = damped.cholesky()?;
        // The pull fades, so that the last steps serve the target alone.
        let fade = 1.0 - iteration as f64 / config.iterations as f64;
        let pull = config.null_space_pull * fade;
        let pull = SVector::<f64, ARM>::from_fn(|i, _| pull * (nominal[i] - q[i]));
        let step = pull + jacobian.transpose() * inverse.solve(&(error - jacobian * pull));
        for i in 0..ARM {
            q[i] += step[i];
        }
        q = tree.limits.clamp(&q, config.margin);
        for joint in [ELBOW, WRIST] {
            let side = nominal[joint].signum();
            q[joint] = side * (side * q[joint]).max(config.bend);
        }
        for joint in [UPPER_ARM, FOREARM] {
            q[joint] = q[joint].clamp(nominal[joint] - config.roll, nominal[joint] + config.roll);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reached_targets_are_reached() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let nominal = crate::join(&[0.0, 0.4, 0.0, -1.4, 0.0, 1.2, 0.8], &[0.3; 16]);
        let config = IkConfig::precise();
        let mut solved = 0;
        for seed in 0..50 {
            // A reachable palm pose: that of a posture near the nominal one.
            let q = JointVector::from_fn(|i, _| {
                nominal[i] + 0.5 * libm::sin((seed * 23 + i) as f64 * 1.3)
            });
            let target = tree.kinematics(&tree.limits.clamp(&q, 0.1)).palm();
            let Some(solution) = solve(&tree, &target, &nominal, &config) else { continue };
            let palm = tree.kinematics(&solution).palm();
            let position = (palm.translation.vector - target.translation.vector).norm();
            let angle = rotation::angle_between(&palm.rotation, &target.rotation);
            assert!(position < 1e-4 && angle < 1e-3, "off by {position} m, {angle} rad");
            assert!(tree.limits.contains(&solution, 0.019));
            solved += 1;
        }
        assert!(solved >= 48, "{solved} of 50 reachable targets solved");
    }

    #[test]
    fn targets_out_of_reach_are_refused() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let nominal = JointVector::from_element(0.3);
        let far = Isometry::translation(2.0, 0.0, 0.5);
        assert!(solve(&tree, &far, &nominal, &IkConfig::precise()).is_none());
    }
}
