//! Sweeps: an ellipse that moves along a path, such as a handle or a banana.

use super::{Solid, band};
use geometry::Vec3;
use mesh::Mesh;

/// Ellipse swept along a path.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Points of the path, at least 2; at least 3 if it is closed.
    pub path: Vec<SweepPoint>,
    /// Whether the path ends where it starts.
    pub is_closed: bool,
    /// Direction that the path never takes. The first radius is across it, the second along it.
    pub up: Vec3,
}

/// Point of a path.
#[derive(Clone, Copy, Debug)]
pub struct SweepPoint {
    /// Centre of the ellipse (m).
    pub center: Vec3,
    /// Radii (m): across and along [`Sweep::up`].
    pub radii: [f32; 2],
}

/// Points around each ring.
const RING_POINTS: usize = 16;

impl Sweep {
    /// Closed mesh, and one convex part between every two points of the path.
    pub fn solid(&self) -> Solid {
        let rings: Vec<Vec<Vec3>> = (0..self.path.len()).map(|index| self.ring(index)).collect();
        let n = RING_POINTS as u32;
        let start = |ring: usize| n * (ring % rings.len()) as u32;
        let mut vertices = rings.concat();
        let mut triangles = Vec::new();
        let mut parts = Vec::new();
        let num_pieces = if self.is_closed { rings.len() } else { rings.len() - 1 };
        for piece in 0..num_pieces {
            triangles.extend(band(start(piece), start(piece + 1), n));
            parts.push([rings[piece].as_slice(), &rings[(piece + 1) % rings.len()]].concat());
        }
        if !self.is_closed {
            let last = rings.len() - 1;
            let centers = vertices.len() as u32;
            vertices.extend([0, last].map(|end| self.path[end].center));
            for i in 0..n {
                let j = (i + 1) % n;
                triangles.push([centers, j, i]);
                triangles.push([centers + 1, start(last) + i, start(last) + j]);
            }
        }
        Solid { mesh: Mesh { vertices, triangles }, parts }
    }

    /// Points of the ellipse at a point of the path, counter-clockwise seen against the direction of the path.
    fn ring(&self, index: usize) -> Vec<Vec3> {
        let count = self.path.len();
        let at = |index: usize| self.path[index % count].center;
        let (before, after) = match self.is_closed {
            true => (at(index + count - 1), at(index + 1)),
            false => (at(index.saturating_sub(1)), at((index + 1).min(count - 1))),
        };
        let along = (after - before).normalize();
        let side = self.up.cross(along).normalize();
        let normal = along.cross(side);
        let SweepPoint { center, radii: [across, up] } = self.path[index];
        (0..RING_POINTS)
            .map(|i| {
                let angle = i as f32 * (std::f32::consts::TAU / RING_POINTS as f32);
                let (sin, cos) = libm::sincosf(angle);
                center + side * (across * cos) + normal * (up * sin)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::tests::{is_closed, mesh_volume, parts_volume};

    fn circle(points: usize) -> Vec<SweepPoint> {
        let point = |i: usize| {
            let (sin, cos) = libm::sincosf(i as f32 * std::f32::consts::TAU / points as f32);
            SweepPoint { center: Vec3::new(0.05 * cos, 0.05 * sin, 0.0), radii: [0.01, 0.008] }
        };
        (0..points).map(point).collect()
    }

    #[test]
    fn torus_has_the_volume_of_pappus() {
        let torus = Sweep { path: circle(32), is_closed: true, up: Vec3::Z };
        let solid = torus.solid();
        let pi = std::f64::consts::PI;
        let wanted = pi * 0.01 * 0.008 * 2.0 * pi * 0.05;
        assert!(is_closed(&solid.mesh));
        for volume in [mesh_volume(&solid.mesh), parts_volume(&solid.parts)] {
            assert!((volume / wanted - 1.0).abs() < 0.04, "{volume} of {wanted}");
        }
    }

    #[test]
    fn open_sweep_is_capped() {
        let path = [0.0, 0.1].map(|x| SweepPoint { center: Vec3::X * x, radii: [0.01, 0.02] });
        let solid = Sweep { path: path.to_vec(), is_closed: false, up: Vec3::Z }.solid();
        assert!(is_closed(&solid.mesh));
        let size = solid.mesh.extent();
        assert!((size - Vec3::new(0.1, 0.02, 0.04)).abs().max_element() < 1e-6, "{size}");
        let wanted = std::f64::consts::PI * 0.01 * 0.02 * 0.1;
        assert!((mesh_volume(&solid.mesh) / wanted - 1.0).abs() < 0.03);
    }
}
