//! List and contact sheet of the built-in objects, and selection of the object of a command.

use crate::mesh_file::{MeshFile, MeshSizeOptions, import_error};
use anyhow::{Result, bail};
use datagen::report::{Collection, contact_sheet};
use mesh::{MeshOptions, SimplifyReport};
use objects::catalog::CATALOG;
use objects::generated::{self, FAMILIES};
use objects::import::{
    self, DENSITY_LIMITS, FIRST_POSE, ImportContext, ImportOptions, ImportedObject, MASS_LIMITS,
    Orientation, OrientationChooser,
};
use objects::object::Object;
use scene::{SceneConfig, rests_on_table};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Options of `ngf objects`.
#[derive(clap::Args)]
pub(crate) struct ListOptions {
    /// Write a contact sheet (SVG) to this file instead of printing the list
    #[arg(long, value_name = "FILE")]
    contact_sheet: Option<PathBuf>,
    /// The generated objects of training and evaluation instead of the built-in ones
    #[arg(long)]
    generated: bool,
}

/// Lists or draws the objects.
pub(crate) fn run(options: &ListOptions) -> Result<()> {
    if let Some(file) = &options.contact_sheet {
        let collection =
            if options.generated { Collection::Generated } else { Collection::BuiltIn };
        let sheet = contact_sheet(collection).map_err(anyhow::Error::msg)?;
        return files::atomic_file::write(file, sheet.as_bytes());
    }
    if options.generated {
        list_generated();
        return Ok(());
    }
    for entry in CATALOG {
        let file = entry.object_file().map_err(anyhow::Error::msg)?;
        let use_ = if entry.is_for_training() { "train" } else { "held out" };
        println!("{:16} {:8} {:5.3} kg  {use_}", entry.name, entry.family, file.mass);
    }
    Ok(())
}

/// Prints name, size, mass and use of each generated object.
fn list_generated() {
    for family in FAMILIES {
        let usage = family.usage();
        for name in family.names() {
            let Some(object) = generated::generate(&name) else { continue };
            let [x, y, z] = (object.size() * 1000.0).to_array();
            let size = format!("{x:.0} x {y:.0} x {z:.0} mm");
            println!("{name:14} {size:20} {:5.3} kg  {usage}", object.mass);
        }
    }
}

/// Options that select one object.
#[derive(clap::Args)]
pub(crate) struct ObjectOptions {
    /// Name of a built-in object
    #[arg(long, value_name = "NAME", conflicts_with = "mesh")]
    object: Option<String>,
    #[arg(long, value_name = "FILE", help = format!("Mesh file: {}, or a ZIP archive with one", mesh::format_list()))]
    mesh: Option<PathBuf>,
    #[command(flatten)]
    size: MeshSizeOptions,
    /// Orientation of the mesh: file, or the index of a stable pose, 0 for the most stable one
    #[arg(long, value_name = "POSE", value_parser = parse_orientation, requires = "mesh")]
    orientation: Option<Orientation>,
    /// Mass (kg) of the mesh
    #[arg(long, value_name = "KG", requires = "mesh")]
    mass: Option<f32>,
    /// Density (kg/m³) of the mesh instead of its mass
    #[arg(long, value_name = "KG_M3", conflicts_with = "mass", requires = "mesh")]
    density: Option<f32>,
    /// Friction coefficient instead of the default of the object
    #[arg(long, value_name = "MU")]
    friction: Option<f32>,
}

/// Object selected on the command line.
pub(crate) struct SelectedObject {
    /// Name of the object.
    pub(crate) name: String,
    /// Geometry, mass and friction.
    pub(crate) object: Object,
    /// Orientation on the table, if it comes from a mesh file.
    pub(crate) orientation: Option<Orientation>,
}

impl SelectedObject {
    /// Selects a built-in object.
    pub(crate) fn built_in(name: &str) -> Result<Self> {
        let object = objects::catalog::built_in_object(name)?;
        Ok(Self { name: name.to_owned(), object, orientation: None })
    }
}

impl ObjectOptions {
    /// Loads the object, if one is selected.
    pub(crate) fn load_optional(&self) -> Result<Option<SelectedObject>> {
        let is_named = self.object.is_some() || self.mesh.is_some() || self.size.is_given();
        if !is_named && self.friction.is_some() {
            bail!("--friction needs an object; select one with --object or --mesh");
        }
        if is_named { self.load().map(Some) } else { Ok(None) }
    }

    /// The mesh file, if no other object option is given.
    pub(crate) fn mesh_only(&self) -> Result<Option<&Path>> {
        let is_more = self.mass.is_some()
            || self.density.is_some()
            || self.friction.is_some()
            || self.orientation.is_some()
            || self.size.is_given();
        if self.object.is_some() || is_more {
            bail!(
                "a share link already names its object; pass only --mesh FILE if the link refers to a mesh file"
            );
        }
        Ok(self.mesh.as_deref())
    }

