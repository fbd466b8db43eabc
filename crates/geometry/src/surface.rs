//! Points that are spread evenly over a surface.

use crate::Vec3;
use crate::mesh::Mesh;

/// `count` points on a mesh, about as many on equal areas; always the same ones.
pub fn points(mesh: &Mesh, count: usize) -> Vec<Vec3> {
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
            let at = total * (i as f64 + 0.5) / count as f64;
            let triangle = sums.partition_point(|sum| *sum < at).min(sums.len() - 1);
            let [a, b, c] = corners(&mesh.triangles[triangle]);
            // A sequence that fills the unit square evenly (Kronecker, with the root of x³ = x + 1), folded into the
            // triangle.
            let share = |step: f64| {
                let at = 0.5 + step * (i + 1) as f64;
                (at - libm::floor(at)) as f32
            };
            let (u, v) = (share(0.754_877_666_246_692_8), share(0.569_840_290_998_053_2));
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            a + (b - a) * u + (c - a) * v
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_have_the_moments_of_the_surface() {
        // A box of 49 x 94 x 176 mm: its faces by their areas.
        let half = Vec3::new(0.0245, 0.047, 0.088);
        let sign = |i: u32, bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        let vertices = (0..8).map(|i| half * Vec3::new(sign(i, 0), sign(i, 1), sign(i, 2)));
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let mesh = Mesh { vertices: vertices.collect(), triangles: triangles.collect() };
        let found = points(&mesh, 2000);
        let mean = found.iter().sum::<Vec3>() / 2000.0;
        assert!(mean.abs().max_element() < 0.001, "{mean}");
        let areas = Vec3::new(half.y * half.z, half.x * half.z, half.x * half.y);
        let total = areas.element_sum();
        // On the two faces across x the square is half.x², on the others a third of it in the mean.
        let wanted = (areas.x + (areas.y + areas.z) / 3.0) / total * half.x * half.x;
        let got = found.iter().map(|p| p.x * p.x).sum::<f32>() / 2000.0;
        assert!((got - wanted).abs() < 0.03 * wanted, "{got}, wanted {wanted}");
        assert!(points(&Mesh { vertices: vec![], triangles: vec![] }, 5).is_empty());
    }
}
