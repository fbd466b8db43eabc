//! URDF parser: links with inertia and primitive collision shapes, revolute and fixed joints.

use crate::hand_model::LinkRole;
use crate::tree::{CollisionShape, Primitive};
use crate::xml_element::Element;
use crate::{Isometry, Vector, rotation};
use nalgebra::Matrix3;

/// Error in a robot description.
#[derive(Debug, thiserror::Error)]
pub enum UrdfError {
    /// The text is not XML.
    #[error("the robot description is not well-formed XML: {0}")]
    Xml(String),
    /// An element or attribute is missing or cannot be parsed.
    #[error("robot description, line {line}: <{element}> needs {wanted}, found {found}")]
    Element {
        /// Line in the file, from 1.
        line: u32,
        /// Name of the XML element.
        element: String,
        /// Description of the expected content.
        wanted: String,
        /// Description of the actual content.
        found: String,
    },
    /// The links and joints do not form the expected kinematic tree.
    #[error("robot description: {0}")]
    Tree(String),
    /// The hand file is not valid, or does not match the URDF.
    #[error("hand file: {0}. Correct hand.toml in the folder of the robot")]
    Hand(String),
}

pub(crate) struct UrdfLink {
    pub(crate) name: String,
    pub(crate) mass: f64,
    pub(crate) com: Vector,
    pub(crate) inertia: Matrix3<f64>,
    pub(crate) shapes: Vec<CollisionShape>,
}

pub(crate) struct UrdfJoint {
    pub(crate) name: String,
    pub(crate) parent: String,
    pub(crate) child: String,
    pub(crate) origin: Isometry,
    /// Axis and limits [lower, upper, velocity, torque, acceleration] of a revolute joint; `None` if fixed.
    pub(crate) axis_and_limits: Option<(Vector, [f64; 5])>,
}

/// Links and joints of a URDF document.
pub(crate) struct Urdf {
    pub(crate) links: Vec<UrdfLink>,
    pub(crate) joints: Vec<UrdfJoint>,
}

impl Urdf {
    pub(crate) fn parse(text: &str) -> Result<Self, UrdfError> {
        Self::read(&Element::parse(text).map_err(|error| UrdfError::Xml(error.to_string()))?)
    }

    /// Parses an element tree in JSON, as written by `build.rs`.
    pub(crate) fn parse_json(text: &str) -> Result<Self, UrdfError> {
        let robot = serde_json::from_slice(text.as_bytes());
        Self::read(&robot.map_err(|error| UrdfError::Xml(error.to_string()))?)
    }

    fn read(robot: &Element) -> Result<Self, UrdfError> {
        let links = named(robot, "link").map(parse_link).collect::<Result<_, _>>()?;
        let joints = named(robot, "joint").map(parse_joint).collect::<Result<_, _>>()?;
        Ok(Self { links, joints })
    }
}

fn named<'a>(parent: &'a Element, name: &'static str) -> impl Iterator<Item = &'a Element> {
    parent.children.iter().filter(move |child| child.name == name)
}

fn parse_link(node: &Element) -> Result<UrdfLink, UrdfError> {
    let name = attribute(node, "name")?.to_owned();
    let mut link = UrdfLink {
        name: name.clone(),
        mass: 0.0,
        com: Vector::zeros(),
        inertia: Matrix3::zeros(),
        shapes: Vec::new(),
    };
    if let Ok(inertial) = find_child(node, "inertial") {
        link.mass = finite_number(find_child(inertial, "mass")?, "value")?;
        link.com = parse_origin(inertial)?.translation.vector;
        let node = find_child(inertial, "inertia")?;
        let entry = |key| finite_number(node, key);
        let (xx, yy, zz) = (entry("ixx")?, entry("iyy")?, entry("izz")?);
        let (xy, xz, yz) = (entry("ixy")?, entry("ixz")?, entry("iyz")?);
        link.inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    }
    for collision in named(node, "collision") {
        let geometry = find_child(collision, "geometry")?;
        let Some(node) = geometry.children.first() else {
            return Err(element_error(geometry, "a shape", "nothing"));
        };
        let geometry = match node.name.as_str() {
            "box" => {
                Primitive::Box { half_extents: 0.5 * Vector::from(finite_triple(node, "size")?) }
            }
            "cylinder" => Primitive::Cylinder {
                radius: finite_number(node, "radius")?,
                half_length: 0.5 * finite_number(node, "length")?,
            },
            "capsule" => Primitive::Capsule {
                radius: finite_number(node, "radius")?,
                half_length: 0.5 * finite_number(node, "length")?,
            },
            other => return Err(element_error(node, "box, cylinder or capsule", other)),
        };
        link.shapes.push(CollisionShape {
            link: name.clone(),
            origin: parse_origin(collision)?,
            primitive: geometry,
            role: LinkRole::default(),
        });
    }
    Ok(link)
}

