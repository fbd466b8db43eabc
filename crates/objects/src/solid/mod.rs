//! Solids of which objects are composed: lofts, vessels with a cavity, and sweeps along a path.
//!
//! Each gives a closed mesh and convex parts; a union keeps those of all its members.

mod sweep;
mod vessel;

pub use sweep::{Sweep, SweepPoint};
pub use vessel::Vessel;

use crate::loft::Loft;
use geometry::{Pose, Vec3};
use mesh::Mesh;

/// Closed mesh, and point sets whose convex hulls together form the same body (m).
#[derive(Clone, Debug, Default)]
pub struct Solid {
    /// Surface.
    pub mesh: Mesh,
    /// Convex parts.
    pub parts: Vec<Vec<Vec3>>,
}

impl From<&Loft> for Solid {
    fn from(loft: &Loft) -> Self {
        Self { mesh: loft.mesh(), parts: loft.convex_parts() }
    }
}

impl Solid {
    /// The solid with each of its points mapped.
    pub fn map(mut self, map: impl Fn(Vec3) -> Vec3) -> Self {
        let points = self.mesh.vertices.iter_mut().chain(self.parts.iter_mut().flatten());
        points.for_each(|point| *point = map(*point));
        self
    }

    /// The solid at a pose.
    pub fn placed(self, pose: &Pose) -> Self {
        self.map(|point| *pose * point)
    }

    /// The solid moved by `offset` (m).
    pub fn moved(self, offset: Vec3) -> Self {
        self.map(|point| point + offset)
    }

    /// Meshes and parts of both. Overlapping volume counts twice in the mass properties.
    pub fn union(mut self, other: Self) -> Self {
        let first = self.mesh.vertices.len() as u32;
        self.mesh.vertices.extend(other.mesh.vertices);
        self.mesh.triangles.extend(other.mesh.triangles.iter().map(|t| t.map(|i| i + first)));
        self.parts.extend(other.parts);
        self
    }
}

/// Triangles of a band between two rings of `count` vertices that start at `from` and `to`; counter-clockwise
/// seen from outside if the rings are counter-clockwise and `to` is above `from`.
fn band(from: u32, to: u32, count: u32) -> impl Iterator<Item = [u32; 3]> {
    (0..count).flat_map(move |i| {
        let j = (i + 1) % count;
        [[from + i, from + j, to + j], [from + i, to + j, to + i]]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Whether each edge joins two triangles in opposite directions.
    pub(super) fn is_closed(mesh: &Mesh) -> bool {
        let mut edges = BTreeMap::new();
        for t in &mesh.triangles {
            for k in 0..3 {
                *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        edges.iter().all(|(&(a, b), &count)| count == 1 && edges.contains_key(&(b, a)))
    }

    /// Volume (m³) enclosed by a mesh.
    pub(super) fn mesh_volume(mesh: &Mesh) -> f64 {
        mesh::mass_properties(mesh, true).unwrap().volume
    }

    /// Sum of the volumes (m³) of the convex parts.
    pub(super) fn parts_volume(parts: &[Vec<Vec3>]) -> f64 {
        parts.iter().map(|part| mesh_volume(&mesh::convex_hull(part, 256).unwrap())).sum()
    }

    #[test]
    fn union_keeps_the_volume_of_both() {
        let loft = Loft {
            sections: serde_json::from_str("[[0, 0.02, 0.03, 6], [0.1, 0.02, 0.03, 6]]").unwrap(),
        };
        let one = Solid::from(&loft);
        let volume = mesh_volume(&one.mesh);
        let both = one.clone().union(one.moved(Vec3::new(0.1, 0.0, 0.0)));
        assert!(is_closed(&both.mesh) && both.parts.len() == 2);
        assert!((mesh_volume(&both.mesh) - 2.0 * volume).abs() < 1e-3 * volume);
        assert!((both.mesh.extent().x - 0.14).abs() < 1e-4);
    }
}
