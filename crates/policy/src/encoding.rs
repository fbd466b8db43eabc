//! What a policy knows of an object: at which bearing from the robot it stands, and z of its cloud,
//! turned to the front.
//!
//! *Departure: in the paper z tells of the bearing too. The robot's first joint turns about the vertical,
//! so that a task that is turned with it stays the same task: to turn cloud and joint to the front before
//! the networks see them takes one of the three dimensions of an object's pose from what they must learn.*

use crate::network::Network;
use geometry::Vec3;
use robot::{Isometry, JointState, JointVector, rotation};

/// What is known of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Encoding {
    /// Angle (rad) about the robot's vertical axis, from straight ahead to the middle of the cloud.
    pub bearing: f64,
    /// What the policy is told of the cloud turned to the front: z, whitened, or its position.
    pub z: Vec<f32>,
}

/// The cloud (base frame) turned about the robot's vertical axis until its mean lies straight ahead, and
/// the bearing (rad) at which it lay.
pub fn to_front(cloud: &[Vec3]) -> (f64, Vec<Vec3>) {
    let sum = cloud.iter().fold(Vec3::ZERO, |sum, point| sum + *point);
    let bearing = libm::atan2f(sum.y, sum.x);
    let (sin, cos) = (libm::sinf(bearing), libm::cosf(bearing));
    let turn = |p: &Vec3| Vec3::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x, p.z);
    (f64::from(bearing), cloud.iter().map(turn).collect())
}

/// A cloud that was turned to the front, turned back to the bearing (rad) at which it lay.
pub fn from_front(bearing: f64, cloud: &[Vec3]) -> Vec<Vec3> {
    let (sin, cos) = libm::sincosf(bearing as f32);
    let turn = |p: &Vec3| Vec3::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z);
    cloud.iter().map(turn).collect()
}

impl Encoding {
    /// q̈ (rad/s²) of a policy at a state; `None` if it is not finite.
    pub fn acceleration(&self, network: &Network, state: &JointState) -> Option<JointVector> {
        network.acceleration(&self.state_in_front(state), &self.z)
    }

    /// A state as it is with the object in front.
    pub fn state_in_front(&self, state: &JointState) -> JointState {
        JointState { q: self.in_front(&state.q), qd: state.qd }
    }

    /// A configuration as it is with the object in front.
    pub fn in_front(&self, q: &JointVector) -> JointVector {
        let mut front = *q;
        front[0] -= self.bearing;
        front
    }

    /// A configuration for an object in front, turned to where the object is.
    pub fn at_bearing(&self, front: &JointVector) -> JointVector {
        let mut q = *front;
        q[0] += self.bearing;
        q
    }

    /// A pose (base frame) as it is with the object in front.
    pub fn pose_in_front(&self, pose: &Isometry) -> Isometry {
        rotation::about_vertical(-self.bearing) * pose
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Pose;
    use robot::Tree;

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
    fn a_turned_cloud_is_the_same_in_front_at_another_bearing() {
        let (bearing, front) = to_front(&cloud());
        let mean = front.iter().sum::<Vec3>() / front.len() as f32;
        assert!(mean.y.abs() < 1e-6 && mean.x > 0.6, "{mean}");
        for turn in [-2.0f32, -0.4, 0.3, 1.5] {
            let (other, same) = to_front(&turned(&cloud(), turn));
            assert!((other - bearing - f64::from(turn)).abs() < 1e-6, "{other}");
            let off = front.iter().zip(&same).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
            assert!(off < 1e-6, "off by {off} m");
        }
    }

    #[test]
    fn palm_and_joints_turn_alike() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let encoding = Encoding { bearing: 0.4, z: vec![] };
        let q = JointVector::from_fn(|i, _| 0.3 * libm::cos(i as f64));
        let front = encoding.in_front(&q);
        assert!((encoding.at_bearing(&front) - q).amax() < 1e-15);
        let wanted = tree.kinematics(&front).palm();
        let got = encoding.pose_in_front(&tree.kinematics(&q).palm());
        assert!((wanted.translation.vector - got.translation.vector).norm() < 1e-12);
        assert!(rotation::angle_between(&wanted.rotation, &got.rotation) < 1e-7);
    }
}
