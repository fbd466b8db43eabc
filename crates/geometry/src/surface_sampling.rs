//! Uniform sampling of points on a surface.

use crate::Vec3;
use mesh::Mesh;

/// `count` points on a mesh, uniform by area; deterministic, empty for a mesh without area.
pub fn sample_surface(mesh: &Mesh, count: usize) -> Vec<Vec3> {
    let corners = |t: &[u32; 3]| t.map(|i| mesh.vertices[i as usize]);
    let mut total = 0.0f64;
    let sums: Vec<f64> = mesh
        .triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = corners(triangle);
            total += f64::from((b - a).cross(c - a).length());
            total
        })
        .collect();
    if total <= 0.0 {
        return Vec::new();
    }
    (0..count)
        .map(|i| {
            let area = total * (i as f64 + 0.5) / count as f64;
            let triangle = sums.partition_point(|sum| *sum < area).min(sums.len() - 1);
            let [a, b, c] = corners(&mesh.triangles[triangle]);
            // Kronecker sequence in the unit square (from the root of x³ = x + 1), folded into the triangle.
            let fraction = |step: f64| {
                let value = 0.5 + step * (i + 1) as f64;
                (value - libm::floor(value)) as f32
            };
            let (u, v) = (fraction(0.754_877_666_246_692_8), fraction(0.569_840_290_998_053_2));
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            a + (b - a) * u + (c - a) * v
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_have_the_moments_of_the_surface() {
        // A box of 49 x 94 x 176 mm.
        let half = Vec3::new(0.0245, 0.047, 0.088);
        let sign = |i: u32, bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        let vertices = (0..8).map(|i| half * Vec3::new(sign(i, 0), sign(i, 1), sign(i, 2)));
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let mesh = Mesh { vertices: vertices.collect(), triangles: triangles.collect() };
        let found = sample_surface(&mesh, 2000);
        let mean = found.iter().sum::<Vec3>() / 2000.0;
        assert!(mean.abs().max_element() < 0.001, "{mean}");
        let areas = Vec3::new(half.y * half.z, half.x * half.z, half.x * half.y);
        let total = areas.element_sum();
        // x² is half.x² on the two faces normal to x, and averages a third of that on the other faces.
        let wanted = (areas.x + (areas.y + areas.z) / 3.0) / total * half.x * half.x;
        let got = found.iter().map(|p| p.x * p.x).sum::<f32>() / 2000.0;
        assert!((got - wanted).abs() < 0.03 * wanted, "{got}, wanted {wanted}");
        assert!(sample_surface(&Mesh { vertices: vec![], triangles: vec![] }, 5).is_empty());
    }
}
