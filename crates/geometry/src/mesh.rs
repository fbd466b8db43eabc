//! Triangle meshes: read from untrusted bytes, healed, given a unit, weighed, split into convex parts.
//!
//! In: the bytes of an OBJ, STL, PLY, OFF, GLB or glTF file. Out: a `Mesh` in metres, with a report of what was done
//! to it. Knows nothing of files, names or physics.

mod accessor;
mod data_uri;
mod error;
mod gltf;
mod heal;
mod hull;
mod mass;
mod obj;
mod off;
mod parts;
mod ply;
mod ply_header;
mod read;
mod report;
mod rest;
#[cfg(test)]
mod samples;
mod simplify;
mod split;
mod stl;
mod unit;
mod upright;
mod voxels;

pub use error::{MeshError, Place};
pub use heal::{Healing, heal};
pub use hull::hull;
pub use mass::{Solid, solid};
pub use parts::{Method, Parts, convex_parts, convex_parts_or_hull};
pub use read::{MAX_BYTES, MAX_TRIANGLES, read};
pub use report::Report;
pub use rest::{Rest, rests, stands};
pub use simplify::Simplified;
pub use unit::{Unit, UnitGuess, guess};

use crate::Vec3;

/// A triangle soup with shared vertices, in metres once its unit is settled.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions (m), object frame.
    pub vertices: Vec<Vec3>,
    /// Corner indices into `vertices`, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// A mesh ready for use, and what was found out on the way.
#[derive(Clone, Debug, PartialEq)]
pub struct Import {
    /// The healed mesh (m), where the file had it: not centred, its bottom not moved.
    pub mesh: Mesh,
    /// The unit that was taken, and why.
    pub unit: UnitGuess,
    /// What was repaired, and what is still open.
    pub healing: Healing,
    /// What was made of it before, if it had more than [`FINE`] triangles (m).
    pub simplified: Option<Simplified>,
    /// Whether it looks drawn with y up, in a file that does not say which way is.
    pub is_drawn_y_up: bool,
}

/// Longest side (m) that an object on the table may have.
const SIZES: std::ops::RangeInclusive<f32> = 0.001..=10.0;

/// A mesh of more triangles is simplified to as many at most, before anything else is done with it.
pub const FINE: usize = 1_000_000;

/// Reads, heals and scales a mesh; the unit is guessed from the size unless it is given.
pub fn import(bytes: &[u8], unit: Option<Unit>) -> Result<Import, MeshError> {
    let mesh = read(bytes)?;
    let (mesh, simplified) = match mesh.triangles.len() > FINE {
        true => {
            let (mesh, simplified) = simplify::simplify(&mesh, FINE);
            (mesh, Some(simplified))
        }
        false => (mesh, None),
    };
    let (mesh, healing) = heal(mesh)?;
    let extent = mesh.extent();
    let unit = unit.map_or_else(|| guess(extent), |unit| UnitGuess::chosen(unit, extent));
    let metres = unit.unit.metres();
    let mesh = mesh.scaled(metres);
    let simplified = simplified.map(|s| Simplified { moved: s.moved * metres, ..s });
    let longest = mesh.extent().max_element();
    if !SIZES.contains(&longest) {
        return Err(MeshError::Size { longest, unit: unit.unit });
    }
    let is_drawn_y_up = !read::says_up(bytes) && upright::is_drawn_y_up(&mesh);
    Ok(Import { mesh, unit, healing, simplified, is_drawn_y_up })
}

impl Mesh {
    /// Least and greatest corner of the axis-aligned bounding box (m); the origin twice if there are no vertices.
    pub fn bounds(&self) -> [Vec3; 2] {
        bounds(&self.vertices)
    }

    /// Sides of the bounding box (m).
    pub fn extent(&self) -> Vec3 {
        let [low, high] = self.bounds();
        high - low
    }

