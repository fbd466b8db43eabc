//! Files that are there as a whole or not at all, and tensors in them.

use anyhow::{Context, Result, ensure};
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// Writes beside the target and renames, so that a killed process leaves the old file or the new one.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    write_with(path, |file| Ok(std::fs::write(file, bytes)?))
}

/// The same for a file that `make` writes.
pub fn write_with<T>(path: &Path, make: impl FnOnce(&Path) -> Result<T>) -> Result<T> {
    let folder = path.parent().context("a file needs a folder")?;
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let beside = path.with_extension(format!("{PART}{}", std::process::id()));
    let written = make(&beside).and_then(|made| {
        // Else a power cut could leave an empty file under the final name.
        std::fs::File::open(&beside)?.sync_all()?;
        std::fs::rename(&beside, path)?;
        Ok(made)
    });
    written.map_err(|error| {
        // What is half written helps nobody, least of all where the disk is full.
        std::fs::remove_file(&beside).ok();
        error.context(format!("cannot write {}", path.display()))
    })
}

/// Files with this ending are half written.
const PART: &str = "part-";

/// Whether a file was being written when its writer was killed.
pub fn is_half_written(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().into_owned());
    ending.is_some_and(|ending| ending.starts_with(PART))
}

/// The bytes of a file, or an error that names it.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}

/// A named tensor: name, shape, values.
pub type Named<'a> = (&'a str, Vec<usize>, &'a [f32]);

/// Bytes of a set of f32 tensors, and a line of text about them.
pub fn encode(tensors: &[Named], about: Option<String>) -> Result<Vec<u8>> {
    let data: Vec<Vec<u8>> =
        tensors.iter().map(|(_, _, x)| x.iter().flat_map(|x| x.to_le_bytes()).collect()).collect();
    let views = tensors
        .iter()
        .zip(&data)
        .map(|((name, shape, _), bytes)| {
            Ok(((*name).to_owned(), TensorView::new(Dtype::F32, shape.clone(), bytes)?))
        })
        .collect::<Result<BTreeMap<_, _>>>()?;
    let about = about.map(|text| HashMap::from([("about".to_owned(), text)]));
    Ok(safetensors::serialize(views, about)?)
}

/// Values of an f32 tensor.
pub fn values(tensors: &SafeTensors, name: &str) -> Result<Vec<f32>> {
    let tensor = tensors.tensor(name).with_context(|| format!("there is no tensor {name}"))?;
    ensure!(tensor.dtype() == Dtype::F32, "{name} holds {:?} instead of F32", tensor.dtype());
    let bytes = tensor.data();
    Ok(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tensors_come_back_as_they_were() {
        let pair: [Named; 2] = [("a", vec![2, 1], &[0.5, -1.0]), ("b", vec![0], &[])];
        let bytes = encode(&pair, Some("line".into())).unwrap();
        let tensors = SafeTensors::deserialize(&bytes).unwrap();
        assert_eq!(values(&tensors, "a").unwrap(), [0.5, -1.0]);
        assert!(values(&tensors, "c").unwrap_err().to_string().contains("no tensor c"));
        assert!(SafeTensors::deserialize(&bytes[..bytes.len() - 3]).is_err());
    }

    #[test]
    fn a_file_that_cannot_be_made_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b.json");
        write(&path, b"old").unwrap();
        let failed = write_with(&path, |file| {
            std::fs::write(file, b"half")?;
            anyhow::bail!("the disk is full")
        });
        let failed: Result<()> = failed;
        assert!(format!("{:#}", failed.unwrap_err()).contains("b.json: the disk is full"));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(path.parent().unwrap().read_dir().unwrap().count(), 1);
    }
}
