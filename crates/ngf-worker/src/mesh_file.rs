//! Mesh file on the command line: a file, a folder with one mesh, or a ZIP archive with one mesh.
//!
//! glTF keeps its buffers in other files of the same folder or archive.

use crate::mesh_archive::MeshArchive;
use anyhow::{Context, Error, Result, bail};
use mesh::{ExternalFiles, MeshError, MeshOptions, Unit, UpAxis};
use objects::import::ImportOptions;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

/// Mesh and the source of the files to which it refers.
pub(crate) struct MeshFile {
    /// Content of the mesh.
    pub(crate) bytes: Vec<u8>,
    source: Source,
}

enum Source {
    Folder(PathBuf),
    Archive(MeshArchive),
}

impl MeshFile {
    /// Reads the mesh at a path.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let unreadable = || format!("cannot read {}", path.display());
        if path.is_dir() {
            return Self::open(&mesh_in_folder(path)?);
        }
        let bytes = read_limited(path).with_context(unreadable)?;
        if MeshArchive::is_archive(&bytes) {
            let (archive, bytes) = MeshArchive::open(bytes).with_context(unreadable)?;
            return Ok(Self { bytes, source: Source::Archive(archive) });
        }
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Self { bytes, source: Source::Folder(folder) })
    }

    /// Files by their path relative to the mesh.
    pub(crate) fn files(&self) -> Box<ExternalFiles<'_>> {
        Box::new(|path| match &self.source {
            Source::Folder(folder) => read_beside(folder, path),
            Source::Archive(archive) => archive.file(path),
        })
    }
}

/// The only mesh in a folder.
fn mesh_in_folder(folder: &Path) -> Result<PathBuf> {
    let entries = folder.read_dir().with_context(|| format!("cannot read {}", folder.display()))?;
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let name = only_mesh(names.collect()).with_context(|| folder.display().to_string())?;
    Ok(folder.join(name))
}

/// The only name of a mesh among names; hidden files and those of macOS (`._NAME`) are not meshes.
pub(crate) fn only_mesh(names: Vec<String>) -> Result<String> {
    let is_hidden = |name: &str| name.split('/').any(|part| part.starts_with('.'));
    let is_mesh = |name: &&String| {
        let extension = Path::new(name.as_str()).extension().unwrap_or_default();
        let extension = extension.to_ascii_lowercase();
        let is_known = mesh::FORMATS.iter().flat_map(|format| format.extensions);
        is_known.into_iter().any(|known| extension == *known)
            && !is_hidden(name)
            && !name.contains("__MACOSX")
    };
    let mut meshes: Vec<&String> = names.iter().filter(is_mesh).collect();
    meshes.sort();
    match meshes[..] {
        [only] => Ok(only.clone()),
        [] => bail!("it contains no mesh; expected {}", mesh::format_list()),
        _ => {
            let names: Vec<&str> = meshes.iter().take(5).map(|name| name.as_str()).collect();
            bail!(
                "it contains {} meshes ({}, ...); select one file",
                meshes.len(),
                names.join(", ")
            )
        }
    }
}

/// Reads a file at a relative path in the folder of the mesh or below it; the mesh may not name others.
fn read_beside(folder: &Path, path: &str) -> Option<Vec<u8>> {
    let relative = Path::new(path);
    let is_below = relative.components().all(|part| matches!(part, Component::Normal(_)));
    if !is_below || path.is_empty() {
        return None;
    }
    let parent = folder.join(relative.parent()?);
    let name = relative.file_name()?.to_str()?;
    let folder_or_current = if parent.as_os_str().is_empty() { Path::new(".") } else { &parent };
    // A link may lead out of the folder.
    let is_file = |path: &Path| path.symlink_metadata().is_ok_and(|data| data.is_file());
    let exact = Some(folder_or_current.join(name)).filter(|path| is_file(path));
    // Files from Windows may name each other in another case.
    let found = exact.or_else(|| {
        let mut entries = folder_or_current.read_dir().ok()?.filter_map(Result::ok);
        let entry = entries.find(|entry| {
            entry.file_name().to_str().is_some_and(|other| other.eq_ignore_ascii_case(name))
        });
        entry.map(|entry| entry.path()).filter(|path| is_file(path))
    })?;
    read_limited(&found).ok().filter(|bytes| bytes.len() <= mesh::MAX_BYTES)
}

