//! Inverse kinematics of the palm: damped least squares with null-space attraction to a nominal posture.
//!
//! The null space contains the arm motions that do not move the palm; seven joints leave one such motion.

use crate::{ARM_DOF, Isometry, JointVector, KinematicTree, rotation};
use nalgebra::{SMatrix, SVector};

/// Parameters of the inverse-kinematics solver.
#[derive(Clone, Debug)]
pub struct IkConfig {
    /// Max number of iterations.
    pub max_iterations: usize,
    /// Position error (m) of the palm below which a solution is accepted.
    pub position_tolerance: f64,
    /// Orientation error (rad) of the palm below which a solution is accepted.
    pub angle_tolerance: f64,
    /// Damping factor of the least squares (m or rad per rad).
    pub damping: f64,
    /// Fraction of the distance to the nominal posture covered in the null space by the first iteration.
    pub nullspace_gain: f64,
    /// Margin kept to the joint limits (rad).
    pub limit_margin: f64,
    /// Joint indices of elbow and wrist.
    pub flexion_joints: Vec<usize>,
    /// Min flexion of elbow and wrist (rad), with the sign of the nominal posture. Two families of solutions
    /// meet at the straight joint. If both are allowed, the solutions of neighbouring targets jump between
    /// them.
    pub min_flexion: f64,
    /// Joint indices of the rolls of upper arm and forearm.
    pub roll_joints: Vec<usize>,
    /// Max roll of upper arm and forearm (rad) from the nominal posture. Far from it, an elbow on the left
    /// and one on the right are equally near, and the solutions of neighbouring targets jump between them.
    pub max_roll: f64,
}

impl IkConfig {
    /// Values that place the palm within 0.1 mm. They are our own: the paper gives none. Joint groups and
    /// their limits are those of the robot's arm.
    pub fn standard(tree: &KinematicTree) -> Self {
        let arm = &tree.hand.arm;
        // The loader rejects unknown names.
        let indices =
            |names: &[String]| names.iter().filter_map(|name| tree.joint_index(name)).collect();
        Self {
            max_iterations: 200,
            position_tolerance: 1e-4,
            angle_tolerance: 1e-3,
            damping: 0.02,
            nullspace_gain: 0.1,
            limit_margin: 0.02,
            flexion_joints: indices(&arm.flexion_joints),
            min_flexion: arm.min_flexion,
            roll_joints: indices(&arm.roll_joints),
            max_roll: arm.max_roll,
        }
    }
}

/// Solves for the arm joints (rad) that bring the palm to `world_from_palm` (m); `None` if the solver does not
/// converge.
///
/// `nominal` is a posture (rad) of all joints. The hand joints are copied from it. The solver starts at
/// `nominal` and is attracted to it in the null space, so neighbouring targets get neighbouring solutions.
///
/// ```rust
/// use robot::ik::{self, IkConfig};
/// let tree = robot::KinematicTree::iiwa7_allegro()?;
/// let nominal = robot::joint_vector(&tree.hand.arm.nominal, &[0.3; robot::HAND_DOF]);
/// // From the nominal palm pose 5 cm forward, 10 cm to the right and 10 cm up.
/// let mut target = tree.forward_kinematics(&nominal).palm_pose();
/// target.translation.vector += robot::Vector::new(0.05, -0.1, 0.1);
/// let q = ik::solve(&tree, &target, &nominal, &IkConfig::standard(&tree)).expect("within reach");
/// let palm = tree.forward_kinematics(&q).palm_pose();
/// assert!((palm.translation.vector - target.translation.vector).norm() < 1e-4); // m
/// # Ok::<(), robot::UrdfError>(())
/// ```
pub fn solve(
    tree: &KinematicTree,
    world_from_palm: &Isometry,
    nominal: &JointVector,
    config: &IkConfig,
) -> Option<JointVector> {
    let mut q = tree.limits.clamp(nominal, config.limit_margin);
    for iteration in 0..config.max_iterations {
        let kinematics = tree.forward_kinematics(&q);
        let palm = kinematics.palm_pose();
        let position = world_from_palm.translation.vector - palm.translation.vector;
        let angle = rotation::log(&(world_from_palm.rotation * palm.rotation.inverse()));
        if position.norm() < config.position_tolerance && angle.norm() < config.angle_tolerance {
            return Some(q);
        }
        // Limit the step to distant targets, where the linearisation does not hold.
        let position = position * (0.1 / position.norm().max(0.1));
        let angle = angle * (0.4 / angle.norm().max(0.4));
        let error =
            SVector::<f64, 6>::from_fn(|r, _| if r < 3 { position[r] } else { angle[r - 3] });

        let jacobian = kinematics.palm_jacobian();
        let damped = jacobian * jacobian.transpose()
            + SMatrix::<f64, 6, 6>::identity() * (config.damping * config.damping);
        let inverse = damped.cholesky()?;
        // The attraction decays, so that the last steps reduce the pose error alone.
        let decay = 1.0 - iteration as f64 / config.max_iterations as f64;
        let gain = config.nullspace_gain * decay;
        let attraction = SVector::<f64, ARM_DOF>::from_fn(|i, _| gain * (nominal[i] - q[i]));
        let step =
            attraction + jacobian.transpose() * inverse.solve(&(error - jacobian * attraction));
        for i in 0..ARM_DOF {
            q[i] += step[i];
        }
        q = tree.limits.clamp(&q, config.limit_margin);
        for &joint in &config.flexion_joints {
            let side = nominal[joint].signum();
            q[joint] = side * (side * q[joint]).max(config.min_flexion);
        }
        for &joint in &config.roll_joints {
            q[joint] =
                q[joint].clamp(nominal[joint] - config.max_roll, nominal[joint] + config.max_roll);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solutions_reach_the_target_within_tolerance() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let nominal = crate::joint_vector(&[0.0, 0.4, 0.0, -1.4, 0.0, 1.2, 0.8], &[0.3; 16]);
        let config = IkConfig::standard(&tree);
        let mut solved = 0;
        for seed in 0..50 {
            // A reachable palm pose: the pose of a posture near the nominal one.
            let q = JointVector::from_fn(|i, _| {
                nominal[i] + 0.5 * libm::sin((seed * 23 + i) as f64 * 1.3)
            });
            let target = tree.forward_kinematics(&tree.limits.clamp(&q, 0.1)).palm_pose();
            let Some(solution) = solve(&tree, &target, &nominal, &config) else { continue };
            let palm = tree.forward_kinematics(&solution).palm_pose();
            let position = (palm.translation.vector - target.translation.vector).norm();
            let angle = rotation::angle_between(&palm.rotation, &target.rotation);
            assert!(position < 1e-4 && angle < 1e-3, "off by {position} m, {angle} rad");
            assert!(tree.limits.contains(&solution, 0.019));
            solved += 1;
        }
        assert!(solved >= 48, "{solved} of 50 reachable targets solved");
    }

    #[test]
    fn target_out_of_reach_has_no_solution() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let nominal = JointVector::from_element(0.3);
        let far = Isometry::translation(2.0, 0.0, 0.5);
        assert!(solve(&tree, &far, &nominal, &IkConfig::standard(&tree)).is_none());
    }
}
