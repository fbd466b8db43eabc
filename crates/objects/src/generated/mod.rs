//! Generated objects: any number of shapes of each family, by number.
//!
//! In: a name, `FAMILY-NUMBER`. Out: an [`Object`] with real proportions, hollowness, stance and mass. The
//! object depends on its name only.
//!
//! A family is a function that draws a solid (`families`). The object rests on the side it was drawn on, or
//! on a random stable one.

mod draw;
mod families;
mod reserved;

pub use families::{FAMILIES, Family};

use crate::object::{DEFAULT_FRICTION, Object};
use crate::solid::Solid;
use draw::Draw;
use geometry::Vec3;
use mesh::MassProperties;

/// Solid of a family, before its side on the table is chosen.
struct Draft {
    solid: Solid,
    /// Density (kg/m³) of the volume that the mesh encloses.
    density: f32,
    stance: Stance,
}

/// Side on which a drawn solid rests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stance {
    /// The side on which it was drawn.
    AsDrawn,
    /// Any side that is stable, each with the same probability.
    AnyStable,
}

/// Range of the mass (kg).
const MASS_RANGE: [f32; 2] = [0.015, 1.2];
/// Max number of random sides, the most stable ones.
const MAX_SIDES: usize = 5;
/// Min tip angle (tangent) of a random side.
const MIN_TIP_ANGLE_TAN: f64 = 0.2;
/// Max number of drafts of an object until one has an accepted size.
const MAX_DRAFTS: usize = 200;
/// Accepted heights (m) of an object at rest: above the lowest height at which fingers can pinch, and within
/// the camera's view.
const HEIGHT_RANGE: [f32; 2] = [0.010, 0.28];
/// Max horizontal extent (m).
const MAX_WIDTH: f32 = 0.34;

/// Name of a generated object; numbers start at 0.
pub fn name(family: &str, number: u32) -> String {
    format!("{family}-{number}")
}

/// Family and number of a name; `None` if it is not the name of a generated object.
///
/// ```rust
/// use objects::generated;
/// let (family, number) = generated::parse_name("bowl-7").expect("a generated object");
/// assert_eq!((family.name, number), ("bowl", 7));
/// assert!(generated::parse_name("bleach").is_none());
/// assert!(generated::parse_name("bowl-07").is_none());
/// ```
pub fn parse_name(name: &str) -> Option<(&'static Family, u32)> {
    let (family, number) = name.rsplit_once('-')?;
    let number: u32 = number.parse().ok().filter(|n: &u32| n.to_string() == number)?;
    Some((FAMILIES.iter().find(|entry| entry.name == family)?, number))
}

/// Builds the generated object with a name; `None` for other names.
pub fn generate(name: &str) -> Option<Object> {
    let (family, number) = parse_name(name)?;
    let mut draw = Draw::new(family.name, number);
    (0..MAX_DRAFTS).find_map(|_| {
        let draft = (family.draw)(&mut draw);
        let object = draft.object(name, &mut draw)?;
        is_accepted(object.size()).then_some(object)
    })
}

/// Whether training may contain an object with these extents (m).
fn is_accepted(size: Vec3) -> bool {
    let [low, high] = HEIGHT_RANGE;
    (low..=high).contains(&size.z)
        && size.x.max(size.y) <= MAX_WIDTH
        && !reserved::is_reserved(size)
}

impl Draft {
    /// The object at rest. `None` if the solid has no volume or no accepted side.
    fn object(self, name: &str, draw: &mut Draw) -> Option<Object> {
        let Self { solid, density, stance } = self;
        let properties = mesh::mass_properties(&solid.mesh, true).ok()?;
        let solid = match stance {
            Stance::AsDrawn => solid,
            Stance::AnyStable => {
                let mut sides = mesh::stable_poses(&solid.mesh.vertices, properties.center_of_mass);
                sides.retain(|side| side.tip_angle_tan >= MIN_TIP_ANGLE_TAN);
                sides.truncate(MAX_SIDES);
                let side = sides.get(draw.index(sides.len().max(1)))?;
                solid.map(|point| (side.rotation * point.as_dvec3()).as_vec3())
            }
        };
        let MassProperties { volume, .. } = properties;
        let mass = (density * volume as f32).clamp(MASS_RANGE[0], MASS_RANGE[1]);
        Object::new(name, solid.mesh, true, solid.parts, mass, DEFAULT_FRICTION).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape_class::ShapeClass;
    use std::collections::BTreeSet;

    /// Names of all objects that training and evaluation use.
    fn all_names() -> Vec<String> {
        FAMILIES.iter().flat_map(Family::names).collect()
    }

    #[test]
    fn objects_are_at_rest_closed_and_have_plausible_sizes() {
        let mut hashes = BTreeSet::new();
        for name in all_names() {
            let object = generate(&name).unwrap_or_else(|| panic!("{name} is not generated"));
            let properties = mesh::mass_properties(&object.mesh, true).unwrap();
            assert!(properties.volume > 1e-6, "{name}: {} m³", properties.volume);
            assert!(object.bounds[0].z.abs() < 1e-5, "{name} is not on the table");
            assert!((MASS_RANGE[0]..=MASS_RANGE[1]).contains(&object.mass), "{name}");
            assert!(object.parts.len() <= 64, "{name}: {} parts", object.parts.len());
            assert!(hashes.insert(object.hash()), "{name} equals another object");
            let points: Vec<Vec3> = object.parts.concat();
            let [low, high] =
                points.iter().fold([points[0]; 2], |[low, high], p| [low.min(*p), high.max(*p)]);
            let error = ((high - low) - object.size()).abs().max_element();
            assert!(error < 0.003, "{name}: the parts' bounds are off by {error} m");
        }
    }

    #[test]
    fn names_give_the_same_object_again() {
        for name in ["bottle-3", "bowl-0", "clamp-5"] {
            assert_eq!(generate(name).unwrap().hash(), generate(name).unwrap().hash());
        }
        assert!(generate("bottle").is_none() && generate("teapot-1").is_none());
    }

    #[test]
    fn sets_have_the_documented_composition() {
        let objects = |is_held_out: bool| -> Vec<Object> {
            let families = FAMILIES.iter().filter(|family| family.is_held_out == is_held_out);
            families.flat_map(Family::names).map(|name| generate(&name).unwrap()).collect()
        };
        let training = objects(false);
        assert!(training.len() >= 400, "{} training objects", training.len());
        let held_out = objects(true);
        let share = |has: &dyn Fn(&Object) -> bool| {
            held_out.iter().filter(|object| has(object)).count() as f64 / held_out.len() as f64
        };
        for (class, wanted) in
            [(ShapeClass::Low, 0.3), (ShapeClass::LongOrWide, 0.2), (ShapeClass::Hollow, 0.2)]
        {
            let share = share(&|object| class.contains(object));
            println!("{}: {share:.2} of {}", class.name(), held_out.len());
            assert!(share >= wanted, "{}: {share} of the held-out objects", class.name());
        }
    }
}
