//! Forward kinematics, Jacobians, and the Jacobians' time derivative times velocity.

use crate::tree::{Frame, Tree};
use crate::{ARM, DOF, Isometry, JointVector, Vector, rotation};
use nalgebra::SMatrix;

/// Linear velocity of a point per joint velocity, shape (3, DOF).
pub type PointJacobian = SMatrix<f64, 3, DOF>;

/// Where every body is for one joint position, in the world.
#[derive(Clone, Debug)]
pub struct Kinematics<'a> {
    tree: &'a Tree,
    /// Pose of each body.
    pub world_from_body: [Isometry; DOF + 1],
    /// Unit axis of each joint; it passes through the origin of the body that it moves.
    pub axes: [Vector; DOF],
}

/// How every body moves for one joint velocity at zero joint acceleration.
#[derive(Clone, Debug)]
pub struct Motion<'a> {
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

impl Tree {
    /// Places every body for the joint position `q` (rad).
    pub fn kinematics(&self, q: &JointVector) -> Kinematics<'_> {
        let mut world_from_body = [Isometry::identity(); DOF + 1];
        let mut axes = [Vector::zeros(); DOF];
        for (i, joint) in self.joints.iter().enumerate() {
            let mut pose = world_from_body[joint.parent] * joint.parent_from_child;
            axes[i] = pose.rotation * joint.axis;
            pose.rotation *= rotation::about(&joint.axis, q[i]);
            world_from_body[i + 1] = pose;
        }
        Kinematics { tree: self, world_from_body, axes }
    }
}

impl<'a> Kinematics<'a> {
    /// Pose of a frame in the world.
    pub fn pose(&self, frame: &Frame) -> Isometry {
        self.world_from_body[frame.body] * frame.body_from_frame
    }

    /// Pose of the palm in the world.
    pub fn palm(&self) -> Isometry {
        self.pose(&self.tree.palm)
    }

    /// Centres of the fingertips in the world: index, middle, ring, thumb.
    pub fn tips(&self) -> [Vector; crate::FINGERS] {
        self.tree.tips.map(|tip| self.pose(&tip).translation.vector)
    }

    /// Jacobian of a world point that is fixed to body `body`.
    pub fn point_jacobian(&self, body: usize, point: &Vector) -> PointJacobian {
        let mut jacobian = PointJacobian::zeros();
        self.for_each_mover(body, |i| {
            let arm = point - self.world_from_body[i + 1].translation.vector;
            jacobian.set_column(i, &self.axes[i].cross(&arm));
        });
        jacobian
    }

    /// Jacobian of the angular velocity of body `body`.
    pub fn angular_jacobian(&self, body: usize) -> PointJacobian {
        let mut jacobian = PointJacobian::zeros();
        self.for_each_mover(body, |i| jacobian.set_column(i, &self.axes[i]));
        jacobian
    }

    /// Twist of the palm per arm joint velocity: linear above angular, shape (6, ARM).
    pub fn palm_jacobian(&self) -> SMatrix<f64, 6, ARM> {
        let body = self.tree.palm.body;
        let linear = self.point_jacobian(body, &self.palm().translation.vector);
        let angular = self.angular_jacobian(body);
        SMatrix::from_fn(|r, c| if r < 3 { linear[(r, c)] } else { angular[(r - 3, c)] })
    }

    /// The motion of all bodies under the joint velocity `qd` (rad/s), with q̈ = 0.
    pub fn motion(&'a self, qd: &JointVector) -> Motion<'a> {
        let mut bodies = [BodyMotion::default(); DOF + 1];
        for (i, joint) in self.tree.joints.iter().enumerate() {
            let parent = bodies[joint.parent];
            let arm = self.world_from_body[i + 1].translation.vector
                - self.world_from_body[joint.parent].translation.vector;
            let spin = self.axes[i] * qd[i];
            bodies[i + 1] = BodyMotion {
                velocity: parent.velocity_at(&arm),
                angular_velocity: parent.angular_velocity + spin,
                acceleration: parent.acceleration_at(&arm),
                // The axis turns with the parent.
                angular_acceleration: parent.angular_acceleration
                    + parent.angular_velocity.cross(&spin),
            };
        }
        Motion { kinematics: self, bodies }
    }

    fn for_each_mover(&self, body: usize, mut visit: impl FnMut(usize)) {
        let mut at = body;
        while at > 0 {
            visit(at - 1);
            at = self.tree.joints[at - 1].parent;
        }
    }
}

impl Motion<'_> {
    /// Velocity (m/s) of a world point that is fixed to `body`: J q̇.
    pub fn velocity(&self, body: usize, point: &Vector) -> Vector {
        self.bodies[body].velocity_at(&self.arm(body, point))
    }

