//! Solids as one sees them from a side: triangles that face the eye, the farthest first.

use crate::report::canvas::Canvas;
use geometry::Vec3;
use geometry::mesh::Mesh;

/// A parallel view from a direction.
pub(crate) struct View {
    right: Vec3,
    up: Vec3,
    /// Towards the eye.
    towards: Vec3,
}

/// A triangle with a colour: red, green, blue (0 to 1).
pub(crate) struct Facet {
    pub(crate) corners: [Vec3; 3],
    pub(crate) color: [f32; 3],
}

impl View {
    /// From an azimuth about the vertical and an elevation over the horizontal (degrees).
    pub(crate) fn new(azimuth_deg: f32, elevation_deg: f32) -> Self {
        let (sin_a, cos_a) = libm::sincosf(azimuth_deg.to_radians());
        let (sin_e, cos_e) = libm::sincosf(elevation_deg.to_radians());
        let towards = Vec3::new(cos_e * cos_a, cos_e * sin_a, sin_e);
        let right = Vec3::new(-sin_a, cos_a, 0.0);
        Self { right, up: towards.cross(right), towards }
    }

    /// A point in the picture's plane (m): to the right, down.
    pub(crate) fn flat(&self, point: Vec3) -> [f32; 2] {
        [point.dot(self.right), -point.dot(self.up)]
    }

    /// Draws facets, `scale` pixels a metre, the origin at `center`.
    pub(crate) fn draw(&self, canvas: &mut Canvas, facets: &[Facet], scale: f32, center: [f32; 2]) {
        let normal = |facet: &Facet| {
            let [a, b, c] = facet.corners;
            (b - a).cross(c - a).normalize_or_zero()
        };
        let depth = |facet: &Facet| facet.corners.iter().map(|p| p.dot(self.towards)).sum::<f32>();
        let mut seen: Vec<&Facet> =
            facets.iter().filter(|facet| normal(facet).dot(self.towards) > 0.0).collect();
        seen.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
        let light = (self.towards + 0.6 * self.up - 0.5 * self.right).normalize();
        for facet in seen {
            let shade = 0.45 + 0.55 * normal(facet).dot(light).max(0.0);
            let [r, g, b] = facet.color.map(|x| (255.0 * x * shade) as u8);
            let points = facet.corners.map(|corner| {
                let [x, y] = self.flat(corner);
                [center[0] + scale * x, center[1] + scale * y]
            });
            canvas.polygon(&points, &format!("#{r:02x}{g:02x}{b:02x}"));
        }
    }
}

/// The facets of a mesh in a colour.
pub(crate) fn facets(mesh: &Mesh, color: [f32; 3]) -> impl Iterator<Item = Facet> + '_ {
    let corner = |i: u32| mesh.vertices[i as usize];
    mesh.triangles.iter().map(move |triangle| Facet { corners: triangle.map(corner), color })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_near_side_of_a_box_is_drawn_last_and_the_far_side_not_at_all() {
        let view = View::new(0.0, 0.0);
        assert!((view.towards - Vec3::X).length() < 1e-6 && (view.up - Vec3::Z).length() < 1e-6);
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
        assert!(shade(1) < shade(2), "the brighter one is nearer");
    }
}
