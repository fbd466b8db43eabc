//! Observation of an object: its azimuth about the robot, and z of its cloud in the canonical frame.
//!
//! *Departure: in the paper, z also encodes the azimuth. Here cloud and joints are first rotated about the
//! robot's vertical axis to azimuth 0. The robot's first joint has this axis, so the rotated task is the same
//! task. This removes one of the three dimensions of an object's pose from the learning problem.*

use crate::networks::{NetworkInput, ObservationKind};
use geometry::Vec3;
use robot::{Isometry, JointState, JointVector, Vector, rotation};

/// The policy's observation of an object, made once before an attempt.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// Angle (rad) about the robot's vertical axis, from the x axis to the mean of the cloud; positive to the
    /// left.
    pub azimuth: f64,
    /// Shape (32): z, whitened. Or shape (3): the position of the cloud in workspace units. Both are in the
    /// canonical frame ([`crate::ObservationKind`]).
    pub latent: Vec<f32>,
}

/// Rotates a cloud (base frame) about the robot's vertical axis, so that its mean is at azimuth 0. Also
/// returns the original azimuth (rad).
///
/// ```rust
/// use geometry::Vec3;
/// use policy::observation::canonicalize;
/// // Two points to the left of the robot, at azimuth 90 degrees (base frame, m).
/// let cloud = [Vec3::new(0.0, 0.6, -0.2), Vec3::new(0.0, 0.6, -0.1)];
/// let (azimuth, canonical) = canonicalize(&cloud);
/// assert!((azimuth - std::f64::consts::FRAC_PI_2).abs() < 1e-6); // rad
/// assert!(canonical[0].distance(Vec3::new(0.6, 0.0, -0.2)) < 1e-6);
/// ```
pub fn canonicalize(cloud: &[Vec3]) -> (f64, Vec<Vec3>) {
    let sum = cloud.iter().fold(Vec3::ZERO, |sum, point| sum + *point);
    let azimuth = libm::atan2f(sum.y, sum.x);
    let (sin, cos) = (libm::sinf(azimuth), libm::cosf(azimuth));
    let rotate = |p: &Vec3| Vec3::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x, p.z);
    (f64::from(azimuth), cloud.iter().map(rotate).collect())
}

/// Rotates a cloud from the canonical frame to an azimuth (rad); the inverse of [`canonicalize`].
pub fn cloud_from_canonical(azimuth: f64, cloud: &[Vec3]) -> Vec<Vec3> {
    let (sin, cos) = libm::sincosf(azimuth as f32);
    let rotate = |p: &Vec3| Vec3::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z);
    cloud.iter().map(rotate).collect()
}

/// Number of values of a [`cloud_box`].
pub const BOX_DIM: usize = 6;
/// Centre (m) and scale (m) of the sides of a box. With this scale they vary about as much as z.
const BOX_CENTER: Vec3 = Vec3::new(0.6, 0.0, -0.2);
const BOX_SCALE: f32 = 0.05;
/// Fraction of the points beyond each side: depth noise moves single points.
const BOX_OUTLIERS: f32 = 0.01;

/// Shape (6): lower, then upper sides of the box around a cloud (m, canonical frame), dimensionless. Zeros if the
/// cloud is empty.
pub fn cloud_box(canonical: &[Vec3]) -> [f32; BOX_DIM] {
    let mut sides = [0.0; BOX_DIM];
    for axis in 0..3 {
        let mut along: Vec<f32> = canonical.iter().map(|point| point[axis]).collect();
        along.sort_by(f32::total_cmp);
        let skipped = (BOX_OUTLIERS * along.len() as f32) as usize;
        let ends = [skipped, along.len().saturating_sub(1 + skipped)];
        for (k, end) in ends.into_iter().enumerate() {
            let side = along.get(end).copied().unwrap_or(BOX_CENTER[axis]);
            sides[3 * k + axis] = (side - BOX_CENTER[axis]) / BOX_SCALE;
        }
    }
    sides
}

/// Centre (m) of a [`cloud_box`].
pub fn box_center(sides: &[f32]) -> Vector {
    let center =
        Vec3::from_array(std::array::from_fn(|axis| 0.5 * (sides[axis] + sides[3 + axis])));
    rotation::to_vector(BOX_CENTER + BOX_SCALE * center)
}

