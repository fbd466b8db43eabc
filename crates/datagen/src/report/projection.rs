//! Orthographic projection of meshes: back-face culling, then drawing from far to near.

use files::svg::Canvas;
use geometry::Vec3;
use mesh::Mesh;

/// Orthographic projection along a view direction.
pub(crate) struct Projection {
    right: Vec3,
    up: Vec3,
    /// Unit vector towards the viewer.
    toward_viewer: Vec3,
}

/// A triangle with an RGB color (0 to 1).
pub(crate) struct Facet {
    pub(crate) corners: [Vec3; 3],
    pub(crate) color: [f32; 3],
}

impl Projection {
    /// Projection for an azimuth about the vertical axis and an elevation above the horizontal plane
    /// (degrees).
    pub(crate) fn new(azimuth_deg: f32, elevation_deg: f32) -> Self {
        let (sin_a, cos_a) = libm::sincosf(azimuth_deg.to_radians());
        let (sin_e, cos_e) = libm::sincosf(elevation_deg.to_radians());
        let towards = Vec3::new(cos_e * cos_a, cos_e * sin_a, sin_e);
        let right = Vec3::new(-sin_a, cos_a, 0.0);
        Self { right, up: towards.cross(right), toward_viewer: towards }
    }

    /// Projects a point to image coordinates (m): right, down.
    pub(crate) fn project(&self, point: Vec3) -> [f32; 2] {
        [point.dot(self.right), -point.dot(self.up)]
    }

    /// Draws facets with `scale` in pixels per metre and the origin at `center` (pixels).
    pub(crate) fn draw(&self, canvas: &mut Canvas, facets: &[Facet], scale: f32, center: [f32; 2]) {
        let normal = |facet: &Facet| {
            let [a, b, c] = facet.corners;
            (b - a).cross(c - a).normalize_or_zero()
        };
        let depth =
            |facet: &Facet| facet.corners.iter().map(|p| p.dot(self.toward_viewer)).sum::<f32>();
        let mut visible: Vec<&Facet> =
            facets.iter().filter(|facet| normal(facet).dot(self.toward_viewer) > 0.0).collect();
        visible.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
        let light = (self.toward_viewer + 0.6 * self.up - 0.5 * self.right).normalize();
        for facet in visible {
            let shade = 0.45 + 0.55 * normal(facet).dot(light).max(0.0);
            let [r, g, b] = facet.color.map(|x| (255.0 * x * shade) as u8);
            let points = facet.corners.map(|corner| {
                let [x, y] = self.project(corner);
                [center[0] + scale * x, center[1] + scale * y]
            });
            canvas.polygon(&points, &format!("#{r:02x}{g:02x}{b:02x}"));
        }
    }
}

/// Facets of a mesh in one color.
pub(crate) fn facets(mesh: &Mesh, color: [f32; 3]) -> impl Iterator<Item = Facet> + '_ {
    let corner = |i: u32| mesh.vertices[i as usize];
    mesh.triangles.iter().map(move |triangle| Facet { corners: triangle.map(corner), color })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_facets_are_drawn_last_and_back_faces_are_culled() {
        let view = Projection::new(0.0, 0.0);
        assert!(
            (view.toward_viewer - Vec3::X).length() < 1e-6 && (view.up - Vec3::Z).length() < 1e-6
        );
        let wall = |x: f32, towards: f32| {
            let [a, b, c] = [Vec3::ZERO, Vec3::Y, Vec3::Z].map(|p| p + Vec3::X * x);
            let corners = if towards > 0.0 { [a, b, c] } else { [a, c, b] };
            Facet { corners, color: [x, x, x] }
        };
        let mut canvas = Canvas::new(1.0, 1.0);
        let facets = [wall(0.9, 1.0), wall(0.5, 1.0), wall(0.1, -1.0)];
        view.draw(&mut canvas, &facets, 1.0, [0.0, 0.0]);
        let svg = canvas.svg("");
        assert_eq!(svg.matches("<polygon").count(), 2);
        let shade = |k: usize| svg.split("fill=\"#").nth(k).unwrap()[..2].to_owned();
        assert!(shade(1) < shade(2), "the brighter facet is nearer");
    }
}
