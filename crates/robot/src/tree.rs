//! Kinematic tree: 24 rigid bodies connected by 23 revolute joints.
//!
//! Links connected by fixed joints are merged into one body: mount and palm belong to the last arm body, and
//! each fingertip frame belongs to its distal link.

use crate::collision_spheres::{self, SphereRow};
use crate::description::RobotDescription;
use crate::hand_model::{HandModel, LinkRole};
use crate::limits::JointLimits;
use crate::urdf::{Urdf, UrdfError, UrdfLink};
use crate::{ARM_DOF, DOF, Isometry, JointVector, NUM_FINGERS, Vector};
use nalgebra::Matrix3;
use std::collections::BTreeMap;

/// Kinematics, inertias and collision shapes of the robot, and the values of its [`HandModel`].
///
/// Hand and spheres are not serialized, so they do not contribute to the hash of the scene.
///
/// ```rust
/// use robot::{ARM_DOF, DOF, KinematicTree};
/// let tree = KinematicTree::iiwa7_allegro()?;
/// // Joint i moves body i + 1; body 0 is the fixed base.
/// assert_eq!((tree.joints.len(), tree.bodies.len()), (DOF, DOF + 1));
/// assert_eq!(tree.joint_index("index_joint_0"), Some(ARM_DOF));
/// // The palm is fixed to the last arm body.
/// assert_eq!(tree.palm.body, ARM_DOF);
/// # Ok::<(), robot::UrdfError>(())
/// ```
#[derive(Clone, Debug, serde::Serialize)]
pub struct KinematicTree {
    /// Joints in topological order: joint i moves body i + 1, and parents precede children.
    pub joints: Vec<Joint>,
    /// Rigid bodies; body 0 is the fixed base.
    pub bodies: Vec<Body>,
    /// Frame of every URDF link, by link name.
    pub frames: BTreeMap<String, Frame>,
    /// Limits of all joints.
    pub limits: JointLimits,
    /// Palm frame: x along the palm normal, y towards the index finger, z along the fingers.
    pub palm: Frame,
    /// Fingertip centres: index, middle, ring, thumb.
    pub fingertips: [Frame; NUM_FINGERS],
    /// Values of arm and hand that the URDF does not contain.
    #[serde(skip)]
    pub hand: HandModel,
    /// Spheres that cover the robot, link frames.
    #[serde(skip)]
    pub(crate) spheres: Vec<SphereRow>,
}

/// A revolute joint.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Joint {
    /// Name in the URDF.
    pub name: String,
    /// Index of the parent body.
    pub parent: usize,
    /// Pose (m) of the child body in the parent body at q = 0.
    pub parent_from_child: Isometry,
    /// Unit rotation axis, child frame.
    pub axis: Vector,
}

/// A rigid body: one moving URDF link with all links fixed to it.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Body {
    /// Name of the moving URDF link, whose frame is the body frame.
    pub name: String,
    /// Mass (kg).
    pub mass: f64,
    /// Centre of mass (m), body frame.
    pub com: Vector,
    /// Inertia about the centre of mass (kg m²), body axes.
    pub inertia: Matrix3<f64>,
    /// Collision shapes, body frame.
    pub shapes: Vec<CollisionShape>,
}

/// A frame fixed to a body.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Frame {
    /// Index of the body.
    pub body: usize,
    /// Pose (m) of the frame in the body frame.
    pub body_from_frame: Isometry,
}

/// A primitive collision shape.
#[derive(Clone, Debug, serde::Serialize)]
pub struct CollisionShape {
    /// Name of the URDF link that defines the shape.
    pub link: String,
    /// Pose (m) in the body frame.
    pub origin: Isometry,
    /// Type and size; the long axis is z.
    pub primitive: Primitive,
    /// Role of the link in collisions, from the hand file.
    #[serde(skip)]
    pub role: LinkRole,
}

/// Primitive shapes, sizes in metres.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub enum Primitive {
    /// A box.
    Box {
        /// Half extents along x, y, z.
        half_extents: Vector,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Half of the length.
        half_length: f64,
    },
    /// A cylinder along z with a hemisphere at each end.
    Capsule {
        /// Radius.
        radius: f64,
        /// Half of the axis length, without the hemispheres.
        half_length: f64,
    },
}

