//! Objects to grasp: mesh, convex parts, mass properties and friction, resting on z = 0.

use crate::loft::Loft;
use crate::shape_variant::ShapeVariant;
use crate::solid::Solid;
use geometry::{Pose, Vec3};
use glamx::Quat;
use mesh::{MassProperties, Mesh, MeshError};

/// Object to grasp. Frame: z up, bottom at z = 0, bounding box centred in x and y.
///
/// ```rust
/// use objects::Object;
/// let bottle = Object::from_catalog("bleach").expect("a built-in object");
/// let [low, high] = bottle.bounds; // m
/// assert!(low.z.abs() < 1e-6 && (low.x + high.x).abs() < 1e-5);
/// assert!(low.z < bottle.center_of_mass.z && bottle.center_of_mass.z < high.z);
/// // Half the mass (kg) gives half the inertia (kg m²).
/// let light = bottle.clone().with_mass(0.5 * bottle.mass);
/// assert_eq!(light.inertia[0][0], 0.5 * bottle.inertia[0][0]);
/// ```
#[derive(Clone, Debug)]
pub struct Object {
    /// Name: catalogue or file name.
    pub name: String,
    /// Surface rendered by the camera and the page.
    pub mesh: Mesh,
    /// Point sets whose convex hulls are the collision shapes (m).
    pub parts: Vec<Vec<Vec3>>,
    /// Mass (kg).
    pub mass: f32,
    /// Coulomb friction coefficient.
    pub friction: f32,
    /// Centre of mass (m).
    pub center_of_mass: Vec3,
    /// Inertia about the centre of mass (kg m²), rows.
    pub inertia: [[f32; 3]; 3],
    /// Min and max corner of the bounding box (m).
    pub bounds: [Vec3; 2],
}

/// Object file: one upright loft or several placed lofts, with mass, friction and source.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectFile {
    /// Display name.
    pub name: String,
    /// Mass (kg).
    pub mass: f32,
    /// Coulomb friction coefficient.
    pub friction: f32,
    /// Source of the dimensions and the mass.
    pub source: String,
    /// Sections from bottom to top: height, half-widths, exponent, and optionally the centre (m).
    pub sections: Option<Loft>,
    /// Lofts that together form the object. Overlapping volume counts twice in the mass properties.
    #[serde(default, rename = "loft")]
    pub lofts: Vec<PlacedLoft>,
}

/// Loft at a pose in the object's frame.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlacedLoft {
    /// Position of the loft's origin (m).
    pub at: [f32; 3],
    /// Rotation (degrees) about the fixed axes x, then y, then z.
    pub turn_deg: [f32; 3],
    /// Sections along the loft's own z axis.
    pub sections: Loft,
}

impl PlacedLoft {
    fn pose(&self) -> Pose {
        let rotation = |axis: Vec3, angle_deg: f32| {
            let (sin, cos) = libm::sincosf(0.5 * angle_deg.to_radians());
            let v = axis * sin;
            Quat::from_xyzw(v.x, v.y, v.z, cos)
        };
        let [x, y, z] = self.turn_deg;
        let object_from_loft = rotation(Vec3::Z, z) * rotation(Vec3::Y, y) * rotation(Vec3::X, x);
        Pose::from_parts(Vec3::from_array(self.at), object_from_loft)
    }
}

impl ObjectFile {
    /// Parses an object file in JSON, as written by `build.rs`; the error message names the invalid value.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut file: Self =
            serde_json::from_slice(text.as_bytes()).map_err(|error| error.to_string())?;
        if file.sections.is_some() != file.lofts.is_empty() {
            return Err("an object needs either sections or lofts, not both".into());
        }
        if let Some(sections) = file.sections.take() {
            file.lofts.push(PlacedLoft { at: [0.0; 3], turn_deg: [0.0; 3], sections });
        }
        file.lofts.iter().try_for_each(|loft| loft.sections.check())?;
        if !(file.mass.is_finite() && file.mass > 0.0 && file.friction >= 0.0) {
            return Err("mass must be positive and friction must not be negative".into());
        }
        Ok(file)
    }

    /// Builds the object.
    pub fn build(&self) -> Result<Object, MeshError> {
        let placed = |loft: &PlacedLoft| Solid::from(&loft.sections).placed(&loft.pose());
        let Solid { mesh, parts } =
            self.lofts.iter().map(placed).reduce(Solid::union).unwrap_or_default();
        Object::new(&self.name, mesh, true, parts, self.mass, self.friction)
    }
}

/// Friction coefficient of imported meshes, equal to that of the catalogue objects.
pub const DEFAULT_FRICTION: f32 = 0.8;

impl Object {
    /// Moves mesh and parts into the object frame; `mass` (kg) is uniform over the mesh's volume.
    pub fn new(
        name: &str,
        mesh: Mesh,
        watertight: bool,
        parts: Vec<Vec<Vec3>>,
        mass: f32,
        friction: f32,
    ) -> Result<Self, MeshError> {
        let offset = mesh.offset_to_ground();
        let mesh = mesh.translated(offset);
        let properties = mesh::mass_properties(&mesh, watertight)?;
        Ok(Self::from_ground(name, mesh, (parts, offset), mass, friction, properties))
    }

