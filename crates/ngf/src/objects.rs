//! Objects: a list and a sheet of those that are built in, and which one a command works on.

use anyhow::{Context, Result, bail};
use geometry::brought::{self, Guide, Stands, Told};
use geometry::catalog::CATALOG;
use geometry::mesh::{self, Simplified};
use geometry::object::Object;
use std::ffi::OsStr;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Draws all built-in objects.
#[derive(clap::Args)]
pub(crate) struct SheetOptions {
    /// Where to write the contact sheet (SVG).
    #[arg(long, value_name = "FILE")]
    sheet: Option<PathBuf>,
}

/// Lists the built-in objects, or draws them.
pub(crate) fn run(options: &SheetOptions) -> Result<()> {
    if let Some(file) = &options.sheet {
        let sheet = dataset::report::contact_sheet().map_err(anyhow::Error::msg)?;
        return dataset::store::write(file, sheet.as_bytes());
    }
    for entry in CATALOG {
        let file = entry.file().map_err(anyhow::Error::msg)?;
        let use_ = if entry.is_for_training() { "to learn from" } else { "held out" };
        println!("{:16} {:8} {:5.3} kg  {use_}", entry.name, entry.family, file.mass);
    }
    Ok(())
}

/// The object.
#[derive(clap::Args)]
pub(crate) struct ObjectOptions {
    /// Built-in object by name.
    #[arg(long, value_name = "NAME", conflicts_with = "mesh")]
    object: Option<String>,
    /// Mesh file: OBJ, STL, PLY, OFF, GLB or glTF.
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Mass (kg) of the mesh.
    #[arg(long, value_name = "KG", requires = "mesh")]
    mass: Option<f32>,
    /// Density (kg/m³) of the mesh instead of its mass.
    #[arg(long, value_name = "KG_M3", conflicts_with = "mass", requires = "mesh")]
    density: Option<f32>,
    /// Friction coefficient instead of the object's own.
    #[arg(long, value_name = "MU")]
    friction: Option<f32>,
}

/// An object that a command works on.
pub(crate) struct Subject {
    /// What it is called.
    pub(crate) name: String,
    /// The object itself.
    pub(crate) object: Object,
    /// How it stands, if it is of a file.
    pub(crate) stands: Option<Stands>,
}

impl Subject {
    /// A built-in one.
    pub(crate) fn built_in(name: &str) -> Result<Self> {
        let object = dataset::generate::built_in_object(name)?;
        Ok(Self { name: name.to_owned(), object, stands: None })
    }
}

impl ObjectOptions {
    /// Loads the object, if one is named.
    pub(crate) fn load_any(&self) -> Result<Option<Subject>> {
        let is_named = self.object.is_some() || self.mesh.is_some();
        if !is_named && self.friction.is_some() {
            bail!("--friction is of one object: name it with --object or --mesh");
        }
        if is_named { self.load().map(Some) } else { Ok(None) }
    }

    /// The mesh file, where nothing but that may be given.
    pub(crate) fn mesh_alone(&self) -> Result<Option<&Path>> {
        let is_more = self.mass.is_some() || self.density.is_some() || self.friction.is_some();
        if self.object.is_some() || is_more {
            bail!(
                "a link says what it is about: give its file with --mesh, if it is one, and no more"
            );
        }
        Ok(self.mesh.as_deref())
    }

    /// Loads the object.
    pub(crate) fn load(&self) -> Result<Subject> {
        self.load_as(&mut ())
    }

    /// Loads the object; `guide` lays what would fall over.
    pub(crate) fn load_as(&self, guide: &mut impl Guide) -> Result<Subject> {
        let subject = match (&self.object, &self.mesh) {
            (Some(name), None) => Subject::built_in(name)?,
            (None, Some(path)) => of_mesh(path, &self.heaviness()?, guide)?,
            _ => bail!(
                "name an object with --object, or a mesh file with --mesh and --mass or --density"
            ),
        };
        Ok(match self.friction {
            Some(friction) if !(friction.is_finite() && friction >= 0.0) => {
                bail!("--friction must be zero or a positive number, found {friction}")
            }
            Some(friction) => Subject { object: subject.object.with_friction(friction), ..subject },
            None => subject,
        })
    }
}

/// The object of a mesh file as the page has it too; its name is that of the file, with its ending where a built-in object
/// has that name. Says what was made of it that somebody may not expect.
pub(crate) fn of_mesh(
    path: &Path,
    heaviness: &Heaviness,
    guide: &mut impl Guide,
) -> Result<Subject> {
    let bytes = read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let text = |name: Option<&OsStr>| name.unwrap_or_default().to_string_lossy().into_owned();
    let (stem, whole) = (text(path.file_stem()), text(path.file_name()));
    let name = if Object::built_in(&stem).is_some() { whole } else { stem };
    let mass = match heaviness {
        Heaviness::Mass(mass) => Some(*mass),
        Heaviness::Density(_) => None,
    };
    let told = Told { mass, ..Told::default() };
    let found = brought::read(&name, &bytes, told, guide)
        .with_context(|| format!("{} cannot be used", path.display()))?;
    if let Some(Simplified { from, .. }) = found.simplified {
        eprintln!("{name}: {from} triangles are too many, and were made fewer");
    }
    let (stands, because) = found.stands;
    if let Some(sentence) = because.sentence() {
        eprintln!("{name}: {sentence}");
    }
    let object = match heaviness {
        Heaviness::Mass(_) => found.object,
        Heaviness::Density(density) => {
            let volume = mesh::solid(&found.object.mesh, found.healing.watertight)?.volume;
            found.object.with_mass(density * volume as f32)
        }
    };
    Ok(Subject { name, object, stands: Some(stands) })
}

/// How heavy a mesh is.
pub(crate) enum Heaviness {
    /// In kilograms.
    Mass(f32),
    /// In kilograms a cubic metre.
    Density(f32),
}

/// A value that is one, by the name under which it was given.
pub(crate) fn positive(name: &str, value: f32, unit: &str) -> Result<f32> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    bail!("{name} must be a positive number of {unit}, found {value}")
}

impl ObjectOptions {
    fn heaviness(&self) -> Result<Heaviness> {
        match (self.mass, self.density) {
            (Some(mass), _) => positive("--mass", mass, "kilograms").map(Heaviness::Mass),
            (None, Some(density)) => {
                positive("--density", density, "kg/m³").map(Heaviness::Density)
            }
            (None, None) => bail!("a mesh needs --mass KG, or --density KG_M3"),
        }
    }
}

/// The bytes of a file, but not many more than a mesh may have.
pub(crate) fn read(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)?.take(mesh::MAX_BYTES as u64 + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}