    /// Loads the object with the default stable pose.
    pub(crate) fn load(&self) -> Result<SelectedObject> {
        self.load_with(FIRST_POSE)
    }

    /// Loads the object; `chooser` selects a stable pose if the orientation in the file is unstable.
    pub(crate) fn load_with(&self, chooser: OrientationChooser) -> Result<SelectedObject> {
        if self.mesh.is_none() && self.size.is_given() {
            bail!("--unit, --size, --scale and --up need a mesh; select one with --mesh");
        }
        let subject = match (&self.object, &self.mesh) {
            (Some(name), None) => SelectedObject::built_in(name)?,
            (None, Some(path)) => {
                let options =
                    ImportOptions { orientation: self.orientation, ..self.size.import_options() };
                import_mesh(path, options, &self.mass_spec()?, chooser)?
            }
            _ => bail!(
                "select an object with --object, or a mesh file with --mesh and --mass or --density"
            ),
        };
        Ok(match self.friction {
            Some(friction) if !(friction.is_finite() && friction >= 0.0) => {
                bail!("--friction must be zero or a positive number, found {friction}")
            }
            Some(friction) => {
                SelectedObject { object: subject.object.with_friction(friction), ..subject }
            }
            None => subject,
        })
    }
}

/// Imports an object from a mesh file with the same defaults as the page. Its name is the file stem, or the
/// file name if a built-in object has that stem. Prints notes about automatic choices to stderr.
pub(crate) fn import_mesh(
    path: &Path,
    options: ImportOptions,
    heaviness: &MassSpec,
    chooser: OrientationChooser,
) -> Result<SelectedObject> {
    let text = |name: Option<&OsStr>| name.unwrap_or_default().to_string_lossy().into_owned();
    let (stem, file_name) = (text(path.file_stem()), text(path.file_name()));
    let name = if Object::from_catalog(&stem).is_some() { file_name } else { stem };
    let mass = match heaviness {
        MassSpec::Mass(mass) => Some(*mass),
        MassSpec::Density(_) => None,
    };
    let found = import_file(path, &name, ImportOptions { mass, ..options }, chooser)?;
    if let Some(SimplifyReport { triangles_before: from, .. }) = found.simplified {
        eprintln!("{name}: simplified from {from} triangles");
    }
    if options.mesh() == MeshOptions::default() {
        eprintln!("{name}: {}", found.unit.reason);
    }
    let (orientation, reason) = found.orientation;
    if let Some(message) = reason.message() {
        eprintln!("{name}: {message}");
    }
    let object = match heaviness {
        MassSpec::Mass(_) => found.object,
        MassSpec::Density(density) => found.object.with_mass(density * found.volume as f32),
    };
    Ok(SelectedObject { name, object, orientation: Some(orientation) })
}

/// Imports a mesh file; a stable pose is one in which the object stays in the simulation.
pub(crate) fn import_file(
    path: &Path,
    name: &str,
    options: ImportOptions,
    chooser: OrientationChooser,
) -> Result<ImportedObject> {
    let file = MeshFile::open(path)?;
    let config = SceneConfig::standard()?;
    let context = ImportContext {
        files: &file.files(),
        choose_orientation: chooser,
        rests: &|object| rests_on_table(&config, object),
        ..ImportContext::NONE
    };
    import::import_object(name, &file.bytes, options, &context)
        .map_err(|error| import_error(path, error))
}

/// Parses an orientation: `file`, or the index of a stable pose.
fn parse_orientation(text: &str) -> Result<Orientation, String> {
    match text {
        "file" => Ok(Orientation::AsInFile),
        index => index
            .parse()
            .map(Orientation::StablePose)
            .map_err(|_| "expected \"file\" or the index of a stable pose".to_owned()),
    }
}

/// Mass of a mesh, as specified by the user.
pub(crate) enum MassSpec {
    /// Mass (kg).
    Mass(f32),
    /// Density (kg/m³).
    Density(f32),
}

/// Checks that a number is within its limits.
pub(crate) fn check_range(name: &str, value: f32, limits: [f64; 2], unit: &str) -> Result<f32> {
    let [min, max] = limits;
    if (min..=max).contains(&f64::from(value)) {
        return Ok(value);
    }
    bail!("{name} must be between {min} and {max} {unit}, found {value}")
}

impl ObjectOptions {
    fn mass_spec(&self) -> Result<MassSpec> {
        match (self.mass, self.density) {
            (Some(mass), _) => check_range("--mass", mass, MASS_LIMITS, "kg").map(MassSpec::Mass),
            (None, Some(density)) => {
                check_range("--density", density, DENSITY_LIMITS, "kg/m³").map(MassSpec::Density)
            }
            (None, None) => bail!("a mesh needs --mass KG or --density KG_M3"),
        }
    }
}