    /// Moves mesh and parts into the object frame, with known mass properties for a density of 1 kg/m³.
    pub fn with_properties(
        name: &str,
        mesh: Mesh,
        parts: Vec<Vec<Vec3>>,
        mass: f32,
        friction: f32,
        properties: MassProperties,
    ) -> Self {
        let offset = mesh.offset_to_ground();
        let (mesh, properties) = (mesh.translated(offset), properties.translated(offset));
        Self::from_ground(name, mesh, (parts, offset), mass, friction, properties)
    }

    /// `mesh` and `properties` are in the object frame, `parts` are moved by their offset.
    fn from_ground(
        name: &str,
        mesh: Mesh,
        (parts, offset): (Vec<Vec<Vec3>>, Vec3),
        mass: f32,
        friction: f32,
        properties: MassProperties,
    ) -> Self {
        let parts = parts
            .into_iter()
            .map(|part| part.into_iter().map(|point| point + offset).collect())
            .collect();
        let density = mass / properties.volume as f32;
        Self {
            name: name.to_owned(),
            parts,
            mass,
            friction,
            center_of_mass: properties.center_of_mass,
            inertia: properties.inertia.map(|row| row.map(|x| x * density)),
            bounds: mesh.bounds(),
            mesh,
        }
    }

    /// Extents of the bounding box along x, y and z (m).
    pub fn size(&self) -> Vec3 {
        self.bounds[1] - self.bounds[0]
    }

    /// Shape variant with the same density, but never heavier than the original.
    pub fn scaled_variant(&self, name: &str, variant: &ShapeVariant) -> Result<Self, MeshError> {
        let height = self.bounds[1].z;
        let map = |points: &[Vec3]| points.iter().map(|p| variant.map_point(*p, height)).collect();
        let vertices = map(&self.mesh.vertices);
        let mesh = Mesh { vertices, triangles: self.mesh.triangles.clone() };
        let parts = self.parts.iter().map(|part| map(part)).collect();
        let ratio = mesh::mass_properties(&mesh, true)?.volume
            / mesh::mass_properties(&self.mesh, true)?.volume;
        let mass = self.mass * ratio.min(1.0) as f32;
        Self::new(name, mesh, true, parts, mass, self.friction)
    }

    /// BLAKE3 hash of mesh, parts, mass and friction, in hex.
    pub fn hash(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        let points = self.mesh.vertices.iter().chain(self.parts.iter().flatten());
        for x in points.flat_map(|p| p.to_array()).chain([self.mass, self.friction]) {
            hasher.update(&x.to_bits().to_le_bytes());
        }
        for triangle in &self.mesh.triangles {
            triangle.iter().for_each(|i| {
                hasher.update(&i.to_le_bytes());
            });
        }
        hasher.finalize().to_hex().to_string()
    }

    /// The same object with another friction coefficient.
    pub fn with_friction(self, friction: f32) -> Self {
        Self { friction, ..self }
    }

    /// The same object with another mass (kg).
    pub fn with_mass(self, mass: f32) -> Self {
        let ratio = mass / self.mass;
        Self { mass, inertia: self.inertia.map(|row| row.map(|x| x * ratio)), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_variant_keeps_the_density() {
        let object = Object::from_catalog("bleach").unwrap();
        let scaled = |scale: Vec3| ShapeVariant { scale, shoulder_drop: 0.0 };
        let small = object.scaled_variant("small", &scaled(Vec3::new(0.9, 0.8, 0.75))).unwrap();
        let ratio = small.size() / object.size();
        assert!((ratio - Vec3::new(0.9, 0.8, 0.75)).abs().max_element() < 1e-5, "{ratio}");
        assert!((small.mass - 0.54 * object.mass).abs() < 1e-5);
        let off = small.center_of_mass - object.center_of_mass * ratio;
        assert!(off.abs().max_element() < 1e-4, "{off}");
        let large = object.scaled_variant("large", &scaled(Vec3::splat(1.2))).unwrap();
        assert_eq!(large.mass, object.mass);
    }

    #[test]
    fn with_mass_equals_construction_with_that_mass() {
        let object = Object::from_catalog("bleach").unwrap();
        let parts = object.parts.clone();
        let made = Object::new("x", object.mesh.clone(), true, parts, 0.3, 0.8).unwrap();
        let object = object.with_mass(0.3);
        assert_eq!((object.mass, object.hash()), (0.3, made.hash()));
        let pairs = object.inertia.as_flattened().iter().zip(made.inertia.as_flattened());
        for (found, wanted) in pairs {
            assert!((found - wanted).abs() < 1e-5 * made.inertia[0][0], "{found}, {wanted}");
        }
    }

    #[test]
    fn object_file_error_names_the_cause() {
        let good = include_str!(concat!(env!("OUT_DIR"), "/ycb/sugar_box.json"));
        assert!(ObjectFile::parse(good).is_ok());
        let with = |from: &str, to: &str| ObjectFile::parse(&good.replace(from, to)).unwrap_err();
        assert!(with("\"mass\":", "\"weight\":").contains("weight"));
        assert!(with("\"mass\":0", "\"mass\":-0").contains("mass"));
        let loft = r#""loft": [{"at": [0, 0, 0], "turn_deg": [0, 0, 0], "sections": []}], "mass":"#;
        let both = with("\"mass\":", loft);
        assert!(both.contains("either sections or lofts"), "{both}");
        assert!(ObjectFile::parse(r#"{"name": 3}"#).is_err());
    }
}
