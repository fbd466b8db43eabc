//! What the robot looks like: lofts for the arm's covers, rounded solids for the hand.
//!
//! In: the kinematic tree. Out: one mesh per body and colour, in the body's frame.

use geometry::loft::{Loft, Section};
use geometry::mesh::Mesh;
use geometry::{Pose, Vec3};
use robot::tree::{Geometry, Shape, Tree};
use robot::{Vector, rotation};
use serde::Deserialize;
use std::collections::BTreeMap;

/// A part to draw.
pub(crate) struct Part {
    /// Body that it moves with.
    pub(crate) body: usize,
    /// Colour, as CSS writes it.
    pub(crate) color: &'static str,
    /// Surface, body frame.
    pub(crate) mesh: Mesh,
}

const COVER: &str = "#e6e4df";
const FLANGE: &str = "#b4b6b6";
const HAND: &str = "#3d3f44";

/// Cross-sections of the arm's links; see the file.
#[derive(Deserialize)]
struct Profile {
    links: BTreeMap<String, Cover>,
}

#[derive(Deserialize)]
struct Cover {
    sweep_axis: Axis,
    /// Offset along the axis, centre (2) and half-widths (2) across it (m).
    sections: Vec<[f32; 5]>,
}

#[derive(Clone, Copy, Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Axis {
    Y,
    Z,
}

/// Every part of the robot; an error if the profile does not parse.
pub(crate) fn parts(tree: &Tree) -> Result<Vec<Part>, serde_json::Error> {
    let profile: Profile = serde_json::from_str(include_str!("../../assets/robot/profile.json"))?;
    let mut parts = Vec::new();
    for (index, body) in tree.bodies.iter().enumerate() {
        let cover = profile.links.get(&body.name);
        if let Some(cover) = cover {
            let color = if body.name == "link_7" { FLANGE } else { COVER };
            parts.push(Part { body: index, color, mesh: cover.mesh() });
        }
        // What a cover hides is not drawn, what is fixed to its link is.
        let seen = body.shapes.iter().filter(|shape| cover.is_none() || shape.link != body.name);
        let mut mesh = Mesh::default();
        seen.for_each(|shape| append(&mut mesh, &solid(shape)));
        if !mesh.triangles.is_empty() {
            parts.push(Part { body: index, color: HAND, mesh });
        }
    }
    Ok(parts)
}

impl Cover {
    fn mesh(&self) -> Mesh {
        let sections = self.sections.iter().map(|&[height, x, y, a, b]| Section {
            height,
            half: [a, b],
            exponent: 2.0,
            center: [x, y],
        });
        let mut mesh = Loft { sections: sections.collect() }.mesh();
        if self.sweep_axis == Axis::Y {
            // Across y lie x and z: a mirror image, so the triangles turn round too.
            mesh.vertices.iter_mut().for_each(|v| *v = Vec3::new(v.x, v.z, v.y));
            mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        mesh
    }
}

fn solid(shape: &Shape) -> Mesh {
    let loft = match shape.geometry {
        Geometry::Box { half } => rounded_box(&half),
        Geometry::Cylinder { radius, half_length } => {
            stack(&[(-half_length, radius), (half_length, radius)])
        }
        Geometry::Capsule { radius, half_length } => capsule(radius, half_length),
    };
    moved(loft.mesh(), &rotation::to_pose(&shape.origin))
}

/// Radius (m) of a box's edges, at most.
const ROUNDING: f32 = 0.003;

fn rounded_box(half: &Vector) -> Loft {
    let [a, b, c] = [half.x as f32, half.y as f32, half.z as f32];
    let r = ROUNDING.min(0.3 * a.min(b).min(c));
    let section = |height, inset: f32| Section {
        height,
        half: [a - inset, b - inset],
        exponent: 12.0,
        center: [0.0; 2],
    };
    let rows = [
        (-c, r),
        (-c + 0.3 * r, 0.3 * r),
        (-c + r, 0.0),
        (c - r, 0.0),
        (c - 0.3 * r, 0.3 * r),
        (c, r),
    ];
    Loft { sections: rows.map(|(height, inset)| section(height, inset)).to_vec() }
}

fn capsule(radius: f64, half_length: f64) -> Loft {
    const RINGS: i32 = 6;
    // The poles are left out: their section would have no size.
    let cap = |side: f64| {
        (1..=RINGS).map(move |i| {
            let (sin, cos) =
                libm::sincos(f64::from(i) / f64::from(RINGS) * std::f64::consts::FRAC_PI_2);
            (side * (half_length + radius * cos), radius * sin)
        })
    };
    let rows: Vec<(f64, f64)> = cap(-1.0).chain(cap(1.0).rev()).collect();
    stack(&rows)
}

/// Round sections of (height, radius).
fn stack(rows: &[(f64, f64)]) -> Loft {
    let section = |&(height, radius): &(f64, f64)| Section {
        height: height as f32,
        half: [radius as f32; 2],
        exponent: 2.0,
        center: [0.0; 2],
    };
    Loft { sections: rows.iter().map(section).collect() }
}

fn moved(mut mesh: Mesh, pose: &Pose) -> Mesh {
    mesh.vertices.iter_mut().for_each(|v| *v = *pose * *v);
    mesh
}

fn append(mesh: &mut Mesh, other: &Mesh) {
    let offset = mesh.vertices.len() as u32;
    mesh.vertices.extend(&other.vertices);
    mesh.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + offset)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::mesh;
    use wasm_bindgen_test::wasm_bindgen_test as test;

    #[test]
    fn every_body_is_seen_and_faces_outward() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let parts = parts(&tree).unwrap();
        for (index, body) in tree.bodies.iter().enumerate() {
            assert!(parts.iter().any(|part| part.body == index), "{} is not drawn", body.name);
        }
        for part in parts.iter().filter(|part| part.color != HAND) {
            let (_, healing) = mesh::heal(part.mesh.clone()).unwrap();
            assert!(healing.watertight, "body {}: {healing:?}", part.body);
            assert_eq!(healing.flipped_triangles, 0, "body {}", part.body);
        }
    }

    #[test]
    fn solids_have_the_sizes_of_their_shapes() {
        let capsule = capsule(0.012, 0.01).mesh().extent();
        assert!((capsule - Vec3::new(0.024, 0.024, 0.044)).abs().max_element() < 1e-3, "{capsule}");
        let rounded = rounded_box(&Vector::new(0.01, 0.02, 0.03)).mesh().extent();
        assert!((rounded - Vec3::new(0.02, 0.04, 0.06)).abs().max_element() < 1e-3, "{rounded}");
    }
}
