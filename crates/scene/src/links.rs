//! Robot links in rapier: rigid bodies with mass, revolute joints with motors.

use crate::config::{CONTROL_DT, Motors};
use geometry::{Pose, Vec3};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use rapier3d::prelude::{
    GenericJoint, GenericJointBuilder, JointAxesMask, JointAxis, MassProperties, MotorModel,
    Multibody, MultibodyLink, RigidBodyBuilder,
};
use robot::tree::{Body, Joint};
use robot::{ARM_DOF, JointState, rotation};

/// A dynamic rigid body with the mass properties of `body`.
pub(crate) fn dynamic_link(body: &Body) -> RigidBodyBuilder {
    let com = rotation::to_vec3(&body.com);
    let mass = mass_properties(com, body.mass as f32, &body.inertia);
    // The controller compensates gravity, as on the real robot.
    RigidBodyBuilder::dynamic().additional_mass_properties(mass).gravity_scale(0.0).can_sleep(false)
}

/// Mass properties from an inertia tensor about the centre of mass (kg m²). rapier's own principal-axis
/// computation uses system trigonometry; this one is bit-identical on all platforms.
pub(crate) fn mass_properties(com: Vec3, mass: f32, inertia: &Matrix3<f64>) -> MassProperties {
    let eigen = inertia.symmetric_eigen();
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let moments = rotation::to_vec3(&eigen.eigenvalues);
    let rotation = Rotation3::from_matrix_unchecked(axes);
    let frame = robot::Isometry::from_parts(
        robot::Vector::zeros().into(),
        UnitQuaternion::from_rotation_matrix(&rotation),
    );
    MassProperties::with_principal_inertia_frame(
        com,
        mass,
        moments,
        rotation::to_pose(&frame).rotation,
    )
}

/// A motor-driven revolute joint. Its axis is the x axis of rapier's joint frames.
pub(crate) fn revolute_joint(joint: &Joint, effort: f32) -> GenericJoint {
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

/// Sets armature and passive damping of `joint`, at its index in rapier's generalized vectors.
pub(crate) fn set_joint_damping(
    multibody: &mut Multibody,
    index: usize,
    joint: usize,
    motors: &Motors,
) {
    let is_arm = joint < ARM_DOF;
    multibody.armature_mut()[index] =
        if is_arm { motors.arm_armature } else { motors.hand_armature };
    multibody.damping_mut()[index] = motors.joint_damping[usize::from(!is_arm)];
}

/// Sets the target position and velocity of a joint motor.
pub(crate) fn set_motor_target(
    link: &mut MultibodyLink,
    joint: usize,
    state: &JointState,
    motors: &Motors,
) {
    let (stiffness, damping) = if joint < ARM_DOF {
        (motors.arm_stiffness, motors.arm_damping)
    } else {
        (motors.hand_stiffness, motors.hand_damping)
    };
    let (q, qd) = (state.q[joint] as f32, state.qd[joint] as f32);
    link.joint.data.set_motor(JointAxis::AngX, q, qd, stiffness, damping);
}

/// Cubic Hermite interpolation between two states one control period apart, at the fraction `s` in 0..1.
pub(crate) fn hermite(from: &JointState, to: &JointState, s: f64) -> JointState {
    let t = CONTROL_DT;
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
    fn hermite_agrees_with_eq6_and_eq7_between_control_steps() {
        let qdd = JointVector::from_fn(|i, _| i as f64 - 11.0);
        let from = JointState {
            q: JointVector::from_element(0.2),
            qd: JointVector::from_fn(|i, _| 0.1 * i as f64),
        };
        let to = robot::integrator::step(&from, &qdd, CONTROL_DT);
        for s in [0.25, 0.5, 1.0] {
            let wanted = robot::integrator::step(&from, &qdd, s * CONTROL_DT);
            let got = hermite(&from, &to, s);
            assert!((got.q - wanted.q).amax() < 1e-12 && (got.qd - wanted.qd).amax() < 1e-10);
        }
    }
}