impl KinematicTree {
    /// The robot of this project: [`RobotDescription::STANDARD`], whose URDF was parsed at compile time.
    pub fn iiwa7_allegro() -> Result<Self, UrdfError> {
        let urdf = Urdf::parse_json(include_str!(concat!(env!("OUT_DIR"), "/urdf.json")))?;
        // The text of the URDF is not used, so that it does not become part of the page.
        let RobotDescription { hand, collision_spheres, .. } = RobotDescription::STANDARD;
        Self::combine(&urdf, hand, collision_spheres)
    }

    /// Builds the tree from the texts of a robot folder. The URDF requires 7 arm joints followed by 4 x 4 hand
    /// joints, and the links that the hand file names.
    pub fn load(description: &RobotDescription) -> Result<Self, UrdfError> {
        let RobotDescription { urdf, hand, collision_spheres } = *description;
        Self::combine(&Urdf::parse(urdf)?, hand, collision_spheres)
    }

    fn combine(urdf: &Urdf, hand: &str, spheres: &str) -> Result<Self, UrdfError> {
        let hand = HandModel::parse(hand)?;
        let spheres = collision_spheres::parse(spheres)?;
        let tree = Self::build(urdf, hand, spheres)?;
        tree.hand.check(&tree)?;
        tree.collision_spheres()?;
        Ok(tree)
    }

    fn build(urdf: &Urdf, hand: HandModel, spheres: Vec<SphereRow>) -> Result<Self, UrdfError> {
        let Urdf { links, joints } = urdf;
        let mut link_of: BTreeMap<&str, &UrdfLink> =
            links.iter().map(|link| (link.name.as_str(), link)).collect();
        let mut take_link = |name: &str| {
            link_of
                .remove(name)
                .ok_or_else(|| UrdfError::Tree(format!("no unused link named {name}")))
        };
        let Some(root) = joints.first() else {
            return Err(UrdfError::Tree("no joints".into()));
        };

        let mut frames = BTreeMap::new();
        let mut bodies = vec![Body::empty(&root.parent)];
        bodies[0].attach(take_link(&root.parent)?, &Isometry::identity());
        frames.insert(root.parent.clone(), Frame::origin_of(0));
        let mut revolute = Vec::new();
        let mut joint_limits = Vec::new();
        for joint in joints {
            let Some(&parent) = frames.get(&joint.parent) else {
                return Err(UrdfError::Tree(format!(
                    "joint {}: parent {} is not the child of an earlier joint",
                    joint.name, joint.parent
                )));
            };
            let child = take_link(&joint.child)?;
            let origin = parent.body_from_frame * joint.origin;
            let frame = match joint.axis_and_limits {
                None => Frame { body: parent.body, body_from_frame: origin },
                Some((axis, limits)) => {
                    revolute.push(Joint {
                        name: joint.name.clone(),
                        parent: parent.body,
                        parent_from_child: origin,
                        axis,
                    });
                    joint_limits.push(limits);
                    bodies.push(Body::empty(&joint.child));
                    Frame::origin_of(bodies.len() - 1)
                }
            };
            bodies[frame.body].attach(child, &frame.body_from_frame);
            frames.insert(joint.child.clone(), frame);
        }
        if revolute.len() != DOF {
            return Err(UrdfError::Tree(format!(
                "expected {DOF} revolute joints, found {}",
                revolute.len()
            )));
        }
        let frame = |name: &str| {
            frames
                .get(name)
                .copied()
                .ok_or_else(|| UrdfError::Tree(format!("no link named {name}")))
        };
        let palm = frame(&hand.links.palm)?;
        let [index, middle, ring, thumb] = hand.links.fingertips.each_ref().map(|tip| frame(tip));
        let tips = [index?, middle?, ring?, thumb?];
        if palm.body != ARM_DOF {
            return Err(UrdfError::Tree("the palm must be fixed to the child of joint 7".into()));
        }
        let column = |k: usize| JointVector::from_fn(|i, _| joint_limits[i][k]);
        let limits = JointLimits {
            lower: column(0),
            upper: column(1),
            velocity: column(2),
            torque: column(3),
            acceleration: column(4),
        };
        for shape in bodies.iter_mut().flat_map(|body| &mut body.shapes) {
            shape.role = hand.links.role(&shape.link);
        }
        Ok(Self { joints: revolute, bodies, limits, palm, fingertips: tips, frames, hand, spheres })
    }

    /// Index of the joint `name` in a joint vector.
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }
}

impl Frame {
    fn origin_of(body: usize) -> Self {
        Self { body, body_from_frame: Isometry::identity() }
    }
}

