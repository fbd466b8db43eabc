//! ZIP archive with one mesh and the files to which it refers.

use crate::mesh_file::only_mesh;
use anyhow::{Result, bail};
use std::cell::RefCell;
use std::io::{Cursor, Read};
use zip::ZipArchive;
use zip::result::ZipError;

/// Archive in memory.
pub(crate) struct MeshArchive {
    archive: RefCell<ZipArchive<Cursor<Vec<u8>>>>,
    /// Names of the files, in the order of the archive; an unreadable name is empty.
    names: Vec<String>,
    /// Folder of the mesh in the archive: empty, or with a slash at its end.
    folder: String,
}

impl MeshArchive {
    /// Whether the bytes are a ZIP archive.
    pub(crate) fn is_archive(bytes: &[u8]) -> bool {
        bytes.starts_with(b"PK\x03\x04")
    }

    /// Opens an archive; returns it and the content of its only mesh.
    pub(crate) fn open(bytes: Vec<u8>) -> Result<(Self, Vec<u8>)> {
        let mut archive = ZipArchive::new(Cursor::new(bytes))?;
        let names: Vec<String> = archive
            .file_names()
            .map(|name| name.map(|name| name.replace('\\', "/")).unwrap_or_default())
            .collect();
        if let Some(format) = foreign_format(&names) {
            bail!("this is {format}; expected {}", mesh::format_list());
        }
        let mesh = only_mesh(names.clone())?;
        let index = names.iter().position(|name| *name == mesh).unwrap_or_default();
        let content = read_entry(&mut archive, index)?;
        let folder = mesh.rfind('/').map_or("", |slash| &mesh[..=slash]).to_owned();
        Ok((Self { archive: RefCell::new(archive), names, folder }, content))
    }

    /// Content of the file at a path relative to the mesh; names have no case, as in Windows.
    pub(crate) fn file(&self, path: &str) -> Option<Vec<u8>> {
        let wanted = format!("{}{path}", self.folder);
        let exact = self.names.iter().position(|name| *name == wanted);
        let any_case = || self.names.iter().position(|name| name.eq_ignore_ascii_case(&wanted));
        read_entry(&mut self.archive.borrow_mut(), exact.or_else(any_case)?).ok()
    }
}

/// Mesh format that is a ZIP archive itself and is not supported.
fn foreign_format(names: &[String]) -> Option<&'static str> {
    let has = |extension: &str| names.iter().any(|name| name.ends_with(extension));
    if names.iter().any(|name| name.eq_ignore_ascii_case("3D/3dmodel.model")) {
        return Some("a 3MF file");
    }
    (has(".usdc") || has(".usda")).then_some("a USDZ file")
}

/// Decompresses an entry; the size in the archive is not trusted.
fn read_entry(archive: &mut ZipArchive<Cursor<Vec<u8>>>, index: usize) -> Result<Vec<u8>> {
    let entry = match archive.by_index(index) {
        Err(ZipError::UnsupportedArchive(ZipError::PASSWORD_REQUIRED)) => {
            bail!("the archive is encrypted; unpack it first")
        }
        entry => entry?,
    };
    let mut content = Vec::new();
    entry.take(mesh::MAX_BYTES as u64 + 1).read_to_end(&mut content)?;
    Ok(content)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    fn archive(files: &[(&str, &str)], is_large: bool) -> Vec<u8> {
        let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, content) in files {
            let options = SimpleFileOptions::default().large_file(is_large);
            writer.start_file(*name, options).unwrap();
            writer.write_all(content.as_bytes()).unwrap();
        }
        writer.finish().unwrap().into_inner()
    }

    #[test]
    fn mesh_and_its_files_are_read_from_a_folder_of_the_archive() {
        let files = [
            ("license.txt", "CC"),
            ("a/scene.gltf", "json"),
            ("a/Data/my mesh.bin", "buffer"),
            ("a/._scene.gltf", "mac"),
        ];
        for is_large in [false, true] {
            let (archive, mesh) = MeshArchive::open(archive(&files, is_large)).unwrap();
            assert_eq!(mesh, b"json");
            assert_eq!(archive.file("data/my mesh.bin"), Some(b"buffer".to_vec()));
            assert_eq!(archive.file("license.txt"), None);
        }
    }

    #[test]
    fn mesh_format_in_an_archive_is_named() {
        for (name, format) in [
            ("3D/3dmodel.model", "this is a 3MF file; expected OBJ"),
            ("cup.usdc", "this is a USDZ file; expected OBJ"),
            ("readme.txt", "it contains no mesh"),
        ] {
            let error = MeshArchive::open(archive(&[(name, "x")], false)).err().unwrap();
            assert!(error.to_string().contains(format), "{error}");
        }
    }

    #[test]
    fn encrypted_or_damaged_archive_is_named() {
        let mut bytes = archive(&[("box.stl", "solid")], false);
        // Bit 0 of the flags, in the local header and in the directory.
        bytes[6] |= 1;
        let entry = bytes.windows(4).position(|window| window == b"PK\x01\x02").unwrap();
        bytes[entry + 8] |= 1;
        let error = MeshArchive::open(bytes.clone()).err().unwrap().to_string();
        assert!(error.contains("is encrypted"), "{error}");
        bytes.truncate(40);
        assert!(MeshArchive::open(bytes).is_err());
    }
}
