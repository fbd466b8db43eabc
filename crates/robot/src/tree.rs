//! The kinematic tree: 24 rigid bodies, 23 revolute joints between them.
//!
//! Links that a fixed joint ties to another become part of that link's body: the mount and the palm
//! belong to the last arm body, each fingertip frame to its distal link.

use crate::limits::Limits;
use crate::urdf::{self, UrdfError, UrdfLink};
use crate::{ARM, DOF, FINGERS, Isometry, JointVector, Vector};
use nalgebra::Matrix3;
use std::collections::BTreeMap;

/// The robot's kinematics, inertia and collision shapes.
#[derive(Clone, Debug)]
pub struct Tree {
    /// Joint i moves body i + 1; parents come before children.
    pub joints: Vec<Joint>,
    /// Body 0 is the fixed base.
    pub bodies: Vec<Body>,
    /// Every URDF link as a frame on a body.
    pub frames: BTreeMap<String, Frame>,
    /// Limits of all joints.
    pub limits: Limits,
    /// The palm: x along its normal, y towards the index finger, z along the fingers.
    pub palm: Frame,
    /// Centres of the four fingertips: index, middle, ring, thumb.
    pub tips: [Frame; FINGERS],
}

/// A revolute joint.
#[derive(Clone, Debug)]
pub struct Joint {
    /// URDF name.
    pub name: String,
    /// Index of the parent body.
    pub parent: usize,
    /// Pose of the child body in the parent body at q = 0.
    pub parent_from_child: Isometry,
    /// Unit axis, child frame.
    pub axis: Vector,
}

/// A rigid body: one moving URDF link and all that is fixed to it.
#[derive(Clone, Debug)]
pub struct Body {
    /// Name of the URDF link whose frame the body has.
    pub name: String,
    /// Mass (kg).
    pub mass: f64,
    /// Centre of mass (m), body frame.
    pub com: Vector,
    /// Inertia about the centre of mass (kg m²), body axes.
    pub inertia: Matrix3<f64>,
    /// Collision shapes.
    pub shapes: Vec<Shape>,
}

/// A frame fixed to a body.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Body index.
    pub body: usize,
    /// Pose of the frame in the body.
    pub body_from_frame: Isometry,
}

/// A primitive collision shape.
#[derive(Clone, Debug)]
pub struct Shape {
    /// URDF link that brought it.
    pub link: String,
    /// Pose in the body.
    pub origin: Isometry,
    /// What it is; long axes run along z.
    pub geometry: Geometry,
}

/// Primitive solids, sizes in metres.
#[derive(Clone, Copy, Debug)]
pub enum Geometry {
    /// A box by its half sizes.
    Box {
        /// Half sizes along x, y, z.
        half: Vector,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Half of its length.
        half_length: f64,
    },
    /// A cylinder along z with a hemisphere at each end.
    Capsule {
        /// Radius.
        radius: f64,
        /// Half of the length of its axis, hemispheres not counted.
        half_length: f64,
    },
}

impl Tree {
    /// The robot of this project, from `assets/robot/iiwa7_allegro.urdf`.
    pub fn iiwa7_allegro() -> Result<Self, UrdfError> {
        Self::from_urdf(include_str!("../../../assets/robot/iiwa7_allegro.urdf"))
    }