fn parse_joint(node: &Element) -> Result<UrdfJoint, UrdfError> {
    let motion = match attribute(node, "type")? {
        "fixed" => None,
        "revolute" => {
            let axis = Vector::from(finite_triple(find_child(node, "axis")?, "xyz")?);
            let limit = find_child(node, "limit")?;
            let keys = ["lower", "upper", "velocity", "effort", "acceleration"];
            let mut values = [0.0; 5];
            for (value, key) in values.iter_mut().zip(keys) {
                *value = finite_number(limit, key)?;
            }
            Some((axis.normalize(), values))
        }
        other => return Err(element_error(node, "type fixed or revolute", other)),
    };
    Ok(UrdfJoint {
        name: attribute(node, "name")?.to_owned(),
        parent: attribute(find_child(node, "parent")?, "link")?.to_owned(),
        child: attribute(find_child(node, "child")?, "link")?.to_owned(),
        origin: parse_origin(node)?,
        axis_and_limits: motion,
    })
}

fn parse_origin(node: &Element) -> Result<Isometry, UrdfError> {
    let Ok(origin) = find_child(node, "origin") else { return Ok(Isometry::identity()) };
    let vector = |key| match find_attribute(origin, key) {
        Some(_) => finite_triple(origin, key),
        None => Ok([0.0; 3]),
    };
    let translation = Vector::from(vector("xyz")?);
    Ok(Isometry::from_parts(translation.into(), rotation::from_rpy(vector("rpy")?)))
}

fn find_child<'a>(node: &'a Element, name: &'static str) -> Result<&'a Element, UrdfError> {
    named(node, name).next().ok_or_else(|| element_error(node, &format!("a <{name}>"), "none"))
}

fn find_attribute<'a>(node: &'a Element, key: &str) -> Option<&'a str> {
    let (_, value) = node.attributes.iter().find(|(name, _)| name == key)?;
    Some(value)
}

fn attribute<'a>(node: &'a Element, key: &str) -> Result<&'a str, UrdfError> {
    find_attribute(node, key)
        .ok_or_else(|| element_error(node, &format!("the attribute {key}"), "none"))
}

fn finite_number(node: &Element, key: &str) -> Result<f64, UrdfError> {
    let value = attribute(node, key)?;
    match value.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(element_error(node, &format!("a finite number as {key}"), value)),
    }
}

fn finite_triple(node: &Element, key: &str) -> Result<[f64; 3], UrdfError> {
    let value = attribute(node, key)?;
    let parts: Result<Vec<f64>, _> = value.split_whitespace().map(str::parse).collect();
    match <[f64; 3]>::try_from(parts.unwrap_or_default()) {
        Ok(three) if three.iter().all(|number| number.is_finite()) => Ok(three),
        _ => Err(element_error(node, &format!("three finite numbers as {key}"), value)),
    }
}

fn element_error(node: &Element, wanted: &str, found: &str) -> UrdfError {
    UrdfError::Element {
        line: node.line,
        element: node.name.clone(),
        wanted: wanted.to_owned(),
        found: found.to_owned(),
    }
}
