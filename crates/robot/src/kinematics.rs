//! Forward kinematics, Jacobians, and the product J̇q̇ of the Jacobian derivative and the joint velocity.

use crate::tree::{Frame, KinematicTree};
use crate::{ARM_DOF, DOF, Isometry, JointVector, Vector, rotation};
use nalgebra::SMatrix;

/// Jacobian (m or rad per rad), world axes, shape (3, DOF): linear velocity of a point, or angular velocity.
pub type PointJacobian = SMatrix<f64, 3, DOF>;

/// Forward kinematics at one joint position, world frame.
#[derive(Clone, Debug)]
pub struct Kinematics<'a> {
    tree: &'a KinematicTree,
    /// Pose of each body (m).
    pub world_from_body: [Isometry; DOF + 1],
    /// Unit axis of each joint, world frame. It passes through the origin of the child body.
    pub joint_axes: [Vector; DOF],
}

/// Velocities of all bodies for one joint velocity, and their accelerations at q̈ = 0.
#[derive(Clone, Debug)]
pub struct VelocityKinematics<'a> {
    kinematics: &'a Kinematics<'a>,
    bodies: [BodyMotion; DOF + 1],
}

#[derive(Clone, Copy, Debug, Default)]
struct BodyMotion {
    velocity: Vector,
    angular_velocity: Vector,
    acceleration: Vector,
    angular_acceleration: Vector,
}

impl KinematicTree {
    /// Computes the pose of every body at the joint position `q` (rad).
    ///
    /// ```rust
    /// use robot::{ARM_DOF, JointVector, KinematicTree, Vector};
    /// let tree = KinematicTree::iiwa7_allegro()?;
    /// // At q = 0 the arm points straight up: the origin of its last link is 1.221 m above the base.
    /// let kinematics = tree.forward_kinematics(&JointVector::zeros());
    /// let last_link = kinematics.world_from_body[ARM_DOF].translation.vector;
    /// assert!((last_link - Vector::new(0.0, 0.0, 1.221)).norm() < 1e-6);
    /// # Ok::<(), robot::UrdfError>(())
    /// ```
    pub fn forward_kinematics(&self, q: &JointVector) -> Kinematics<'_> {
        let mut world_from_body = [Isometry::identity(); DOF + 1];
        let mut axes = [Vector::zeros(); DOF];
        for (i, joint) in self.joints.iter().enumerate() {
            let mut pose = world_from_body[joint.parent] * joint.parent_from_child;
            axes[i] = pose.rotation * joint.axis;
            pose.rotation *= rotation::from_axis_angle(&joint.axis, q[i]);
            world_from_body[i + 1] = pose;
        }
        Kinematics { tree: self, world_from_body, joint_axes: axes }
    }
}

