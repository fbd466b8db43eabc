//! Objects as bytes, for programs of one version that share no memory: a page sends its object to workers
//! without another convex decomposition.

use crate::Object;
use geometry::Vec3;
use mesh::Mesh;
use serde::{Deserialize, Serialize};

/// Fields of an [`Object`] that can be serialized.
#[derive(Serialize, Deserialize)]
struct Fields {
    name: String,
    vertices: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    parts: Vec<Vec<[f32; 3]>>,
    mass: f32,
    friction: f32,
    center_of_mass: [f32; 3],
    inertia: [[f32; 3]; 3],
    bounds: [[f32; 3]; 2],
}

fn arrays(points: &[Vec3]) -> Vec<[f32; 3]> {
    points.iter().map(|point| point.to_array()).collect()
}

fn points(arrays: Vec<[f32; 3]>) -> Vec<Vec3> {
    arrays.into_iter().map(Vec3::from_array).collect()
}

impl Object {
    /// The object as bytes.
    ///
    /// ```
    /// use objects::Object;
    /// let bottle = Object::from_catalog("bleach").expect("a built-in object");
    /// let same = Object::from_bytes(&bottle.to_bytes())?;
    /// assert_eq!(same.hash(), bottle.hash());
    /// # Ok::<(), postcard::Error>(())
    /// ```
    pub fn to_bytes(&self) -> Vec<u8> {
        let fields = Fields {
            name: self.name.clone(),
            vertices: arrays(&self.mesh.vertices),
            triangles: self.mesh.triangles.clone(),
            parts: self.parts.iter().map(|part| arrays(part)).collect(),
            mass: self.mass,
            friction: self.friction,
            center_of_mass: self.center_of_mass.to_array(),
            inertia: self.inertia,
            bounds: self.bounds.map(|corner| corner.to_array()),
        };
        // Only sequences of unknown length fail.
        postcard::to_allocvec(&fields).unwrap_or_default()
    }

    /// Inverse of [`Object::to_bytes`].
    ///
    /// # Errors
    /// The bytes are not an object of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, postcard::Error> {
        let fields: Fields = postcard::from_bytes(bytes)?;
        Ok(Self {
            name: fields.name,
            mesh: Mesh { vertices: points(fields.vertices), triangles: fields.triangles },
            parts: fields.parts.into_iter().map(points).collect(),
            mass: fields.mass,
            friction: fields.friction,
            center_of_mass: Vec3::from_array(fields.center_of_mass),
            inertia: fields.inertia,
            bounds: fields.bounds.map(Vec3::from_array),
        })
    }
}
