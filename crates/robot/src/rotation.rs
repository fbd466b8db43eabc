//! Rotations from angles, and conversions between single and double precision.
//!
//! Sine and cosine use `libm`, so that results are bit-identical natively and in the browser.

use crate::{Isometry, Vector};
use geometry::{Pose, Vec3};
use nalgebra::{Quaternion, UnitQuaternion};

/// Rotation by `angle` (rad) about the unit vector `axis`.
pub fn from_axis_angle(axis: &Vector, angle: f64) -> UnitQuaternion<f64> {
    let (sin, cos) = libm::sincos(0.5 * angle);
    UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, axis * sin))
}

/// Rotation by `angle` (rad) about the vertical axis through the base origin, which is the first joint's
/// axis.
pub fn rotation_z(angle: f64) -> Isometry {
    Isometry::from_parts(Vector::zeros().into(), from_axis_angle(&Vector::z(), angle))
}

/// Rotation from fixed-axis roll, pitch, yaw in the URDF convention: R = Rz(yaw) Ry(pitch) Rx(roll).
pub fn from_rpy(rpy: [f64; 3]) -> UnitQuaternion<f64> {
    from_axis_angle(&Vector::z(), rpy[2])
        * from_axis_angle(&Vector::y(), rpy[1])
        * from_axis_angle(&Vector::x(), rpy[0])
}

/// Rotation vector (rad) of `rotation`, with length 0 to π.
pub fn log(rotation: &UnitQuaternion<f64>) -> Vector {
    let q = if rotation.w < 0.0 { -rotation.into_inner() } else { rotation.into_inner() };
    let sin = q.imag().norm();
    if sin < 1e-12 {
        return 2.0 * q.imag();
    }
    q.imag() * (2.0 * libm::atan2(sin, q.w) / sin)
}

/// Angle between two rotations (rad), 0 to π.
pub fn angle_between(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    log(&(a.inverse() * b)).norm()
}

/// Converts a transform to single precision. This is the only conversion of poses from joint space to
/// physics.
pub fn to_pose(transform: &Isometry) -> Pose {
    let q = &transform.rotation;
    let rotation = glamx::Quat::from_xyzw(q.i as f32, q.j as f32, q.k as f32, q.w as f32);
    Pose::from_parts(to_vec3(&transform.translation.vector), rotation.normalize())
}

/// Converts a vector to single precision.
pub fn to_vec3(v: &Vector) -> Vec3 {
    Vec3::new(v.x as f32, v.y as f32, v.z as f32)
}

/// Converts a pose to double precision and renormalizes its rotation.
pub fn to_isometry(pose: &Pose) -> Isometry {
    let (t, r) = (pose.translation, pose.rotation);
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(
        r.w as f64, r.x as f64, r.y as f64, r.z as f64,
    ));
    Isometry::from_parts(to_vector(t).into(), rotation)
}

/// Converts a vector to double precision.
pub fn to_vector(v: Vec3) -> Vector {
    Vector::new(v.x as f64, v.y as f64, v.z as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_inverts_from_axis_angle() {
        let axis = Vector::new(1.0, -2.0, 0.5).normalize();
        for angle in [-3.1, -1.0, -1e-9, 0.0, 1e-9, 0.7, 3.1] {
            let got = log(&from_axis_angle(&axis, angle));
            assert!((got - axis * angle).norm() < 1e-12, "angle {angle}: {got}");
        }
    }

    #[test]
    fn from_rpy_follows_the_urdf_convention() {
        // A roll of 90 degrees maps y to z; a yaw of 90 degrees then maps x to y.
        let r = from_rpy([std::f64::consts::FRAC_PI_2, 0.0, std::f64::consts::FRAC_PI_2]);
        assert!((r * Vector::y() - Vector::z()).norm() < 1e-15);
        assert!((r * Vector::x() - Vector::y()).norm() < 1e-15);
    }
}