    /// Builds the tree from URDF text; the joints must be 7 of an arm and then 4 x 4 of a hand, with
    /// links named `palm` and `index_tip`, `middle_tip`, `ring_tip`, `thumb_tip`.
    pub fn from_urdf(text: &str) -> Result<Self, UrdfError> {
        let (links, joints) = urdf::parse(text)?;
        let mut link_of: BTreeMap<&str, &UrdfLink> =
            links.iter().map(|link| (link.name.as_str(), link)).collect();
        let mut take = |name: &str| {
            link_of
                .remove(name)
                .ok_or_else(|| UrdfError::Tree(format!("no unused link named {name}")))
        };
        let Some(root) = joints.first() else {
            return Err(UrdfError::Tree("it has no joints".into()));
        };

        let mut frames = BTreeMap::new();
        let mut bodies = vec![Body::empty(&root.parent)];
        bodies[0].attach(take(&root.parent)?, &Isometry::identity());
        frames.insert(root.parent.clone(), Frame::origin_of(0));
        let mut moving = Vec::new();
        let mut rows = Vec::new();
        for joint in &joints {
            let Some(&parent) = frames.get(&joint.parent) else {
                return Err(UrdfError::Tree(format!(
                    "joint {} hangs on {}, which no earlier joint carries",
                    joint.name, joint.parent
                )));
            };
            let child = take(&joint.child)?;
            let origin = parent.body_from_frame * joint.origin;
            let frame = match joint.motion {
                None => Frame { body: parent.body, body_from_frame: origin },
                Some((axis, limits)) => {
                    moving.push(Joint {
                        name: joint.name.clone(),
                        parent: parent.body,
                        parent_from_child: origin,
                        axis,
                    });
                    rows.push(limits);
                    bodies.push(Body::empty(&joint.child));
                    Frame::origin_of(bodies.len() - 1)
                }
            };
            bodies[frame.body].attach(child, &frame.body_from_frame);
            frames.insert(joint.child.clone(), frame);
        }
        if moving.len() != DOF {
            return Err(UrdfError::Tree(format!(
                "{DOF} moving joints wanted, {} found",
                moving.len()
            )));
        }
        let frame = |name: &str| {
            frames
                .get(name)
                .copied()
                .ok_or_else(|| UrdfError::Tree(format!("no link named {name}")))
        };
        let palm = frame("palm")?;
        let tips =
            [frame("index_tip")?, frame("middle_tip")?, frame("ring_tip")?, frame("thumb_tip")?];
        if palm.body != ARM {
            return Err(UrdfError::Tree("the palm must be carried by the seventh joint".into()));
        }
        let row = |k: usize| JointVector::from_fn(|i, _| rows[i][k]);
        let limits = Limits {
            lower: row(0),
            upper: row(1),
            velocity: row(2),
            effort: row(3),
            acceleration: row(4),
        };
        Ok(Self { joints: moving, bodies, limits, palm, tips, frames })
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

    /// Adds the mass and the shapes of a link that sits at `body_from_link`.
    fn attach(&mut self, link: &UrdfLink, body_from_link: &Isometry) {
        let rotation = body_from_link.rotation.to_rotation_matrix();
        let com = body_from_link.transform_point(&link.com.into()).coords;
        let mass = self.mass + link.mass;
        if mass > 0.0 {
            let joint_com = (self.com * self.mass + com * link.mass) / mass;
            self.inertia = shifted(&self.inertia, self.mass, &(self.com - joint_com))
                + shifted(
                    &(rotation.matrix() * link.inertia * rotation.matrix().transpose()),
                    link.mass,
                    &(com - joint_com),
                );
            self.com = joint_com;
            self.mass = mass;
        }
        self.shapes.extend(
            link.shapes
                .iter()
                .map(|shape| Shape { origin: body_from_link * shape.origin, ..shape.clone() }),
        );
    }
}

/// Steiner's theorem: inertia about a point that lies `d` from the centre of mass.
fn shifted(inertia: &Matrix3<f64>, mass: f64, d: &Vector) -> Matrix3<f64> {
    inertia + mass * (Matrix3::identity() * d.norm_squared() - d * d.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_carry_the_whole_mass() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let total: f64 = tree.bodies.iter().map(|body| body.mass).sum();
        assert_eq!(tree.bodies.len(), DOF + 1);
        assert!((total - 20.0912).abs() < 1e-4, "total mass {total}, wanted 20.0912 kg");
    }

    #[test]
    fn inertias_are_possible() {
        for body in Tree::iiwa7_allegro().unwrap().bodies {
            let [a, b, c]: [f64; 3] = body.inertia.symmetric_eigenvalues().into();
            assert!(a > 0.0 && b > 0.0 && c > 0.0, "{}: {a} {b} {c}", body.name);
            let largest = a.max(b).max(c);
            assert!(2.0 * largest < a + b + c, "{}: no mass has {a} {b} {c}", body.name);
        }
    }

    #[test]
    fn a_joint_moves_its_own_chain_only() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let (index_tip, thumb_tip) = (tree.tips[0].body, tree.tips[3].body);
        let moves = |joint: usize, body: usize| {
            let mut at = body;
            while at > joint + 1 {
                at = tree.joints[at - 1].parent;
            }
            at == joint + 1
        };
        assert!(moves(0, index_tip) && moves(ARM, index_tip));
        assert!(!moves(ARM, thumb_tip) && !moves(ARM, tree.palm.body));
    }

    #[test]
    fn bad_descriptions_say_where_and_why() {
        let good = include_str!("../../../assets/robot/iiwa7_allegro.urdf");
        let message = |text: &str| Tree::from_urdf(text).unwrap_err().to_string();
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
