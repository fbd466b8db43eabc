//! Classes of shapes that are hard to grasp. Success is reported for each of them.

use crate::object::Object;
use mesh::Mesh;

/// A class of shapes. An object may be in several of them, or in none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShapeClass {
    /// Lower than 5 cm: the fingers close next to the table.
    Low,
    /// Longer than 16 cm, or wider than 12 cm, which is more than the hand spans.
    LongOrWide,
    /// Fills less than half of its convex hull: open vessels, rings.
    Hollow,
}

/// Max. height (m) of a low object.
const LOW_HEIGHT: f32 = 0.05;
/// Length and width (m) that a long or wide object exceeds.
const LONG: f32 = 0.16;
const WIDE: f32 = 0.12;
/// Fraction of its convex hull that a hollow object stays below.
const HOLLOW_FILL: f64 = 0.5;
/// Max. number of vertices of the hull.
const HULL_VERTICES: usize = 256;

impl ShapeClass {
    /// All classes.
    pub const ALL: [Self; 3] = [Self::Low, Self::LongOrWide, Self::Hollow];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Low => "low",
            Self::LongOrWide => "long or wide",
            Self::Hollow => "hollow",
        }
    }

    /// Whether an object at rest is in the class.
    ///
    /// ```rust
    /// use objects::Object;
    /// use objects::shape_class::ShapeClass;
    /// let object = |name| Object::from_catalog(name).expect("a generated object");
    /// assert!(ShapeClass::Hollow.contains(&object("bowl-7")));
    /// assert!(ShapeClass::Low.contains(&object("rod-3"))); // 84 x 13 x 13 mm
    /// assert!(ShapeClass::LongOrWide.contains(&object("rod-1"))); // 260 x 31 x 31 mm
    /// ```
    pub fn contains(self, object: &Object) -> bool {
        let size = object.size();
        match self {
            Self::Low => size.z < LOW_HEIGHT,
            Self::LongOrWide => size.x.max(size.y) > LONG || size.x.min(size.y) > WIDE,
            Self::Hollow => hull_fill(object).is_some_and(|fill| fill < HOLLOW_FILL),
        }
    }
}

/// Volume of an object as a fraction of that of its convex hull.
fn hull_fill(object: &Object) -> Option<f64> {
    let hull = mesh::convex_hull(&object.mesh.vertices, HULL_VERTICES)?;
    let volume = |mesh: &Mesh| Some(mesh::mass_properties(mesh, true).ok()?.volume);
    Some(volume(&object.mesh)? / volume(&hull)?)
}
