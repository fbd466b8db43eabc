//! Principal axes of weighted points, by Jacobi rotations: only + - * / and square roots, the same bits everywhere.

use glamx::{DMat3, DVec3};

/// Number of sweeps; three suffice for a 3 x 3 matrix in double precision.
const SWEEPS: usize = 8;

/// Orthonormal principal axes of points with weights, as rows of a matrix. Unsorted.
pub(super) fn principal_axes(points: impl Iterator<Item = (DVec3, f64)> + Clone) -> DMat3 {
    let total: f64 = points.clone().map(|(_, weight)| weight).sum();
    if !(total > 0.0 && total.is_finite()) {
        return DMat3::IDENTITY;
    }
    let mean = points.clone().map(|(p, weight)| p * weight).sum::<DVec3>() / total;
    let mut covariance = [[0.0; 3]; 3];
    for (p, weight) in points {
        let d = (p - mean).to_array();
        for (i, row) in covariance.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry += weight * d[i] * d[j];
            }
        }
    }
    jacobi_eigenvectors(covariance)
}

/// Eigenvectors of a symmetric matrix as rows.
fn jacobi_eigenvectors(mut a: [[f64; 3]; 3]) -> DMat3 {
    let mut axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let scale = a.iter().flatten().fold(0.0, |max: f64, x| max.max(x.abs()));
    for (p, q) in [(0, 1), (0, 2), (1, 2)].into_iter().cycle().take(3 * SWEEPS) {
        if a[p][q].abs() <= 1e-15 * scale {
            continue;
        }
        let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
        let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
        let c = 1.0 / (t * t + 1.0).sqrt();
        let s = t * c;
        for row in &mut a {
            (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
        }
        let (row_p, row_q) = (a[p], a[q]);
        a[p] = [0, 1, 2].map(|i| c * row_p[i] - s * row_q[i]);
        a[q] = [0, 1, 2].map(|i| s * row_p[i] + c * row_q[i]);
        (axes[p], axes[q]) = (axes[p] * c - axes[q] * s, axes[p] * s + axes[q] * c);
    }
    DMat3::from_cols(axes[0], axes[1], axes[2]).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_of_a_rotated_box_are_its_edges() {
        let rotation = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
        let half = DVec3::new(3.0, 2.0, 1.0);
        let corners = (0..8).map(|i| {
            let sign = |bit: i32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            (rotation * (half * DVec3::new(sign(0), sign(1), sign(2))) + DVec3::ONE, 0.5)
        });
        let axes = principal_axes(corners);
        let product = axes * rotation;
        for (row, i) in [product.row(0), product.row(1), product.row(2)].into_iter().zip(0..) {
            assert!((row[i].abs() - 1.0).abs() < 1e-9, "{product}");
        }
        assert!(
            (axes * axes.transpose() - DMat3::IDENTITY)
                .to_cols_array()
                .iter()
                .all(|x| x.abs() < 1e-12)
        );
    }
}