/// Reads a file up to slightly more than the maximum mesh size.
fn read_limited(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)?.take(mesh::MAX_BYTES as u64 + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Error of an import, with the options that the command needs.
pub(crate) fn import_error(path: &Path, error: MeshError) -> Error {
    let options = match error.code() {
        "size_required" => {
            "size_required: give the size of the longest side with --size, the unit with --unit, \
             or a factor with --scale"
        }
        _ => "the mesh is not usable",
    };
    Error::new(error).context(format!("{}: {options}", path.display()))
}

/// Options of the size and the up axis of a mesh.
#[derive(clap::Args, Clone, Copy)]
pub(crate) struct MeshSizeOptions {
    /// Unit of the mesh: m, cm, mm or in. Without it: metres for glTF, millimetres for STL, otherwise from the
    /// size of the mesh
    #[arg(long, value_name = "UNIT", value_parser = parse_unit)]
    unit: Option<Unit>,
    /// Length of the longest side of the mesh (m), or with a unit, such as 12cm
    #[arg(long, value_name = "LENGTH", value_parser = parse_length, conflicts_with_all = ["unit", "scale"])]
    size: Option<f32>,
    /// Factor on the coordinates of the mesh, in addition to its unit
    #[arg(long, value_name = "FACTOR")]
    scale: Option<f32>,
    /// Axis of the mesh file that points up: x, y or z
    #[arg(long, value_name = "AXIS", value_parser = parse_up)]
    up: Option<UpAxis>,
}

impl MeshSizeOptions {
    /// Whether an option is given.
    pub(crate) fn is_given(&self) -> bool {
        self.mesh_options() != MeshOptions::default()
    }

    /// Options of the mesh.
    pub(crate) fn mesh_options(&self) -> MeshOptions {
        self.import_options().mesh()
    }

    /// Options of the import, without mass and orientation.
    pub(crate) fn import_options(&self) -> ImportOptions {
        let Self { unit, size, scale, up } = *self;
        ImportOptions { unit, size, scale, up, ..ImportOptions::default() }
    }
}

fn parse_unit(text: &str) -> Result<Unit, String> {
    Unit::from_symbol(text).ok_or_else(|| "expected m, cm, mm or in".to_owned())
}

fn parse_up(text: &str) -> Result<UpAxis, String> {
    UpAxis::from_name(&text.to_ascii_lowercase()).ok_or_else(|| "expected x, y or z".to_owned())
}

/// Parses a length in metres, or in the unit that follows the number.
fn parse_length(text: &str) -> Result<f32, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match &text[digits.len()..] {
        "" => Some(Unit::Metre),
        symbol => Unit::from_symbol(symbol),
    };
    let number: Option<f32> = digits.trim().parse().ok();
    let length = number.zip(unit).map(|(number, unit)| number * unit.metres());
    length.filter(|length| length.is_finite() && *length > 0.0).ok_or_else(|| {
        "expected a positive length in metres, or with the unit m, cm, mm or in".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn length_is_in_metres_or_in_its_unit() {
        for (text, metres) in [("0.12", 0.12), ("12cm", 0.12), ("120mm", 0.12), ("3in", 0.0762)] {
            assert!((parse_length(text).unwrap() - metres).abs() < 1e-6, "{text}");
        }
        for text in ["", "-1", "nan", "12ft", "cm", "0"] {
            assert!(parse_length(text).is_err(), "{text}");
        }
    }

    #[test]
    fn only_mesh_of_a_folder_is_selected() {
        let names = |names: &[&str]| only_mesh(names.iter().map(|n| (*n).to_owned()).collect());
        let found =
            names(&["._box.stl", "a/.hidden.obj", "box.STL", "scene.bin", "__MACOSX/box.stl"]);
        assert_eq!(found.unwrap(), "box.STL");
        assert!(names(&["readme.txt"]).unwrap_err().to_string().contains("no mesh"));
        let error = names(&["b.obj", "a.obj"]).unwrap_err().to_string();
        assert!(error.contains("2 meshes (a.obj, b.obj, ...)"), "{error}");
    }

    #[test]
    fn file_outside_the_folder_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("mesh");
        std::fs::create_dir(&inside).unwrap();
        std::fs::write(folder.path().join("secret.bin"), "s").unwrap();
        std::fs::write(inside.join("Scene.bin"), "b").unwrap();
        assert_eq!(read_beside(&inside, "scene.BIN"), Some(b"b".to_vec()));
        let absolute = folder.path().join("secret.bin");
        for path in ["../secret.bin", absolute.to_str().unwrap(), "", ".", "missing.bin"] {
            assert_eq!(read_beside(&inside, path), None, "{path}");
        }
    }
}
