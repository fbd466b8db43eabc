//! Imports an object from a mesh file.
//!
//! In: the bytes of the file and the user's options. Out: an [`Object`], with the assumptions and repairs.
//! Mesh formats carry no unit, mass or orientation: unspecified values get deterministic defaults, so equal
//! bytes and options give equal objects. The exception is [`OrientationReason::ChosenByModel`]: to reproduce
//! such an import, pass its [`ImportedObject::orientation`] as an option.

use crate::object::{DEFAULT_FRICTION, Object};
pub use crate::orientation::{Orientation, OrientationReason};
pub use crate::resting_pose::MAX_STABLE_POSES;
use crate::resting_pose::{Candidates, object_on_hull};
use mesh::{
    self, ConvexDecomposition, ExternalFiles, ImportedMesh, Mesh, MeshError, MeshOptions,
    NO_EXTERNAL_FILES, RepairReport, ResolvedUnit, SimplifyReport, Unit, UpAxis, VolumeSource,
};
use progress::{NoProgress, Progress};

/// Density (kg/m³) assumed if no mass is given: that of a packed box of food.
pub const DEFAULT_DENSITY: f64 = 600.0;
/// Min and max assumed mass (kg): the range that the standard hand can lift. A test compares it with
/// `graspable.mass` of the robot's hand file, on which this crate does not depend.
pub const MASS_RANGE: [f64; 2] = [0.02, 1.5];

/// Min and max mass (kg) that a user can give: from a sheet of paper to more than any robot hand lifts. The physics
/// needs masses of similar orders of magnitude.
pub const MASS_LIMITS: [f64; 2] = [0.001, 100.0];
/// Min and max density (kg/m³) that a user can give, from aerogel to osmium.
pub const DENSITY_LIMITS: [f64; 2] = [1.0, 23_000.0];

/// User's options for a mesh file; `None` selects the default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// Unit of the coordinates; by default that of the format, or the one that suits the size.
    pub unit: Option<Unit>,
    /// Length (m) of the longest side, instead of unit and scale.
    pub size: Option<f32>,
    /// Factor on the coordinates, in addition to the unit.
    pub scale: Option<f32>,
    /// Axis of the file that points up; by default that of the format.
    pub up: Option<UpAxis>,
    /// Mass (kg); by default volume times [`DEFAULT_DENSITY`], clamped to [`MASS_RANGE`].
    pub mass: Option<f32>,
    /// Orientation on the table; by default that of the file if it is stable.
    pub orientation: Option<Orientation>,
}

impl ImportOptions {
    /// Options of the mesh, without mass and orientation.
    pub fn mesh(&self) -> MeshOptions {
        MeshOptions { unit: self.unit, size: self.size, scale: self.scale, up: self.up }
    }
}

/// Source of an object's mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MassSource {
    /// Given in the options.
    Given,
    /// Volume times [`DEFAULT_DENSITY`].
    DefaultDensity,
    /// The end of [`MASS_RANGE`] (kg) to which the estimate was clamped.
    Clamped(f64),
}

/// An object from a mesh file, with the assumptions and repairs of the import.
#[derive(Clone, Debug)]
pub struct ImportedObject {
    /// The object; its name is the file name.
    pub object: Object,
    /// Unit of the file's coordinates, with the reason.
    pub unit: ResolvedUnit,
    /// Counts of the repairs and of the remaining defects.
    pub repair: RepairReport,
    /// Result of the simplification, if the file had too many triangles.
    pub simplified: Option<SimplifyReport>,
    /// Volume (m³).
    pub volume: f64,
    /// Solid from which volume and mass properties are computed.
    pub volume_source: VolumeSource,
    /// Source of the mass.
    pub mass_source: MassSource,
    /// Number of stable poses offered; valid indices of [`Orientation::StablePose`] are below it.
    pub num_stable_poses: usize,
    /// Fraction of the empty space in the hull of the mesh that the convex parts fill.
    pub filled_fraction: f64,
    /// Orientation on the table, with the reason.
    pub orientation: (Orientation, OrientationReason),
}

