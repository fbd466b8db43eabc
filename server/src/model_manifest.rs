//! Manifest of a model in an archive: its files with sizes and hashes.

use crate::model::JOB_MODEL_PREFIX;
use policy::Model;
use policy::model::MODEL_FILES;
use robot::KinematicTree;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// File with the manifest.
pub(crate) const MODEL_MANIFEST_FILE: &str = "model.json";

/// Version of the manifest's format.
const FORMAT: u32 = 1;

/// Maximum number of files of a model, and maximum size of the manifest (bytes).
const MAX_FILES: usize = 64;
const MAX_MANIFEST_BYTES: u64 = 1 << 20;
/// Maximum size of a file of a model (bytes), which is loaded into memory.
const MAX_FILE_BYTES: u64 = 1 << 30;

/// Files without which an encoder cannot be used.
const ENCODER_FILES: [&str; 2] = ["encoder.safetensors", "latent.safetensors"];

/// Files and origin of a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ModelManifest {
    /// [`FORMAT`] of the server that created the archive.
    pub(crate) format: u32,
    /// `encoder` or `policy`.
    pub(crate) kind: String,
    /// Training step of a checkpoint; null for the final model.
    pub(crate) step: Option<u64>,
    /// Parameters of the training job; null for a built-in model.
    pub(crate) params: Value,
    /// Files by name.
    pub(crate) files: BTreeMap<String, ModelEntry>,
}

/// One file of a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ModelEntry {
    /// Length (bytes).
    pub(crate) bytes: u64,
    /// BLAKE3 (hex).
    pub(crate) blake3: String,
}

impl ModelManifest {
    /// Manifest of these files in the current format.
    pub(crate) fn new(
        kind: String,
        step: Option<u64>,
        params: Value,
        files: BTreeMap<String, ModelEntry>,
    ) -> Self {
        Self { format: FORMAT, kind, step, params, files }
    }

    /// Id of the model: a hash of its weight files.
    pub(crate) fn model_id(&self) -> String {
        model_id(self.files.iter().map(|(name, file)| (name.as_str(), file.blake3.as_str())))
    }

    /// Reads the manifest in a folder with these files, checks sizes and hashes, and loads the model. The error
    /// is a text for the sender of the archive.
    pub(crate) fn verify(root: &Path, paths: &BTreeSet<String>) -> Result<Self, String> {
        let length = std::fs::metadata(root.join(MODEL_MANIFEST_FILE)).map_err(of_file)?.len();
        if length > MAX_MANIFEST_BYTES {
            return Err(format!("{MODEL_MANIFEST_FILE} is longer than {MAX_MANIFEST_BYTES} bytes"));
        }
        let text = std::fs::read(root.join(MODEL_MANIFEST_FILE)).map_err(of_file)?;
        let manifest: Self = serde_json::from_slice(&text)
            .map_err(|error| format!("{MODEL_MANIFEST_FILE} is not a manifest: {error}"))?;
        if manifest.format != FORMAT {
            return Err(format!(
                "{MODEL_MANIFEST_FILE} has format {}, not {FORMAT}",
                manifest.format
            ));
        }
        if manifest.files.len() > MAX_FILES {
            return Err(format!("more than {MAX_FILES} files"));
        }
        let is_listed =
            |path: &&String| *path == MODEL_MANIFEST_FILE || manifest.files.contains_key(*path);
        if let Some(foreign) = paths.iter().find(|path| !is_listed(path)) {
            return Err(format!("{foreign} is not in {MODEL_MANIFEST_FILE}"));
        }
        for (name, file) in &manifest.files {
            if !paths.contains(name) || name.contains('/') {
                return Err(format!("{name} is missing"));
            }
            let mut hasher = blake3::Hasher::new();
            let opened = std::fs::File::open(root.join(name)).map_err(of_file)?;
            let hash = hasher.update_reader(opened).map_err(of_file)?.finalize();
            if hasher.count() != file.bytes || hash.to_hex().as_str() != file.blake3 {
                return Err(format!("{name} has hash {hash} instead of {}", file.blake3));
            }
            if file.bytes > MAX_FILE_BYTES {
                return Err(format!("{name} is longer than {MAX_FILE_BYTES} bytes"));
            }
        }
        manifest.load(root)?;
        Ok(manifest)
    }

    /// Loads the model, so that jobs and the demo can use it.
    fn load(&self, root: &Path) -> Result<(), String> {
        let read = |name: &str| std::fs::read(root.join(name)).map_err(|_| missing(name));
        match self.kind.as_str() {
            "policy" => {
                let [weights, starts, config] = MODEL_FILES.map(|(_, name)| read(name));
                let tree = KinematicTree::iiwa7_allegro().map_err(|error| error.to_string())?;
                Model::load(&weights?, &starts?, &config?, &tree)
                    .map_err(|error| format!("the policy cannot be loaded: {error}"))?;
            }
            "encoder" => {
                for name in ENCODER_FILES {
                    let bytes = read(name)?;
                    policy::weights::Tensors::parse(&bytes)
                        .map_err(|error| format!("{name} cannot be loaded: {error}"))?;
                }
            }
            other => return Err(format!("kind \"{other}\" is neither encoder nor policy")),
        }
        Ok(())
    }
}

/// Id of a model: a hash of the hashes of its weight files, in order of their names.
pub(crate) fn model_id<'a>(files: impl Iterator<Item = (&'a str, &'a str)>) -> String {
    let mut hasher = blake3::Hasher::new();
    for (_, hash) in files.filter(|(name, _)| name.ends_with(".safetensors")) {
        hasher.update(hash.as_bytes());
    }
    format!("{JOB_MODEL_PREFIX}{}", &hasher.finalize().to_hex()[..16])
}

fn of_file(error: std::io::Error) -> String {
    format!("a file cannot be read: {error}")
}

fn missing(name: &str) -> String {
    format!("{name} is missing")
}
