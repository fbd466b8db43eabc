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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_meshes::cube;
    use glamx::Vec3;

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
