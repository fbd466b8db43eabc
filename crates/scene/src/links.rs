//! What the robot's links are in the engine: bodies with mass, hinges with motors.

use crate::config::{CONTROL_PERIOD, Motors};
use geometry::{Pose, Vec3};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use rapier3d::prelude::{
    GenericJoint, GenericJointBuilder, JointAxesMask, JointAxis, MassProperties, MotorModel,
    Multibody, MultibodyLink, RigidBodyBuilder,
};
use robot::tree::{Body, Joint};
use robot::{ARM, JointState, rotation};

/// A link that moves.
pub(crate) fn moving(body: &Body) -> RigidBodyBuilder {
    let com = rotation::to_vec3(&body.com);
    let mass = mass_properties(com, body.mass as f32, &body.inertia);
    // The controller compensates gravity, as on the real robot.
    RigidBodyBuilder::dynamic().additional_mass_properties(mass).gravity_scale(0.0).can_sleep(false)
}

/// Mass properties from an inertia tensor about the centre of mass (kg m²). The engine's own way to
/// principal axes goes through trigonometry of the system; this one has the same bits everywhere.
pub(crate) fn mass_properties(com: Vec3, mass: f32, inertia: &Matrix3<f64>) -> MassProperties {
    let eigen = inertia.symmetric_eigen();
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let moments = rotation::to_vec3(&eigen.eigenvalues);
    let turn = Rotation3::from_matrix_unchecked(axes);
    let frame = robot::Isometry::from_parts(
        robot::Vector::zeros().into(),
        UnitQuaternion::from_rotation_matrix(&turn),
    );
    MassProperties::with_principal_inertia_frame(
        com,
        mass,
        moments,
        rotation::to_pose(&frame).rotation,
    )
}

/// A motor-driven hinge about the joint's axis, which is the x axis of the engine's joint frames.
pub(crate) fn revolute(joint: &Joint, effort: f32) -> GenericJoint {
    let axis = rotation::to_vec3(&joint.axis);
    let frame = Pose::from_rotation(GenericJoint::complete_ang_frame(axis));
    GenericJointBuilder::new(JointAxesMask::LOCKED_REVOLUTE_AXES)
        .local_frame1(rotation::to_pose(&joint.parent_from_child) * frame)
        .local_frame2(frame)
        .motor_model(JointAxis::AngX, MotorModel::ForceBased)
        .motor_max_force(JointAxis::AngX, effort)
        .contacts_enabled(false)
        .build()
}

/// Sets what resists the motion of `joint` by itself, at its index in the engine's generalized vectors.
pub(crate) fn set_passive(multibody: &mut Multibody, index: usize, joint: usize, motors: &Motors) {
    let is_arm = joint < ARM;
    multibody.armature_mut()[index] =
        if is_arm { motors.arm_armature } else { motors.hand_armature };
    multibody.damping_mut()[index] = motors.joint_damping[usize::from(!is_arm)];
}

/// Sets the target of a joint's motor.
pub(crate) fn set_target(
    link: &mut MultibodyLink,
    joint: usize,
    state: &JointState,
    motors: &Motors,
) {
    let (stiffness, damping) = if joint < ARM {
        (motors.arm_stiffness, motors.arm_damping)
    } else {
        (motors.hand_stiffness, motors.hand_damping)
    };
    let (q, qd) = (state.q[joint] as f32, state.qd[joint] as f32);
    link.joint.data.set_motor(JointAxis::AngX, q, qd, stiffness, damping);
}

/// The cubic from `from` to `to` over one control period, at share `s` of it.
pub(crate) fn hermite(from: &JointState, to: &JointState, s: f64) -> JointState {
    let t = CONTROL_PERIOD;
    let (s2, s3) = (s * s, s * s * s);
    let q = from.q * (2.0 * s3 - 3.0 * s2 + 1.0)
        + from.qd * (t * (s3 - 2.0 * s2 + s))
        + to.q * (3.0 * s2 - 2.0 * s3)
        + to.qd * (t * (s3 - s2));
    let qd = (to.q - from.q) * (6.0 * (s - s2) / t)
        + from.qd * (3.0 * s2 - 4.0 * s + 1.0)
        + to.qd * (3.0 * s2 - 2.0 * s);
    JointState { q, qd }
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot::JointVector;

    #[test]
    fn commands_follow_eq6_eq7_between_ticks() {
        let qdd = JointVector::from_fn(|i, _| i as f64 - 11.0);
        let from = JointState {
            q: JointVector::from_element(0.2),
            qd: JointVector::from_fn(|i, _| 0.1 * i as f64),
        };
        let to = robot::integrator::step(&from, &qdd, CONTROL_PERIOD);
        for s in [0.25, 0.5, 1.0] {
            let wanted = robot::integrator::step(&from, &qdd, s * CONTROL_PERIOD);
            let got = hermite(&from, &to, s);
            assert!((got.q - wanted.q).amax() < 1e-12 && (got.qd - wanted.qd).amax() < 1e-10);
        }
    }
}