impl Observation {
    /// The values without surface points ([`ObservationKind::num_features`]).
    pub fn features(&self) -> &[f32] {
        &self.latent[..self.latent.len().min(ObservationKind::CloudAndSurface.num_features())]
    }

    /// Converts a state from the base frame to the canonical frame: the first joint is shifted by the azimuth.
    pub fn state_to_canonical(&self, state: &JointState) -> JointState {
        JointState { q: self.to_canonical(&state.q), qd: state.qd }
    }

    /// The network's input at a state in the base frame.
    pub fn network_input(&self, state: &JointState) -> NetworkInput<'_> {
        NetworkInput::new(self.state_to_canonical(state), &self.latent)
    }

    /// Converts a configuration (rad) from the base frame to the canonical frame.
    pub fn to_canonical(&self, q: &JointVector) -> JointVector {
        let mut canonical = *q;
        canonical[0] -= self.azimuth;
        canonical
    }

    /// Converts a configuration (rad) from the canonical frame to the base frame.
    pub fn from_canonical(&self, canonical: &JointVector) -> JointVector {
        let mut q = *canonical;
        q[0] += self.azimuth;
        q
    }

    /// Converts a pose (m) from the base frame to the canonical frame.
    pub fn pose_to_canonical(&self, pose: &Isometry) -> Isometry {
        rotation::rotation_z(-self.azimuth) * pose
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Pose;
    use robot::KinematicTree;

    fn cloud() -> Vec<Vec3> {
        (0..40)
            .map(|k| {
                let wave = |seed: f32| 0.05 * libm::sinf(seed * k as f32);
                Vec3::new(0.6 + wave(1.3), 0.1 + wave(2.1), -0.1 + wave(0.7))
            })
            .collect()
    }

    fn turned(cloud: &[Vec3], turn: f32) -> Vec<Vec3> {
        let turn = Pose::new(Vec3::ZERO, Vec3::Z * turn);
        cloud.iter().map(|p| turn * *p).collect()
    }

    #[test]
    fn canonical_cloud_is_invariant_to_azimuth() {
        let (azimuth, canonical) = canonicalize(&cloud());
        let mean = canonical.iter().sum::<Vec3>() / canonical.len() as f32;
        assert!(mean.y.abs() < 1e-6 && mean.x > 0.6, "{mean}");
        for turn in [-2.0f32, -0.4, 0.3, 1.5] {
            let (other, same) = canonicalize(&turned(&cloud(), turn));
            assert!((other - azimuth - f64::from(turn)).abs() < 1e-6, "{other}");
            let error =
                canonical.iter().zip(&same).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
            assert!(error < 1e-6, "error {error} m");
        }
    }

    #[test]
    fn palm_pose_and_joints_rotate_consistently() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let encoding = Observation { azimuth: 0.4, latent: vec![] };
        let q = JointVector::from_fn(|i, _| 0.3 * libm::cos(i as f64));
        let canonical = encoding.to_canonical(&q);
        assert!((encoding.from_canonical(&canonical) - q).amax() < 1e-15);
        let wanted = tree.forward_kinematics(&canonical).palm_pose();
        let got = encoding.pose_to_canonical(&tree.forward_kinematics(&q).palm_pose());
        assert!((wanted.translation.vector - got.translation.vector).norm() < 1e-12);
        assert!(rotation::angle_between(&wanted.rotation, &got.rotation) < 1e-7);
    }

    #[test]
    fn cloud_box_has_the_sides_of_the_cloud_without_outliers() {
        let point = |i: usize| {
            let [x, y, z] = [i % 8, i / 8 % 8, i / 64].map(|k| k as f32 / 7.0);
            Vec3::new(0.55 + 0.1 * x, -0.03 + 0.06 * y, -0.25 + 0.04 * z)
        };
        let mut cloud: Vec<Vec3> = (0..512).map(point).collect();
        let wanted = [-1.0, -0.6, -1.0, 1.0, 0.6, -0.2];
        let is_near = |sides: [f32; BOX_DIM]| {
            sides.iter().zip(wanted).all(|(side, wanted)| (side - wanted).abs() < 1e-4)
        };
        assert!(is_near(cloud_box(&cloud)), "{:?}", cloud_box(&cloud));
        cloud[3] = Vec3::new(0.1, 0.9, 0.4);
        assert!(is_near(cloud_box(&cloud)), "{:?}", cloud_box(&cloud));
        assert_eq!(cloud_box(&[]), [0.0; BOX_DIM]);
    }
}