    /// Angular velocity (rad/s) of `body`, world axes.
    pub fn angular_velocity(&self, body: usize) -> Vector {
        self.bodies[body].angular_velocity
    }

    /// Acceleration (m/s²) of a world point that is fixed to `body` when q̈ = 0: J̇ q̇.
    pub fn bias_acceleration(&self, body: usize, point: &Vector) -> Vector {
        self.bodies[body].acceleration_at(&self.arm(body, point))
    }

    fn arm(&self, body: usize, point: &Vector) -> Vector {
        point - self.kinematics.world_from_body[body].translation.vector
    }
}

impl BodyMotion {
    fn velocity_at(&self, arm: &Vector) -> Vector {
        self.velocity + self.angular_velocity.cross(arm)
    }

    fn acceleration_at(&self, arm: &Vector) -> Vector {
        let centripetal = self.angular_velocity.cross(&self.angular_velocity.cross(arm));
        self.acceleration + self.angular_acceleration.cross(arm) + centripetal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::join;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    fn sample(seed: u64) -> JointVector {
        JointVector::from_fn(|i, _| libm::sin(1.7 * i as f64 + 0.9 * seed as f64))
    }

    /// The start of IsaacLab's hand (BSD-3) and the arm poses of FABRICS, IsaacLab and
    /// IsaacGymEnvs: palm and tips as computed from those descriptions, metres.
    #[test]
    fn published_poses_are_reproduced() {
        let tree = Tree::iiwa7_allegro().unwrap();
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
            let q = join(&arm, &hand);
            let kinematics = tree.kinematics(&q);
            let got = kinematics.palm().translation.vector;
            assert!((got - Vector::from(palm)).norm() < 2e-4, "palm {got}, wanted {palm:?}");
            let tips = [
                [0.0586, 0.0536, 0.1143],
                [0.0586, 0.0, 0.117],
                [0.0586, -0.0536, 0.1143],
                [0.1147, -0.004, -0.0285],
            ];
            for (tip, wanted) in kinematics.tips().iter().zip(tips) {
                let got = kinematics.palm().inverse_transform_point(&(*tip).into()).coords;
                assert!((got - Vector::from(wanted)).norm() < 2e-4, "tip {got}, wanted {wanted:?}");
            }
        }
    }

    #[test]
    fn jacobian_agrees_with_central_differences() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let h = 1e-6;
        for seed in 0..4 {
            let q = sample(seed);
            for frame in tree.tips {
                let point = |q: &JointVector| tree.kinematics(q).pose(&frame).translation.vector;
                let jacobian = tree.kinematics(&q).point_jacobian(frame.body, &point(&q));
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
        let tree = Tree::iiwa7_allegro().unwrap();
        let h = 1e-4;
        for seed in 0..4 {
            let (q, qd) = (sample(seed), sample(seed + 10));
            let kinematics = tree.kinematics(&q);
            let motion = kinematics.motion(&qd);
            for frame in tree.tips {
                let at = |t: f64| tree.kinematics(&(q + qd * t)).pose(&frame).translation.vector;
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
    fn palm_jacobian_gives_the_palm_twist() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let (q, h) = (sample(3), 1e-6);
        let jacobian = tree.kinematics(&q).palm_jacobian();
        for i in 0..ARM {
            let mut dq = JointVector::zeros();
            dq[i] = h;
            let (a, b) = (tree.kinematics(&(q - dq)).palm(), tree.kinematics(&(q + dq)).palm());
            let linear = (b.translation.vector - a.translation.vector) / (2.0 * h);
            let angular = rotation::log(&(b.rotation * a.rotation.inverse())) / (2.0 * h);
            for r in 0..3 {
                assert!((jacobian[(r, i)] - linear[r]).abs() < 1e-7);
                assert!((jacobian[(r + 3, i)] - angular[r]).abs() < 1e-7);
            }
        }
    }
}
