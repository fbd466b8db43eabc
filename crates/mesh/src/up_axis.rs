//! Guess of the up axis, for formats that do not define it.

use crate::Mesh;

/// Max distance of the base from the plane y = 0 (fraction of the height).
const BASE_TOLERANCE: f32 = 0.01;
/// Max distance of the centre from z = 0 (fraction of the depth).
const CENTER_TOLERANCE: f32 = 0.05;

/// Whether a mesh appears to be y-up, as in film and games: base on the plane y = 0, centred at z = 0.
pub(super) fn is_y_up(mesh: &Mesh) -> bool {
    let ([low, high], size) = (mesh.bounds(), mesh.extent());
    let is_base_on_plane = low.y.abs() <= BASE_TOLERANCE * size.y;
    is_base_on_plane && (low.z + high.z).abs() <= 2.0 * CENTER_TOLERANCE * size.z
}

/// Longest side (units of the file) of meshes that were scaled to a unit cube, sphere or diagonal.
const NORMALIZED_RANGE: std::ops::RangeInclusive<f32> = 0.5..=2.01;

/// Whether a mesh (units of the file) appears to be normalised: centred at the origin, 0.5 to 2 units long.
///
/// Public data sets of such meshes and programs that generate them use y up.
pub(super) fn is_normalized(mesh: &Mesh) -> bool {
    let ([low, high], size) = (mesh.bounds(), mesh.extent());
    let is_centred = (low + high).abs().cmple(2.0 * CENTER_TOLERANCE * size).all();
    is_centred && NORMALIZED_RANGE.contains(&size.max_element())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_meshes::cube;
    use glamx::Vec3;

    #[test]
    fn mesh_of_unit_size_about_the_origin_is_normalized() {
        let about_origin = cube().translated(Vec3::splat(-0.5));
        for (scale, expected) in
            [(1.0, true), (0.7, true), (2.0, true), (0.1, false), (60.0, false)]
        {
            assert_eq!(is_normalized(&about_origin.clone().scaled(scale)), expected, "{scale}");
        }
        assert!(!is_normalized(&cube()));
    }

    #[test]
    fn mesh_based_on_y_plane_and_centred_in_z_is_y_up() {
        let at = |x, y, z| is_y_up(&cube().translated(Vec3::new(x, y, z)));
        assert!(at(-0.5, 0.0, -0.5) && at(3.0, 0.005, -0.52));
        // Based on z = 0; centred at the origin; above the plane y = 0.
        assert!(!at(-0.5, -0.5, 0.0) && !at(-0.5, -0.5, -0.5) && !at(-0.5, 0.1, -0.5));
        // With a corner at the origin, the up axis is ambiguous.
        assert!(!at(0.0, 0.0, 0.0));
    }
}
