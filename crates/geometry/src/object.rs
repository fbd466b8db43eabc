//! An object to grasp: its outer mesh, convex parts, mass and friction, standing upright on z = 0.

use crate::loft::Loft;
use crate::mesh::{self, Mesh, MeshError};
use crate::proportions::Proportions;
use crate::{Pose, Vec3};
use glamx::Quat;

/// What the scene needs to know of an object; frame: z up, bottom at z = 0, bounding box centred in x and y.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name for people.
    pub name: String,
    /// The surface that the camera sees and that is drawn.
    pub mesh: Mesh,
    /// Convex point sets that collide.
    pub parts: Vec<Vec<Vec3>>,
    /// Mass (kg).
    pub mass: f32,
    /// Coulomb friction coefficient.
    pub friction: f32,
    /// Centre of mass (m).
    pub center_of_mass: Vec3,
    /// Inertia about the centre of mass (kg m²), rows.
    pub inertia: [[f32; 3]; 3],
    /// Least and greatest corner of the bounding box (m).
    pub bounds: [Vec3; 2],
}

/// An object file: one upright loft or several placed ones, with mass, friction and source.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectFile {
    /// Name for people.
    pub name: String,
    /// Mass (kg).
    pub mass: f32,
    /// Coulomb friction coefficient.
    pub friction: f32,
    /// Where the figures come from.
    pub source: String,
    /// Sections from the bottom up: height, half-widths, exponent, and optionally the centre (m).
    pub sections: Option<Loft>,
    /// Lofts that together make up the object. Where they overlap, their mass counts twice.
    #[serde(default, rename = "loft")]
    pub lofts: Vec<PlacedLoft>,
}

/// A loft somewhere in the object.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlacedLoft {
    /// Where its origin is (m).
    pub at: [f32; 3],
    /// Its turn (degrees) about x, then y, then z.
    pub turn_deg: [f32; 3],
    /// Its sections.
    pub sections: Loft,
}

impl PlacedLoft {
    fn pose(&self) -> Pose {
        let about = |axis: Vec3, angle_deg: f32| {
            let (sin, cos) = libm::sincosf(0.5 * angle_deg.to_radians());
            let v = axis * sin;
            Quat::from_xyzw(v.x, v.y, v.z, cos)
        };
        let [x, y, z] = self.turn_deg;
        let turn = about(Vec3::Z, z) * about(Vec3::Y, y) * about(Vec3::X, x);
        Pose::from_parts(Vec3::from_array(self.at), turn)
    }
}

impl ObjectFile {
    /// Reads an object file, which `build.rs` made JSON of; the message says what is wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut file: Self = serde_json::from_str(text).map_err(|error| error.to_string())?;
        if file.sections.is_some() != file.lofts.is_empty() {
            return Err("an object has either sections or lofts".into());
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

    /// The object that the file describes.
    pub fn object(&self) -> Result<Object, MeshError> {
        let (mut mesh, mut parts) = (Mesh { vertices: vec![], triangles: vec![] }, vec![]);
        for loft in &self.lofts {
            let pose = loft.pose();
            let placed = |points: Vec<Vec3>| points.into_iter().map(|p| pose * p).collect();
            let Mesh { vertices, triangles } = loft.sections.mesh();
            let first = mesh.vertices.len() as u32;
            mesh.triangles.extend(triangles.iter().map(|t| t.map(|i| i + first)));
            mesh.vertices.extend::<Vec<Vec3>>(placed(vertices));
            parts.extend(loft.sections.convex_parts().into_iter().map(placed));
        }
        Object::new(&self.name, mesh, true, parts, self.mass, self.friction)
    }
}

/// Friction coefficient of a mesh that says nothing of it, the same as that of the objects of the project.
pub const MESH_FRICTION: f32 = 0.8;

impl Object {
    /// Puts mesh and parts into the object frame and spreads `mass` evenly over the mesh's volume.
    pub fn new(
        name: &str,
        mesh: Mesh,
        watertight: bool,
        parts: Vec<Vec<Vec3>>,
        mass: f32,
        friction: f32,
    ) -> Result<Self, MeshError> {
        let shift = mesh.footing();
        let mesh = mesh.translated(shift);
        let parts = parts
            .into_iter()
            .map(|part| part.into_iter().map(|point| point + shift).collect())
            .collect();
        let solid = mesh::solid(&mesh, watertight)?;
        let density = mass / solid.volume as f32;
        Ok(Self {
            name: name.to_owned(),
            parts,
            mass,
            friction,
            center_of_mass: solid.center,
            inertia: solid.inertia.map(|row| row.map(|x| x * density)),
            bounds: mesh.bounds(),
            mesh,
        })
    }

    /// Extents of the bounding box (m).
    pub fn size(&self) -> Vec3 {
        self.bounds[1] - self.bounds[0]
    }

    /// A like shape of other proportions, as dense as before, but never heavier.
    pub fn reshaped(&self, name: &str, proportions: &Proportions) -> Result<Self, MeshError> {
        let height = self.bounds[1].z;
        let place =
            |points: &[Vec3]| points.iter().map(|p| proportions.place(*p, height)).collect();
        let vertices = place(&self.mesh.vertices);
        let mesh = Mesh { vertices, triangles: self.mesh.triangles.clone() };
        let parts = self.parts.iter().map(|part| place(part)).collect();
        let share = mesh::solid(&mesh, true)?.volume / mesh::solid(&self.mesh, true)?.volume;
        let mass = self.mass * share.min(1.0) as f32;
        Self::new(name, mesh, true, parts, mass, self.friction)
    }

    /// BLAKE3 over mesh, parts, mass and friction, hex.
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

    /// The same object of another mass (kg).
    pub fn with_mass(self, mass: f32) -> Self {
        let share = mass / self.mass;
        Self { mass, inertia: self.inertia.map(|row| row.map(|x| x * share)), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reshaped_object_is_as_dense() {
        let object = Object::built_in("bleach").unwrap();
        let scaled = |scale: Vec3| Proportions { scale, sink: 0.0 };
        let small = object.reshaped("small", &scaled(Vec3::new(0.9, 0.8, 0.75))).unwrap();
        let ratio = small.size() / object.size();
        assert!((ratio - Vec3::new(0.9, 0.8, 0.75)).abs().max_element() < 1e-5, "{ratio}");
        assert!((small.mass - 0.54 * object.mass).abs() < 1e-5);
        let off = small.center_of_mass - object.center_of_mass * ratio;
        assert!(off.abs().max_element() < 1e-4, "{off}");
        let large = object.reshaped("large", &scaled(Vec3::splat(1.2))).unwrap();
        assert_eq!(large.mass, object.mass);
    }

    #[test]
    fn an_object_of_another_mass_is_the_one_that_is_made_with_it() {
        let object = Object::built_in("bleach").unwrap();
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
    fn bad_object_files_say_why() {
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