    /// What the mesh is moved by (m) so that it stands on z = 0, in the middle of x and y.
    pub fn footing(&self) -> Vec3 {
        let [low, high] = self.bounds();
        let middle = 0.5 * (low + high);
        -Vec3::new(middle.x, middle.y, low.z)
    }

    /// The mesh with every coordinate multiplied by `factor`, a positive number.
    pub fn scaled(mut self, factor: f32) -> Self {
        self.vertices.iter_mut().for_each(|v| *v *= factor);
        self
    }

    /// The mesh moved by `offset` (m).
    pub fn translated(mut self, offset: Vec3) -> Self {
        self.vertices.iter_mut().for_each(|v| *v += offset);
        self
    }
}

/// Bounding box of points; the origin twice if there are none.
fn bounds(points: &[Vec3]) -> [Vec3; 2] {
    let Some(&first) = points.first() else { return [Vec3::ZERO; 2] };
    points.iter().fold([first; 2], |[low, high], &p| [low.min(p), high.max(p)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_moves_and_scales_with_its_bounds() {
        let mesh = samples::cube().scaled(2.0).translated(Vec3::new(1.0, 0.0, -1.0));
        assert_eq!(mesh.bounds(), [Vec3::new(1.0, 0.0, -1.0), Vec3::new(3.0, 2.0, 1.0)]);
        assert_eq!(mesh.extent(), Vec3::splat(2.0));
        assert_eq!(Mesh::default().bounds(), [Vec3::ZERO; 2]);
    }

    #[test]
    fn import_scales_to_metres_and_keeps_the_place() {
        let cube = samples::cube().scaled(80.0).translated(Vec3::new(0.0, 0.0, 500.0));
        let import = import(&samples::obj(&cube), None).unwrap();
        assert_eq!(import.unit.unit, Unit::Millimetre);
        assert!(import.healing.watertight);
        let [low, high] = import.mesh.bounds();
        assert!((low.z - 0.5).abs() < 1e-6 && (high.z - 0.58).abs() < 1e-6, "{low} {high}");
    }

    #[test]
    fn import_refuses_an_object_of_the_wrong_size() {
        let bytes = samples::obj(&samples::cube().scaled(80.0));
        let error = import(&bytes, Some(Unit::Metre)).unwrap_err();
        assert_eq!(error, MeshError::Size { longest: 80.0, unit: Unit::Metre });
        assert!(error.to_string().contains("80 m"), "{error}");
    }

    /// The YCB scans stay outside the repository; `NGF_SCANS` names their folder.
    #[test]
    fn scans_are_watertight_and_as_large_as_the_things() {
        let Ok(folder) = std::env::var("NGF_SCANS") else {
            println!("skipped: NGF_SCANS is not set");
            return;
        };
        let mut seen = 0;
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|e| e != "obj") {
                continue;
            }
            let import = import(&std::fs::read(&path).unwrap(), None).unwrap();
            assert!(import.healing.watertight, "{path:?}: {:?}", import.healing);
            assert_eq!(import.unit.unit, Unit::Metre, "{path:?}");
            assert!(!solid(&import.mesh, true).unwrap().from_hull, "{path:?}");
            let parts = convex_parts_or_hull(&import.mesh);
            println!("{path:?}: {:?}, {} parts", parts.method, parts.hulls.len());
            assert!(parts.hulls.len() <= parts::MAX_PARTS as usize, "{path:?}");
            if path.ends_with("004_sugar_box.obj") {
                let mut sides = import.mesh.extent().to_array().map(|x| x * 1000.0);
                sides.sort_by(f32::total_cmp);
                let wanted = [49.5, 94.2, 176.0];
                let near = sides.iter().zip(wanted).all(|(got, want)| (got - want).abs() < 1.0);
                assert!(near, "wanted {wanted:?} mm, got {sides:?}");
            }
            seen += 1;
        }
        assert!(seen > 0, "no *.obj in {folder}");
    }
}