impl Body {
    fn empty(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            mass: 0.0,
            com: Vector::zeros(),
            inertia: Matrix3::zeros(),
            shapes: Vec::new(),
        }
    }

    /// Adds mass, inertia and shapes of a link at the pose `body_from_link`.
    fn attach(&mut self, link: &UrdfLink, body_from_link: &Isometry) {
        let rotation = body_from_link.rotation.to_rotation_matrix();
        let com = body_from_link.transform_point(&link.com.into()).coords;
        let mass = self.mass + link.mass;
        if mass > 0.0 {
            let combined_com = (self.com * self.mass + com * link.mass) / mass;
            self.inertia =
                parallel_axis_shift(&self.inertia, self.mass, &(self.com - combined_com))
                    + parallel_axis_shift(
                        &(rotation.matrix() * link.inertia * rotation.matrix().transpose()),
                        link.mass,
                        &(com - combined_com),
                    );
            self.com = combined_com;
            self.mass = mass;
        }
        self.shapes.extend(link.shapes.iter().map(|shape| CollisionShape {
            origin: body_from_link * shape.origin,
            ..shape.clone()
        }));
    }
}

/// Parallel-axis theorem: inertia about a point at offset `d` (m) from the centre of mass.
fn parallel_axis_shift(inertia: &Matrix3<f64>, mass: f64, d: &Vector) -> Matrix3<f64> {
    inertia + mass * (Matrix3::identity() * d.norm_squared() - d * d.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_have_the_total_mass_of_the_robot() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let total: f64 = tree.bodies.iter().map(|body| body.mass).sum();
        assert_eq!(tree.bodies.len(), DOF + 1);
        assert!((total - 20.0912).abs() < 1e-4, "total mass {total}, wanted 20.0912 kg");
    }

    #[test]
    fn inertias_satisfy_triangle_inequality() {
        for body in KinematicTree::iiwa7_allegro().unwrap().bodies {
            let [a, b, c]: [f64; 3] = body.inertia.symmetric_eigenvalues().into();
            assert!(a > 0.0 && b > 0.0 && c > 0.0, "{}: {a} {b} {c}", body.name);
            let largest = a.max(b).max(c);
            assert!(2.0 * largest < a + b + c, "{}: not physical: {a} {b} {c}", body.name);
        }
    }

    #[test]
    fn joint_moves_only_its_own_chain() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let (index_tip, thumb_tip) = (tree.fingertips[0].body, tree.fingertips[3].body);
        let moves = |joint: usize, body: usize| {
            let mut at = body;
            while at > joint + 1 {
                at = tree.joints[at - 1].parent;
            }
            at == joint + 1
        };
        assert!(moves(0, index_tip) && moves(ARM_DOF, index_tip));
        assert!(!moves(ARM_DOF, thumb_tip) && !moves(ARM_DOF, tree.palm.body));
    }

    #[test]
    fn embedded_robot_equals_that_of_the_urdf() {
        let embedded = KinematicTree::iiwa7_allegro().unwrap();
        let loaded = KinematicTree::load(&RobotDescription::STANDARD).unwrap();
        let value = |tree: &KinematicTree| serde_json::to_value(tree).unwrap();
        assert_eq!(value(&embedded), value(&loaded));
    }

    #[test]
    fn invalid_urdf_is_rejected_with_location_and_cause() {
        let good = RobotDescription::STANDARD.urdf;
        let message = |text: &str| {
            let description = RobotDescription { urdf: text, ..RobotDescription::STANDARD };
            KinematicTree::load(&description).unwrap_err().to_string()
        };
        assert!(message("<robot>").contains("XML"));
        assert!(message(&good.replace("effort=\"0.7\"", "")).contains("attribute effort"));
        assert!(
            message(&good.replace("mass value=\"2.73\"", "mass value=\"NaN\"")).contains("NaN")
        );
        for axis in ["0 0 one 1", "0 0 inf", "0 0"] {
            let text =
                message(&good.replace("axis xyz=\"0 0 1\"", &format!("axis xyz=\"{axis}\"")));
            assert!(text.contains("three finite numbers as xyz") && text.contains(axis), "{text}");
        }
        assert!(message(&good.replace("revolute", "ball")).contains("ball"));
        assert!(message(&good.replace("thumb_tip", "thumb_end")).contains("thumb_tip"));
    }
}