/// Stages of an import in its progress reports; each takes noticeable time for a large mesh.
pub mod stage {
    /// Parse and repair the triangles.
    pub const PARSE: &str = "parse";
    /// Compute the stable poses.
    pub const STABLE_POSES: &str = "stable poses";
    /// Decompose the mesh into convex parts.
    pub const DECOMPOSE: &str = "convex parts";
}

/// Number of [`stage`]s.
const NUM_STAGES: usize = 3;

/// Chooses a stable pose for a mesh that is unstable in the orientation of its file.
///
/// Receives the mesh in each stable pose, the most stable first; returns the index of one. `None` selects the
/// first.
pub type OrientationChooser<'a> = &'a dyn Fn(&mut dyn Iterator<Item = Mesh>) -> Option<usize>;

/// Chooses the first pose, which is the most stable one.
pub const FIRST_POSE: OrientationChooser<'static> = &|_| None;

/// Whether an object stays in its pose on a table, in a simulation.
pub type RestTest<'a> = &'a dyn Fn(&Object) -> bool;

/// Everything that an import takes from its caller in addition to the file and the options.
#[derive(Clone, Copy)]
pub struct ImportContext<'a> {
    /// Files to which the mesh refers.
    pub files: &'a ExternalFiles<'a>,
    /// Choice among the stable poses.
    pub choose_orientation: OrientationChooser<'a>,
    /// Test of each stable pose; a pose that fails is not offered.
    pub rests: RestTest<'a>,
    /// Receives the stages of the import.
    pub progress: &'a dyn Progress,
}

impl ImportContext<'static> {
    /// No other files, the most stable pose, no simulation and no progress.
    pub const NONE: Self = Self {
        files: NO_EXTERNAL_FILES,
        choose_orientation: FIRST_POSE,
        rests: &|_| true,
        progress: &NoProgress,
    };
}

/// Imports an object from the bytes of a mesh file.
///
/// ```rust
/// use objects::import::{ImportContext, ImportOptions, MassSource, import_object};
/// let obj = b"v 0 0 0\nv 60 0 0\nv 0 40 0\nv 0 0 120\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"; // mm
/// let options = ImportOptions { mass: Some(0.25), ..ImportOptions::default() };
/// let wedge = import_object("wedge.obj", obj, options, &ImportContext::NONE)?;
/// assert_eq!((wedge.object.mass, wedge.mass_source), (0.25, MassSource::Given));
/// # Ok::<(), mesh::MeshError>(())
/// ```
pub fn import_object(
    file_name: &str,
    bytes: &[u8],
    options: ImportOptions,
    context: &ImportContext,
) -> Result<ImportedObject, MeshError> {
    context.progress.update(stage::PARSE, 0, NUM_STAGES);
    let imported = mesh::import_with_files(bytes, &options.mesh(), context.files)?;
    object_from_mesh(file_name, imported, options.mass, options.orientation, context)
}

/// The part of [`import_object`] after the file is read. `mass` (kg) and `orientation` are those of the options.
pub fn object_from_mesh(
    file_name: &str,
    imported: ImportedMesh,
    mass: Option<f32>,
    orientation: Option<Orientation>,
    context: &ImportContext,
) -> Result<ImportedObject, MeshError> {
    let report = |stage, done| context.progress.update(stage, done, NUM_STAGES);
    let ImportedMesh { mesh, unit, repair, simplified, is_y_up } = imported;
    let properties = mesh::solid_properties(&mesh, repair.watertight)?;
    let (kg, mass_source) = estimate_mass(properties.volume, mass);
    report(stage::STABLE_POSES, 1);
    let candidates = Candidates::of(&mesh, &properties, is_y_up);
    let poses = candidates.offered(&|pose| {
        let object = object_on_hull(&mesh, &properties, &pose.rotation, kg);
        object.is_ok_and(|object| (context.rests)(&object))
    });
    let (orientation, reason) = poses.choose(&mesh, orientation, context);
    let poses = poses.stable;
    let (mesh, properties, orientation) = match orientation {
        Orientation::StablePose(index) if index < poses.len() => {
            let rotation = &poses[index].rotation;
            (mesh.rotated(rotation), properties.rotated(rotation), orientation)
        }
        _ => (mesh, properties, Orientation::AsInFile),
    };
    report(stage::DECOMPOSE, 2);
    let ConvexDecomposition { hulls: parts, filled_fraction, .. } = mesh::decompose(&mesh);
    let (volume, volume_source) = (properties.volume, properties.source);
    let object = match volume_source {
        VolumeSource::Surface => Object::new(file_name, mesh, true, parts, kg, DEFAULT_FRICTION)?,
        _ => Object::with_properties(file_name, mesh, parts, kg, DEFAULT_FRICTION, properties),
    };
    Ok(ImportedObject {
        object,
        unit,
        repair,
        simplified,
        volume,
        volume_source,
        mass_source,
        num_stable_poses: poses.len(),
        filled_fraction,
        orientation: (orientation, reason),
    })
}

