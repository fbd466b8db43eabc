//! Visual meshes of the robot: lofts for the arm's covers, rounded primitives for the hand.
//!
//! In: the kinematic tree. Out: one mesh per body and colour, in the body's frame.

use geometry::{Pose, Vec3};
use mesh::Mesh;
use objects::loft::{Loft, Section};
use robot::tree::{CollisionShape, KinematicTree, Primitive};
use robot::{Vector, rotation};
use serde::Deserialize;
use std::collections::BTreeMap;

/// Visual mesh of a body.
pub(crate) struct LinkVisual {
    /// Index of the body.
    pub(crate) body: usize,
    /// CSS colour.
    pub(crate) color: &'static str,
    /// Mesh (body frame).
    pub(crate) mesh: Mesh,
}

const COVER_COLOR: &str = "#e6e4df";
const FLANGE_COLOR: &str = "#b4b6b6";
const HAND_COLOR: &str = "#3d3f44";

/// Cross-sections of the arm's links, from the profile file.
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

/// Visual meshes of all bodies; an error if the profile file is invalid.
pub(crate) fn link_visuals(tree: &KinematicTree) -> Result<Vec<LinkVisual>, serde_json::Error> {
    let profile: Profile = serde_json::from_slice(include_bytes!(
        "../../assets/robot/iiwa7_allegro/visual_profile.json"
    ))?;
    let mut parts = Vec::new();
    for (index, body) in tree.bodies.iter().enumerate() {
        let cover = profile.links.get(&body.name);
        if let Some(cover) = cover {
            let is_flange = body.name == tree.hand.links.flange;
            let color = if is_flange { FLANGE_COLOR } else { COVER_COLOR };
            parts.push(LinkVisual { body: index, color, mesh: cover.mesh() });
        }
        // A cover hides the primitives of its own link, but not those of links fixed to it.
        let visible = body.shapes.iter().filter(|shape| cover.is_none() || shape.link != body.name);
        let mut mesh = Mesh::default();
        visible.for_each(|shape| append(&mut mesh, &primitive_mesh(shape)));
        if !mesh.triangles.is_empty() {
            parts.push(LinkVisual { body: index, color: HAND_COLOR, mesh });
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
            // Sections across y have axes x and z. The exchange mirrors the mesh, so the triangles are
            // flipped.
            mesh.vertices.iter_mut().for_each(|v| *v = Vec3::new(v.x, v.z, v.y));
            mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        mesh
    }
}

fn primitive_mesh(shape: &CollisionShape) -> Mesh {
    let loft = match shape.primitive {
        Primitive::Box { half_extents: half } => rounded_box(&half),
        Primitive::Cylinder { radius, half_length } => {
            round_loft(&[(-half_length, radius), (half_length, radius)])
        }
        Primitive::Capsule { radius, half_length } => capsule(radius, half_length),
    };
    transformed(loft.mesh(), &rotation::to_pose(&shape.origin))
}

/// Max edge radius of a box (m).
const MAX_EDGE_RADIUS: f32 = 0.003;

fn rounded_box(half: &Vector) -> Loft {
    let [a, b, c] = [half.x as f32, half.y as f32, half.z as f32];
    let r = MAX_EDGE_RADIUS.min(0.3 * a.min(b).min(c));
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
    // The poles are omitted: their sections have zero size.
    let cap = |side: f64| {
        (1..=RINGS).map(move |i| {
            let (sin, cos) =
                libm::sincos(f64::from(i) / f64::from(RINGS) * std::f64::consts::FRAC_PI_2);
            (side * (half_length + radius * cos), radius * sin)
        })
    };
    let rows: Vec<(f64, f64)> = cap(-1.0).chain(cap(1.0).rev()).collect();
    round_loft(&rows)
}

/// Loft of circular sections (height, radius).
fn round_loft(rows: &[(f64, f64)]) -> Loft {
    let section = |&(height, radius): &(f64, f64)| Section {
        height: height as f32,
        half: [radius as f32; 2],
        exponent: 2.0,
        center: [0.0; 2],
    };
    Loft { sections: rows.iter().map(section).collect() }
}

fn transformed(mut mesh: Mesh, pose: &Pose) -> Mesh {
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
    use wasm_bindgen_test::wasm_bindgen_test as test;

    #[test]
    fn every_body_has_watertight_outward_visuals() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let parts = link_visuals(&tree).unwrap();
        for (index, body) in tree.bodies.iter().enumerate() {
            assert!(
                parts.iter().any(|part| part.body == index),
                "{} has no visual mesh",
                body.name
            );
        }
        for part in parts.iter().filter(|part| part.color != HAND_COLOR) {
            let (_, repair) = mesh::repair(part.mesh.clone()).unwrap();
            assert!(repair.watertight, "body {}: {repair:?}", part.body);
            assert_eq!(repair.flipped_triangles, 0, "body {}", part.body);
        }
    }

    #[test]
    fn visual_extents_match_collision_primitives() {
        let capsule = capsule(0.012, 0.01).mesh().extent();
        assert!((capsule - Vec3::new(0.024, 0.024, 0.044)).abs().max_element() < 1e-3, "{capsule}");
        let rounded = rounded_box(&Vector::new(0.01, 0.02, 0.03)).mesh().extent();
        assert!((rounded - Vec3::new(0.02, 0.04, 0.06)).abs().max_element() < 1e-3, "{rounded}");
    }
}
