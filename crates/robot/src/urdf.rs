//! Reads the part of URDF that this robot uses: links with inertia and primitive collision shapes, revolute and fixed joints.

use crate::tree::{Geometry, Shape};
use crate::{Isometry, Vector, rotation};
use nalgebra::Matrix3;
use roxmltree::{Document, Node};

/// Why a robot description cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum UrdfError {
    /// The text is not XML.
    #[error("the robot description is not well-formed XML: {0}")]
    Xml(#[from] roxmltree::Error),
    /// An element or attribute is missing or unreadable.
    #[error("robot description, line {line}: <{element}> needs {wanted}, found {found}")]
    Element {
        /// Line in the file, from 1.
        line: u32,
        /// Element name.
        element: String,
        /// What is expected there.
        wanted: String,
        /// What is there.
        found: String,
    },
    /// The joints do not form the tree of this robot.
    #[error("robot description: {0}")]
    Tree(String),
}

pub(crate) struct UrdfLink {
    pub(crate) name: String,
    pub(crate) mass: f64,
    pub(crate) com: Vector,
    pub(crate) inertia: Matrix3<f64>,
    pub(crate) shapes: Vec<Shape>,
}

pub(crate) struct UrdfJoint {
    pub(crate) name: String,
    pub(crate) parent: String,
    pub(crate) child: String,
    pub(crate) origin: Isometry,
    /// Axis and limits [lower, upper, velocity, effort, acceleration]; `None` if the joint is fixed.
    pub(crate) motion: Option<(Vector, [f64; 5])>,
}

pub(crate) fn parse(text: &str) -> Result<(Vec<UrdfLink>, Vec<UrdfJoint>), UrdfError> {
    let document = Document::parse(text)?;
    let robot = document.root_element();
    let named = |name: &'static str| robot.children().filter(move |n| n.has_tag_name(name));
    let links = named("link").map(link).collect::<Result<_, _>>()?;
    let joints = named("joint").map(joint).collect::<Result<_, _>>()?;
    Ok((links, joints))
}

fn link(node: Node) -> Result<UrdfLink, UrdfError> {
    let name = text(node, "name")?.to_owned();
    let mut link = UrdfLink {
        name: name.clone(),
        mass: 0.0,
        com: Vector::zeros(),
        inertia: Matrix3::zeros(),
        shapes: Vec::new(),
    };
    if let Ok(inertial) = child(node, "inertial") {
        link.mass = number(child(inertial, "mass")?, "value")?;
        link.com = origin(inertial)?.translation.vector;
        let node = child(inertial, "inertia")?;
        let entry = |key| number(node, key);
        let (xx, yy, zz) = (entry("ixx")?, entry("iyy")?, entry("izz")?);
        let (xy, xz, yz) = (entry("ixy")?, entry("ixz")?, entry("iyz")?);
        link.inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    }
    for collision in node.children().filter(|n| n.has_tag_name("collision")) {
        let geometry = child(collision, "geometry")?;
        let Some(node) = geometry.children().find(Node::is_element) else {
            return Err(missing(geometry, "a shape", "nothing"));
        };
        let geometry = match node.tag_name().name() {
            "box" => Geometry::Box { half: 0.5 * Vector::from(numbers(node, "size")?) },
            "cylinder" => Geometry::Cylinder {
                radius: number(node, "radius")?,
                half_length: 0.5 * number(node, "length")?,
            },
            "capsule" => Geometry::Capsule {
                radius: number(node, "radius")?,
                half_length: 0.5 * number(node, "length")?,
            },
            other => return Err(missing(node, "box, cylinder or capsule", other)),
        };
        link.shapes.push(Shape { link: name.clone(), origin: origin(collision)?, geometry });
    }
    Ok(link)
}

fn joint(node: Node) -> Result<UrdfJoint, UrdfError> {
    let motion = match text(node, "type")? {
        "fixed" => None,
        "revolute" => {
            let axis = Vector::from(numbers(child(node, "axis")?, "xyz")?);
            let limit = child(node, "limit")?;
            let keys = ["lower", "upper", "velocity", "effort", "acceleration"];
            let mut values = [0.0; 5];
            for (value, key) in values.iter_mut().zip(keys) {
                *value = number(limit, key)?;
            }
            Some((axis.normalize(), values))
        }
        other => return Err(missing(node, "type fixed or revolute", other)),
    };
    Ok(UrdfJoint {
        name: text(node, "name")?.to_owned(),
        parent: text(child(node, "parent")?, "link")?.to_owned(),
        child: text(child(node, "child")?, "link")?.to_owned(),
        origin: origin(node)?,
        motion,
    })
}

fn origin(node: Node) -> Result<Isometry, UrdfError> {
    let Ok(origin) = child(node, "origin") else { return Ok(Isometry::identity()) };
    let vector = |key| match origin.attribute(key) {
        Some(_) => numbers(origin, key),
        None => Ok([0.0; 3]),
    };
    let translation = Vector::from(vector("xyz")?);
    Ok(Isometry::from_parts(translation.into(), rotation::from_rpy(vector("rpy")?)))
}

fn child<'a, 'input>(node: Node<'a, 'input>, name: &str) -> Result<Node<'a, 'input>, UrdfError> {
    node.children()
        .find(|n| n.has_tag_name(name))
        .ok_or_else(|| missing(node, &format!("a <{name}>"), "none"))
}

fn text<'a>(node: Node<'a, '_>, key: &str) -> Result<&'a str, UrdfError> {
    node.attribute(key).ok_or_else(|| missing(node, &format!("the attribute {key}"), "none"))
}

fn number(node: Node, key: &str) -> Result<f64, UrdfError> {
    let value = text(node, key)?;
    match value.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(missing(node, &format!("a finite number as {key}"), value)),
    }
}

fn numbers(node: Node, key: &str) -> Result<[f64; 3], UrdfError> {
    let value = text(node, key)?;
    let parts: Result<Vec<f64>, _> = value.split_whitespace().map(str::parse).collect();
    match <[f64; 3]>::try_from(parts.unwrap_or_default()) {
        Ok(three) if three.iter().all(|number| number.is_finite()) => Ok(three),
        _ => Err(missing(node, &format!("three finite numbers as {key}"), value)),
    }
}

fn missing(node: Node, wanted: &str, found: &str) -> UrdfError {
    UrdfError::Element {
        line: node.document().text_pos_at(node.range().start).row,
        element: node.tag_name().name().to_owned(),
        wanted: wanted.to_owned(),
        found: found.to_owned(),
    }
}
