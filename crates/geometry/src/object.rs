//! An object to grasp: its outer mesh, convex parts, mass and friction, standing upright on z = 0.

use crate::Vec3;
use crate::loft::Loft;
use crate::mesh::{self, Mesh, MeshError};

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

/// An object file: a loft with its mass, friction and source.
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
    pub sections: Loft,
}

impl ObjectFile {
    /// Reads an object file (TOML); the message says what is wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        let file: Self = toml::from_str(text).map_err(|error| error.to_string())?;
        file.sections.check()?;
        if !(file.mass.is_finite() && file.mass > 0.0 && file.friction >= 0.0) {
            return Err("mass must be positive and friction must not be negative".into());
        }
        Ok(file)
    }

    /// The object that the file describes.
    pub fn object(&self) -> Result<Object, MeshError> {
        let parts = self.sections.convex_parts();
        Object::new(&self.name, self.sections.mesh(), true, parts, self.mass, self.friction)
    }
}

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
        let [min, max] = mesh.bounds();
        let middle = 0.5 * (min + max);
        let shift = -Vec3::new(middle.x, middle.y, min.z);
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

    /// The same object with another friction coefficient.
    pub fn with_friction(self, friction: f32) -> Self {
        Self { friction, ..self }
    }

    /// The object that comes with the project under this name (file name without extension).
    pub fn built_in(name: &str) -> Option<Self> {
        let (_, text) = BUILT_IN.iter().find(|(known, _)| *known == name)?;
        ObjectFile::parse(text).ok()?.object().ok()
    }
}

macro_rules! built_in {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../assets/objects/", $name, ".toml")))),*]
    };
}

/// Objects that come with the project: file name without extension, and text.
pub const BUILT_IN: &[(&str, &str)] =
    built_in!["sugar_box", "bleach", "cracker_box", "soup_can", "mustard"];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_objects_are_sound() {
        for (name, text) in BUILT_IN {
            let object = ObjectFile::parse(text).unwrap().object().unwrap();
            let [min, max] = object.bounds;
            assert!(min.z.abs() < 1e-6 && (min.x + max.x).abs() < 1e-5, "{name}: {min} {max}");
            let com = object.center_of_mass;
            assert!(com.cmpgt(min).all() && com.cmplt(max).all(), "{name}: centre of mass {com}");
        }
    }

    #[test]
    fn look_alikes_have_the_extents_of_the_scans() {
        // Bounding boxes of the YCB scans (mm).
        let scans = [
            ("sugar_box", [49.5, 94.2, 176.0]),
            ("bleach", [102.4, 67.7, 250.6]),
            ("cracker_box", [71.8, 164.0, 213.4]),
            ("soup_can", [67.9, 67.8, 102.0]),
            ("mustard", [97.2, 66.6, 191.4]),
        ];
        for (name, wanted) in scans {
            let [min, max] = Object::built_in(name).unwrap().bounds;
            let got = (max - min) * 1000.0;
            let error = (got - Vec3::from_array(wanted)).abs().max_element();
            assert!(error < 4.0, "{name}: {got} mm against {wanted:?} mm");
        }
    }

    #[test]
    fn bad_object_files_say_why() {
        let good = BUILT_IN[0].1;
        let with = |from: &str, to: &str| ObjectFile::parse(&good.replace(from, to)).unwrap_err();
        assert!(with("mass =", "weight =").contains("weight"));
        assert!(with("mass = 0", "mass = -0").contains("mass"));
        assert!(ObjectFile::parse("name = 3").is_err());
    }
}
