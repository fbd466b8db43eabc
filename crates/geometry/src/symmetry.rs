//! How often an object looks the same in a turn about the vertical through its middle.

use crate::object::Object;

/// The order of what is round: turned by a 24th, it looks the same.
pub const ROUND: usize = 24;

/// Directions in which the outline is measured: as many as every order divides.
const DIRECTIONS: usize = 72;
/// Heights at which it is.
const LEVELS: usize = 12;
/// Greatest difference (m) of two radii that look the same.
const SAME: f32 = 0.004;
/// Share of the radii that may differ.
const OUTLIERS: f32 = 0.02;

/// 24 for what is round, 4 for what is square, 2 for what looks the same after half a turn, 1 for anything else.
pub fn order(object: &Object) -> usize {
    let outlines = outlines(object);
    let looks_the_same = |order: &usize| {
        let shift = DIRECTIONS / order;
        let pairs = outlines.iter().flat_map(|outline| {
            (0..DIRECTIONS).map(move |i| outline[i] - outline[(i + shift) % DIRECTIONS])
        });
        let different = pairs.filter(|difference| difference.abs() > SAME).count();
        different as f32 <= OUTLIERS * (LEVELS * DIRECTIONS) as f32
    };
    [ROUND, 4, 2].into_iter().find(looks_the_same).unwrap_or(1)
}

/// At each level the distance (m) of the surface from the middle in each direction; the farthest one counts.
fn outlines(object: &Object) -> Vec<[f32; DIRECTIONS]> {
    let [min, max] = object.bounds;
    let level = |k: usize| min.z + (max.z - min.z) * (k as f32 + 0.5) / LEVELS as f32;
    (0..LEVELS).map(|k| outline(object, level(k))).collect()
}

fn outline(object: &Object, height: f32) -> [f32; DIRECTIONS] {
    let mut radii = [0.0f32; DIRECTIONS];
    for triangle in &object.mesh.triangles {
        let corners = triangle.map(|i| object.mesh.vertices[i as usize]);
        let mut crossings = [(0, 1), (1, 2), (2, 0)].into_iter().filter_map(|(a, b)| {
            let (a, b) = (corners[a], corners[b]);
            let is_crossed = (a.z > height) != (b.z > height);
            is_crossed.then(|| a.lerp(b, (height - a.z) / (b.z - a.z)).truncate())
        });
        let (Some(from), Some(to)) = (crossings.next(), crossings.next()) else { continue };
        for (i, radius) in radii.iter_mut().enumerate() {
            let (sin, cos) = libm::sincosf(std::f32::consts::TAU * i as f32 / DIRECTIONS as f32);
            // Across and along the ray.
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
    fn cans_are_round_cartons_square_and_mugs_neither() {
        for (name, wanted) in [
            ("soup_can", ROUND),
            ("wine_bottle", ROUND),
            ("baseball", ROUND),
            ("rice_bowl", ROUND),
            ("milk_carton", 4),
            ("sugar_box", 2),
            ("tea_box", 2),
            ("coffee_mug", 1),
            ("camping_mug", 1),
            ("hammer", 1),
        ] {
            let found = order(&Object::built_in(name).unwrap());
            assert_eq!(found, wanted, "{name}");
        }
    }
}