impl<'a> Kinematics<'a> {
    /// The robot model.
    pub fn tree(&self) -> &'a KinematicTree {
        self.tree
    }

    /// World pose (m) of a frame.
    pub fn frame_pose(&self, frame: &Frame) -> Isometry {
        self.world_from_body[frame.body] * frame.body_from_frame
    }

    /// World pose (m) of the palm.
    pub fn palm_pose(&self) -> Isometry {
        self.frame_pose(&self.tree.palm)
    }

    /// Fingertip centres (m), world frame: index, middle, ring, thumb.
    pub fn fingertips(&self) -> [Vector; crate::NUM_FINGERS] {
        self.tree.fingertips.map(|tip| self.frame_pose(&tip).translation.vector)
    }

    /// Linear Jacobian (m/rad) of `point` (m, world frame), fixed to `body`.
    pub fn point_jacobian(&self, body: usize, point: &Vector) -> PointJacobian {
        let mut jacobian = PointJacobian::zeros();
        self.for_each_ancestor(body, |i| {
            let lever = point - self.world_from_body[i + 1].translation.vector;
            jacobian.set_column(i, &self.joint_axes[i].cross(&lever));
        });
        jacobian
    }

    /// Angular Jacobian (rad/rad) of `body`.
    pub fn angular_jacobian(&self, body: usize) -> PointJacobian {
        let mut jacobian = PointJacobian::zeros();
        self.for_each_ancestor(body, |i| jacobian.set_column(i, &self.joint_axes[i]));
        jacobian
    }

    /// Jacobian of the palm twist with respect to the arm joints, shape (6, ARM_DOF): rows 0 to 2 linear
    /// (m/rad), rows 3 to 5 angular (rad/rad). Reference point: origin of the palm frame; axes: world frame.
    ///
    /// ```rust
    /// let tree = robot::KinematicTree::iiwa7_allegro()?;
    /// let q = robot::joint_vector(&tree.hand.arm.nominal, &[0.3; robot::HAND_DOF]);
    /// let kinematics = tree.forward_kinematics(&q);
    /// // Joint 0 rotates about the vertical axis z: a palm at p moves along z × p.
    /// let p = kinematics.palm_pose().translation.vector;
    /// let jacobian = kinematics.palm_jacobian();
    /// let twist = [-p.y, p.x, 0.0, 0.0, 0.0, 1.0]; // m/s and rad/s, for 1 rad/s of joint 0
    /// assert!((0..6).all(|row| (jacobian[(row, 0)] - twist[row]).abs() < 1e-9));
    /// # Ok::<(), robot::UrdfError>(())
    /// ```
    pub fn palm_jacobian(&self) -> SMatrix<f64, 6, ARM_DOF> {
        let body = self.tree.palm.body;
        let linear = self.point_jacobian(body, &self.palm_pose().translation.vector);
        let angular = self.angular_jacobian(body);
        SMatrix::from_fn(|r, c| if r < 3 { linear[(r, c)] } else { angular[(r - 3, c)] })
    }

    /// Velocities and bias accelerations of all bodies at the joint velocity `qd` (rad/s), with q̈ = 0.
    pub fn velocities(&'a self, qd: &JointVector) -> VelocityKinematics<'a> {
        let mut bodies = [BodyMotion::default(); DOF + 1];
        for (i, joint) in self.tree.joints.iter().enumerate() {
            let parent = bodies[joint.parent];
            let lever = self.world_from_body[i + 1].translation.vector
                - self.world_from_body[joint.parent].translation.vector;
            let rate = self.joint_axes[i] * qd[i];
            bodies[i + 1] = BodyMotion {
                velocity: parent.velocity_at(&lever),
                angular_velocity: parent.angular_velocity + rate,
                acceleration: parent.acceleration_at(&lever),
                // The axis rotates with the parent body.
                angular_acceleration: parent.angular_acceleration
                    + parent.angular_velocity.cross(&rate),
            };
        }
        VelocityKinematics { kinematics: self, bodies }
    }

    fn for_each_ancestor(&self, body: usize, mut visit: impl FnMut(usize)) {
        let mut at = body;
        while at > 0 {
            visit(at - 1);
            at = self.tree.joints[at - 1].parent;
        }
    }
}

impl VelocityKinematics<'_> {
    /// Velocity (m/s) of `point` (m, world frame), fixed to `body`: J q̇.
    pub fn velocity(&self, body: usize, point: &Vector) -> Vector {
        self.bodies[body].velocity_at(&self.lever(body, point))
    }

    /// Angular velocity (rad/s) of `body`, world frame.
    pub fn angular_velocity(&self, body: usize) -> Vector {
        self.bodies[body].angular_velocity
    }

    /// Acceleration (m/s²) of `point` (m, world frame), fixed to `body`, at q̈ = 0: J̇ q̇.
    pub fn bias_acceleration(&self, body: usize, point: &Vector) -> Vector {
        self.bodies[body].acceleration_at(&self.lever(body, point))
    }

    fn lever(&self, body: usize, point: &Vector) -> Vector {
        point - self.kinematics.world_from_body[body].translation.vector
    }
}

impl BodyMotion {
    fn velocity_at(&self, lever: &Vector) -> Vector {
        self.velocity + self.angular_velocity.cross(lever)
    }