/// Mass (kg) of a volume (m³), unless a valid mass is given.
fn estimate_mass(volume: f64, given: Option<f32>) -> (f32, MassSource) {
    if let Some(kg) = given.filter(|kg| kg.is_finite() && *kg > 0.0) {
        return (kg, MassSource::Given);
    }
    let assumed = DEFAULT_DENSITY * volume;
    let kg = assumed.clamp(MASS_RANGE[0], MASS_RANGE[1]);
    (kg as f32, if kg == assumed { MassSource::DefaultDensity } else { MassSource::Clamped(kg) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    // A box of 40 x 60 x 120 mm.
    const BOX: &str = "v 0 0 0\nv 40 0 0\nv 40 60 0\nv 0 60 0\nv 0 0 120\nv 40 0 120\nv 40 60 120\n\
        v 0 60 120\nf 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

    fn import_obj(text: &str, options: ImportOptions) -> ImportedObject {
        let stages = RefCell::new(Vec::new());
        let progress = |stage: &str, done: usize, total: usize| {
            assert_eq!((done, total), (stages.borrow().len(), 3));
            stages.borrow_mut().push(stage.to_owned());
        };
        let context = ImportContext {
            choose_orientation: &tallest_pose,
            progress: &progress,
            ..ImportContext::NONE
        };
        let found = import_object("box.obj", text.as_bytes(), options, &context).unwrap();
        assert_eq!(stages.into_inner(), [stage::PARSE, stage::STABLE_POSES, stage::DECOMPOSE]);
        found
    }

    fn tallest_pose(poses: &mut dyn Iterator<Item = Mesh>) -> Option<usize> {
        let heights = poses.map(|mesh| mesh.extent().z).enumerate();
        heights.max_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(index, _)| index)
    }

    #[test]
    fn unspecified_options_use_defaults() {
        let found = import_obj(BOX, ImportOptions::default());
        assert_eq!(
            (found.unit.unit, found.mass_source),
            (Unit::Millimetre, MassSource::DefaultDensity)
        );
        assert!((f64::from(found.object.mass) - 600.0 * 0.04 * 0.06 * 0.12).abs() < 1e-6);
        assert_eq!(
            (found.num_stable_poses, found.orientation),
            (6, (Orientation::AsInFile, OrientationReason::Given))
        );
    }

    #[test]
    fn given_options_override_defaults() {
        let options = ImportOptions {
            unit: Some(Unit::Inch),
            mass: Some(0.3),
            orientation: Some(Orientation::StablePose(0)),
            ..ImportOptions::default()
        };
        let text = BOX.replace("120", "12").replace("60", "6").replace("40", "4");
        let found = import_obj(&text, options);
        assert_eq!((found.object.mass, found.mass_source), (0.3, MassSource::Given));
        // The most stable pose is on the largest face, 6 x 12 inches; the height is 4 inches.
        assert!((found.object.size().z - 4.0 * 0.0254).abs() < 1e-6, "{}", found.object.size());
    }

    #[test]
    fn estimated_mass_is_clamped_to_the_liftable_range() {
        for (unit, kg) in [(Unit::Centimetre, 1.5), (Unit::Millimetre, 0.02)] {
            let text = BOX.replace("120", "30").replace("60", "30").replace("40", "30");
            let found =
                import_obj(&text, ImportOptions { unit: Some(unit), ..ImportOptions::default() });
            assert_eq!(found.mass_source, MassSource::Clamped(kg));
            assert_eq!(found.object.mass, kg as f32);
        }
    }

    #[test]
    fn slightly_tilted_mesh_settles_on_its_base() {
        // One corner of the base is 5 mm too low.
        let uneven = BOX.replace("v 40 60 0", "v 40 60 -5");
        let found = import_obj(&uneven, ImportOptions::default());
        assert!(
            matches!(found.orientation, (Orientation::StablePose(_), OrientationReason::Settled)),
            "{:?}",
            found.orientation
        );
        assert!((0.115..0.13).contains(&found.object.size().z), "{}", found.object.size());
    }

    #[test]
    fn mesh_with_bulged_base_keeps_its_orientation() {
        let bulge = BOX.replace("v 0 60 120\n", "v 0 60 120\nv 20 30 -0.5\n");
        let bulge = bulge.replace("f 1 4 3 2", "f 1 4 9\nf 4 3 9\nf 3 2 9\nf 2 1 9");
        let orientation = import_obj(&bulge, ImportOptions::default()).orientation;
        assert_eq!(orientation, (Orientation::AsInFile, OrientationReason::Given));
    }

    /// The YCB scans are not in the repository; `NGF_SCANS` names their folder.
    #[test]
    fn scans_keep_their_orientation() {
        let Ok(folder) = std::env::var("NGF_SCANS") else {
            println!("skipped: NGF_SCANS is not set");
            return;
        };
        let mut num_scans = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let bytes = std::fs::read(&path).unwrap();
            let Ok(import) = mesh::import(&bytes, &MeshOptions::default()) else { continue };
            num_scans += 1;
            let height = import.mesh.extent().z;
            let found =
                import_object("scan.obj", &bytes, ImportOptions::default(), &ImportContext::NONE)
                    .unwrap();
            println!(
                "{path:?}: {:?}, {} of {height} m high",
                found.orientation,
                found.object.size().z
            );
            assert!((found.object.size().z - height).abs() < 0.03 * height, "{path:?}");
        }
        assert!(num_scans > 0, "NGF_SCANS has no scans");
    }

    #[test]
    fn unstable_mesh_takes_the_most_stable_or_the_chosen_pose() {
        // A box on an edge is unstable, for each of the four edges.
        for raised in
            [[[40, 60], [40, 0]], [[40, 60], [0, 60]], [[0, 60], [0, 0]], [[40, 0], [0, 0]]]
        {
            let raise = |text: String, [x, y]: [i32; 2]| {
                text.replace(&format!("v {x} {y} 0\n"), &format!("v {x} {y} 90\n"))
            };
            let tilted = raised.into_iter().fold(BOX.to_owned(), raise);
            assert_ne!(tilted, BOX);
            let found = import_object(
                "box.obj",
                tilted.as_bytes(),
                ImportOptions::default(),
                &ImportContext::NONE,
            )
            .unwrap();
            assert_eq!(found.orientation.1, OrientationReason::Unstable, "{raised:?}");
        }
        let tilted = BOX.replace("v 40 60 0", "v 40 60 90").replace("v 40 0 0", "v 40 0 90");
        let most_stable = import_object(
            "box.obj",
            tilted.as_bytes(),
            ImportOptions::default(),
            &ImportContext::NONE,
        )
        .unwrap();
        assert_eq!(
            most_stable.orientation,
            (Orientation::StablePose(0), OrientationReason::Unstable)
        );
        let chosen = import_obj(&tilted, ImportOptions::default());
        assert!(
            matches!(
                chosen.orientation,
                (Orientation::StablePose(1..), OrientationReason::ChosenByModel)
            ),
            "{:?}",
            chosen.orientation
        );
        assert!(chosen.object.size().z > most_stable.object.size().z);
        // A given pose takes precedence over the callback.
        let options = ImportOptions {
            orientation: Some(Orientation::StablePose(0)),
            ..ImportOptions::default()
        };
        assert_eq!(
            import_obj(&tilted, options).orientation,
            (Orientation::StablePose(0), OrientationReason::Given)
        );
        // An index beyond the stable poses falls back to the orientation of the file.
        let options = ImportOptions {
            orientation: Some(Orientation::StablePose(77)),
            ..ImportOptions::default()
        };
        assert_eq!(import_obj(BOX, options).orientation.0, Orientation::AsInFile);
    }
}
