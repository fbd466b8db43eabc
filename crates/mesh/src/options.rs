//! User's options of a mesh file: size and up axis.

use crate::{Mesh, MeshError, Unit};
use glamx::Vec3;

/// User's options of a mesh file; `None` selects the default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshOptions {
    /// Unit of the coordinates; by default that of the format, or the one that suits the size.
    pub unit: Option<Unit>,
    /// Length (m) of the longest side of the bounding box, instead of unit and scale.
    pub size: Option<f32>,
    /// Factor on the coordinates, in addition to the unit.
    pub scale: Option<f32>,
    /// Axis of the file that points up; by default that of the format.
    pub up: Option<UpAxis>,
}

/// Axis of a file's coordinates that points up; serialized in lower case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// x.
    X,
    /// y, as in films and games.
    Y,
    /// z, as in CAD and robotics.
    Z,
}

impl MeshOptions {
    /// Whether unit, size or scale are given.
    pub fn has_size(&self) -> bool {
        self.unit.is_some() || self.size.is_some() || self.scale.is_some()
    }

    /// Fails if a number is not positive, or if the size is given twice.
    pub fn check(&self) -> Result<(), MeshError> {
        let is_valid = |x: f32| x.is_finite() && x > 0.0;
        let invalid = |option, expected| Err(MeshError::InvalidOption { option, expected });
        match (self.size, self.scale) {
            (Some(size), _) if !is_valid(size) => invalid("size", "a positive length"),
            (_, Some(scale)) if !is_valid(scale) => invalid("scale", "a positive factor"),
            (Some(_), Some(_)) => invalid("size", "either a size or a scale"),
            (Some(_), None) if self.unit.is_some() => invalid("size", "either a size or a unit"),
            _ => Ok(()),
        }
    }
}

impl UpAxis {
    /// All axes.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// Name of the axis: x, y or z.
    pub fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// Axis with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|axis| axis.name() == name)
    }

    /// The mesh rotated so that this axis points along z.
    pub(crate) fn to_z(self, mut mesh: Mesh) -> Mesh {
        mesh.vertices.iter_mut().for_each(|v| {
            *v = match self {
                Self::X => Vec3::new(-v.z, v.y, v.x),
                Self::Y => Vec3::new(v.x, -v.z, v.y),
                Self::Z => *v,
            }
        });
        mesh
    }

    /// Inverse of [`Self::to_z`].
    pub(crate) fn z_to_axis(self, mut mesh: Mesh) -> Mesh {
        mesh.vertices.iter_mut().for_each(|v| {
            *v = match self {
                Self::X => Vec3::new(v.z, v.y, -v.x),
                Self::Y => Vec3::new(v.x, v.z, -v.y),
                Self::Z => *v,
            }
        });
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_meshes;

    #[test]
    fn up_axis_points_along_z_and_keeps_the_winding() {
        let tall = test_meshes::cuboid(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0));
        for (axis, height) in [(UpAxis::X, 1.0), (UpAxis::Y, 2.0), (UpAxis::Z, 3.0)] {
            let turned = axis.to_z(tall.clone());
            assert_eq!((turned.extent().z, test_meshes::volume(&turned)), (height, 6.0));
            assert_eq!(turned.bounds()[0].z, 0.0);
            assert_eq!(axis.z_to_axis(turned), tall);
        }
    }

    #[test]
    fn contradictory_or_invalid_options_are_rejected() {
        let none = MeshOptions::default();
        for (options, option) in [
            (MeshOptions { size: Some(0.0), ..none }, "size"),
            (MeshOptions { size: Some(f32::NAN), ..none }, "size"),
            (MeshOptions { scale: Some(-1.0), ..none }, "scale"),
            (MeshOptions { size: Some(0.1), scale: Some(2.0), ..none }, "size"),
            (MeshOptions { size: Some(0.1), unit: Some(Unit::Inch), ..none }, "size"),
        ] {
            let error = options.check().unwrap_err();
            assert!(
                matches!(error, MeshError::InvalidOption { option: found, .. } if found == option)
            );
        }
        assert!(MeshOptions { scale: Some(2.0), unit: Some(Unit::Inch), ..none }.check().is_ok());
    }
}