    fn acceleration_at(&self, lever: &Vector) -> Vector {
        let centripetal = self.angular_velocity.cross(&self.angular_velocity.cross(lever));
        self.acceleration + self.angular_acceleration.cross(lever) + centripetal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint_vector;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    fn sample(seed: u64) -> JointVector {
        JointVector::from_fn(|i, _| libm::sin(1.7 * i as f64 + 0.9 * seed as f64))
    }

    /// Initial hand posture of IsaacLab (BSD-3) and arm postures of FABRICS, IsaacLab and IsaacGymEnvs. The
    /// palm and fingertip positions (m) are computed from their robot descriptions.
    #[test]
    fn kinematics_reproduces_published_poses() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let hand = [
            0.0, 0.3, 0.3, 0.3, 0.0, 0.3, 0.3, 0.3, 0.0, 0.3, 0.3, 0.3, 1.5, 0.60147215,
            0.33795027, 0.60845138,
        ];
        let arms = [
            ([-0.85, -0.5, 0.76, 1.25, -1.76, 0.9, 0.64], [-0.7186, 0.014, 0.6829]),
            (
                [0.0, 0.0, FRAC_PI_4, FRAC_PI_2, -FRAC_PI_2, -FRAC_PI_2, 0.0],
                [-0.4689, -0.0877, 0.7336],
            ),
            ([-1.571, 1.571, 0.0, 1.376, 0.0, 1.485, 2.358], [-0.0001, -0.7444, 0.6939]),
        ];
        for (arm, palm) in arms {
            let q = joint_vector(&arm, &hand);
            let kinematics = tree.forward_kinematics(&q);
            let got = kinematics.palm_pose().translation.vector;
            assert!((got - Vector::from(palm)).norm() < 2e-4, "palm {got}, wanted {palm:?}");
            let tips = [
                [0.0586, 0.0536, 0.1143],
                [0.0586, 0.0, 0.117],
                [0.0586, -0.0536, 0.1143],
                [0.1147, -0.004, -0.0285],
            ];
            for (tip, wanted) in kinematics.fingertips().iter().zip(tips) {
                let got = kinematics.palm_pose().inverse_transform_point(&(*tip).into()).coords;
                assert!((got - Vector::from(wanted)).norm() < 2e-4, "tip {got}, wanted {wanted:?}");
            }
        }
    }

    #[test]
    fn jacobian_agrees_with_central_differences() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let h = 1e-6;
        for seed in 0..4 {
            let q = sample(seed);
            for frame in tree.fingertips {
                let point = |q: &JointVector| {
                    tree.forward_kinematics(q).frame_pose(&frame).translation.vector
                };
                let jacobian = tree.forward_kinematics(&q).point_jacobian(frame.body, &point(&q));
                for i in 0..DOF {
                    let mut dq = JointVector::zeros();
                    dq[i] = h;
                    let wanted = (point(&(q + dq)) - point(&(q - dq))) / (2.0 * h);
                    let got: Vector = jacobian.column(i).into();
                    assert!((got - wanted).norm() < 1e-8, "joint {i}: {got} against {wanted}");
                }
            }
        }
    }

    #[test]
    fn velocity_and_bias_agree_with_central_differences() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let h = 1e-4;
        for seed in 0..4 {
            let (q, qd) = (sample(seed), sample(seed + 10));
            let kinematics = tree.forward_kinematics(&q);
            let motion = kinematics.velocities(&qd);
            for frame in tree.fingertips {
                let at = |t: f64| {
                    tree.forward_kinematics(&(q + qd * t)).frame_pose(&frame).translation.vector
                };
                let point = at(0.0);
                let velocity = kinematics.point_jacobian(frame.body, &point) * qd;
                assert!((motion.velocity(frame.body, &point) - velocity).norm() < 1e-12);
                let wanted = (at(h) - 2.0 * point + at(-h)) / (h * h);
                let got = motion.bias_acceleration(frame.body, &point);
                assert!((got - wanted).norm() < 1e-6, "bias {got} against {wanted}");
            }
        }
    }

    #[test]
    fn palm_jacobian_agrees_with_central_differences() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let (q, h) = (sample(3), 1e-6);
        let jacobian = tree.forward_kinematics(&q).palm_jacobian();
        for i in 0..ARM_DOF {
            let mut dq = JointVector::zeros();
            dq[i] = h;
            let (a, b) = (
                tree.forward_kinematics(&(q - dq)).palm_pose(),
                tree.forward_kinematics(&(q + dq)).palm_pose(),
            );
            let linear = (b.translation.vector - a.translation.vector) / (2.0 * h);
            let angular = rotation::log(&(b.rotation * a.rotation.inverse())) / (2.0 * h);
            for r in 0..3 {
                assert!((jacobian[(r, i)] - linear[r]).abs() < 1e-7);
                assert!((jacobian[(r + 3, i)] - angular[r]).abs() < 1e-7);
            }
        }
    }
}
