//! Sizes that are reserved for measurement: no generated object may have them.

use geometry::Vec3;

/// Sorted extents (m) of ten scans of the YCB set on which policies are measured but never trained: tuna can,
/// pudding box, banana, pitcher, bowl, mug, drill, hammer, clamp, tennis ball.
const RESERVED_SIZES: [[f32; 3]; 10] = [
    [0.0335, 0.0855, 0.0856],
    [0.0389, 0.1288, 0.1379],
    [0.0367, 0.1089, 0.1784],
    [0.1448, 0.1491, 0.2424],
    [0.0550, 0.1611, 0.1614],
    [0.0814, 0.0931, 0.1170],
    [0.1232, 0.1630, 0.1874],
    [0.0342, 0.1286, 0.3337],
    [0.0391, 0.1200, 0.1713],
    [0.0629, 0.0631, 0.0639],
];

/// Relative tolerance of each extent.
const TOLERANCE: f32 = 0.1;

/// Whether all three sorted extents (m) are within [`TOLERANCE`] of those of a reserved size.
pub(super) fn is_reserved(size: Vec3) -> bool {
    let mut extents = size.to_array();
    extents.sort_by(f32::total_cmp);
    RESERVED_SIZES.iter().any(|reserved| {
        extents.iter().zip(reserved).all(|(x, wanted)| (x / wanted - 1.0).abs() <= TOLERANCE)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn size_is_reserved_in_any_orientation_within_a_tenth() {
        assert!(is_reserved(Vec3::new(0.0856, 0.0335, 0.0855)));
        assert!(is_reserved(Vec3::new(0.0364, 0.0800, 0.0930)));
        // One extent is 12 % larger.
        assert!(!is_reserved(Vec3::new(0.0959, 0.0335, 0.0855)));
        assert!(!is_reserved(Vec3::splat(0.05)));
    }
}
