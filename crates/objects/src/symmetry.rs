//! Rotational symmetry of an object about the vertical axis through its centre.

use crate::object::Object;

/// Order of a round object: invariant under rotation by 1/24 turn.
pub const MAX_ORDER: usize = 24;

/// Number of directions in which the radius is measured: a multiple of each order.
const NUM_DIRECTIONS: usize = 72;
/// Number of heights at which the radii are measured.
const NUM_SLICES: usize = 12;
/// Max difference (m) of two radii that count as equal.
const RADIUS_TOLERANCE: f32 = 0.004;
/// Max fraction of unequal radii.
const MAX_OUTLIER_FRACTION: f32 = 0.02;

/// Symmetry order: 24 if round, 4 if square, 2 if invariant under half a turn, else 1.
pub fn symmetry_order(object: &Object) -> usize {
    let profiles = radial_profiles(object);
    let is_invariant = |order: &usize| {
        let shift = NUM_DIRECTIONS / order;
        let differences = profiles.iter().flat_map(|radii| {
            (0..NUM_DIRECTIONS).map(move |i| radii[i] - radii[(i + shift) % NUM_DIRECTIONS])
        });
        let num_unequal =
            differences.filter(|difference| difference.abs() > RADIUS_TOLERANCE).count();
        num_unequal as f32 <= MAX_OUTLIER_FRACTION * (NUM_SLICES * NUM_DIRECTIONS) as f32
    };
    [MAX_ORDER, 4, 2].into_iter().find(is_invariant).unwrap_or(1)
}

/// For each height and direction, the max distance (m) of the surface from the vertical axis.
fn radial_profiles(object: &Object) -> Vec<[f32; NUM_DIRECTIONS]> {
    let [min, max] = object.bounds;
    let height = |k: usize| min.z + (max.z - min.z) * (k as f32 + 0.5) / NUM_SLICES as f32;
    (0..NUM_SLICES).map(|k| radial_profile(object, height(k))).collect()
}

fn radial_profile(object: &Object, height: f32) -> [f32; NUM_DIRECTIONS] {
    let mut radii = [0.0f32; NUM_DIRECTIONS];
    for triangle in &object.mesh.triangles {
        let corners = triangle.map(|i| object.mesh.vertices[i as usize]);
        let mut crossings = [(0, 1), (1, 2), (2, 0)].into_iter().filter_map(|(a, b)| {
            let (a, b) = (corners[a], corners[b]);
            let is_crossed = (a.z > height) != (b.z > height);
            is_crossed.then(|| a.lerp(b, (height - a.z) / (b.z - a.z)).truncate())
        });
        let (Some(from), Some(to)) = (crossings.next(), crossings.next()) else { continue };
        for (i, radius) in radii.iter_mut().enumerate() {
            let (sin, cos) =
                libm::sincosf(std::f32::consts::TAU * i as f32 / NUM_DIRECTIONS as f32);
            // Coordinates normal to the ray and along it.
            let across = |p: glamx::Vec2| cos * p.y - sin * p.x;
            let along = |p: glamx::Vec2| cos * p.x + sin * p.y;
            let (a, b) = (across(from), across(to));
            if (a > 0.0) != (b > 0.0) {
                *radius = radius.max(along(from.lerp(to, a / (a - b))));
            }
        }
    }
    radii
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symmetry_order_matches_known_objects() {
        for (name, wanted) in [
            ("soup_can", MAX_ORDER),
            ("wine_bottle", MAX_ORDER),
            ("baseball", MAX_ORDER),
            ("rice_bowl", MAX_ORDER),
            ("milk_carton", 4),
            ("sugar_box", 2),
            ("tea_box", 2),
            ("coffee_mug", 1),
            ("camping_mug", 1),
            ("hammer", 1),
        ] {
            let found = symmetry_order(&Object::from_catalog(name).unwrap());
            assert_eq!(found, wanted, "{name}");
        }
    }
}
