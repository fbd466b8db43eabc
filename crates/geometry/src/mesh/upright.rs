//! Which way is up in a file that does not say.

use super::Mesh;

/// The foot is so near to the plane at most, as a share of the height.
const FOOT: f32 = 0.01;
/// The middle is so near to the origin at most, as a share of the width.
const MIDDLE: f32 = 0.05;

/// Whether a mesh looks drawn with y up, as films and games have it: its foot on the plane y = 0, its middle over the
/// origin in z.
pub(super) fn is_drawn_y_up(mesh: &Mesh) -> bool {
    let ([low, high], size) = (mesh.bounds(), mesh.extent());
    let stands_on_y = low.y.abs() <= FOOT * size.y;
    stands_on_y && (low.z + high.z).abs() <= 2.0 * MIDDLE * size.z
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::mesh::samples::cube;

    #[test]
    fn what_stands_on_y_and_has_its_middle_over_the_origin_is_drawn_y_up() {
        let at = |x, y, z| is_drawn_y_up(&cube().translated(Vec3::new(x, y, z)));
        assert!(at(-0.5, 0.0, -0.5) && at(3.0, 0.005, -0.52));
        // On the plane z = 0, in the middle of everything, above the plane.
        assert!(!at(-0.5, -0.5, 0.0) && !at(-0.5, -0.5, -0.5) && !at(-0.5, 0.1, -0.5));
        // In a corner nothing says which way is up.
        assert!(!at(0.0, 0.0, 0.0));
    }
}
