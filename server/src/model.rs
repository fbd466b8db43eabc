//! Built-in models: one folder of files per model, `models/<id>/`.

use crate::{AppState, Problem, ProblemCode};
use axum::http::StatusCode;
use policy::model::{CONFIG_FILE, ModelConfig, STARTS_FILE, WEIGHTS_FILE};
use serde_json::{Map, Value, json};
use std::path::PathBuf;

/// An existing built-in model; its folder contains weights.
#[derive(Clone, Debug)]
pub(crate) struct BuiltInModel {
    pub(crate) id: String,
    folder: PathBuf,
}

/// A file of a model that the server offers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ModelFile {
    /// Name in URLs and JSON.
    pub(crate) name: &'static str,
    /// Name on disk.
    pub(crate) file_name: &'static str,
    /// Media type of the response.
    pub(crate) content_type: &'static str,
}

pub(crate) const WEIGHTS: ModelFile = ModelFile {
    name: "weights",
    file_name: WEIGHTS_FILE,
    content_type: "application/octet-stream",
};
const START_CONFIGURATIONS: ModelFile = ModelFile {
    name: "start_configurations",
    file_name: STARTS_FILE,
    content_type: "application/octet-stream",
};
const CONFIG: ModelFile =
    ModelFile { name: "config", file_name: CONFIG_FILE, content_type: "application/json" };

impl ModelFile {
    /// All files that a policy consists of, weights first.
    pub(crate) const ALL: [Self; 3] = [WEIGHTS, START_CONFIGURATIONS, CONFIG];

    /// The file with this name in URLs.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|file| file.name == name)
    }
}

/// Prefix of the ids of models trained by jobs.
pub(crate) const JOB_MODEL_PREFIX: &str = "mdl_";

/// Whether a text is a valid id of a built-in model: 1 to 64 lower-case letters, digits and hyphens. Such an
/// id cannot escape the models folder.
pub(crate) fn is_valid_id(text: &str) -> bool {
    let allowed = |c: u8| c.is_ascii_lowercase() || c.is_ascii_digit() || c == b'-';
    (1..=64).contains(&text.len()) && text.bytes().all(allowed)
}

impl BuiltInModel {
    /// Finds the model with this id; its folder must contain weights.
    pub(crate) async fn find(state: &AppState, id: &str) -> Result<Self, Problem> {
        let missing = Problem {
            status: StatusCode::NOT_FOUND,
            code: ProblemCode::ModelNotFound,
            detail: format!("model \"{id}\" not found"),
            hint: "GET /api/v1/models lists the models; `ngf train` creates one".into(),
            param: None,
        };
        if id.starts_with(JOB_MODEL_PREFIX) {
            return Err(missing);
        }
        if !is_valid_id(id) {
            return Err(Problem {
                status: StatusCode::BAD_REQUEST,
                code: ProblemCode::InvalidModelId,
                detail: "a model id consists of 1 to 64 lower-case letters, digits and hyphens"
                    .into(),
                hint: "GET /api/v1/models lists the ids".into(),
                param: None,
            });
        }
        let folder = state.models_dir.join(id);
        let has_weights = tokio::fs::metadata(folder.join(WEIGHTS.file_name)).await;
        match has_weights {
            Ok(metadata) if metadata.is_file() => Ok(Self { id: id.into(), folder }),
            _ => Err(missing),
        }
    }

    /// All built-in models, sorted by id.
    pub(crate) async fn all(state: &AppState) -> Result<Vec<Self>, Problem> {
        let mut folders = match tokio::fs::read_dir(&state.models_dir).await {
            Ok(folders) => folders,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(Problem::file_unreadable(&error)),
        };
        let mut models = Vec::new();
        while let Some(entry) =
            folders.next_entry().await.map_err(|e| Problem::file_unreadable(&e))?
        {
            let name = entry.file_name();
            // Other folders, such as drafts, are skipped.
            if let Ok(model) = Self::find(state, &name.to_string_lossy()).await {
                models.push(model);
            }
        }
        models.sort_by(|a, b| a.id.cmp(&b.id));
        Ok(models)
    }

    /// Path of a file of this model; the file may be missing.
    pub(crate) fn path(&self, file: ModelFile) -> PathBuf {
        self.folder.join(file.file_name)
    }

    /// JSON of the model: its files with hash and length, and its card.
    pub(crate) async fn describe(&self, state: &AppState) -> Result<Value, Problem> {
        let mut files = Map::new();
        for file in ModelFile::ALL {
            let hashed =
                state.file_hash(self.path(file)).await.map_err(|e| Problem::file_unreadable(&e))?;
            if let Some(hashed) = hashed {
                let blake3 = hashed.blake3.to_hex();
                let url = format!("/api/v1/models/{}/{}?blake3={blake3}", self.id, file.name);
                let entry = json!({ "url": url, "bytes": hashed.bytes, "blake3": blake3.as_str() });
                files.insert(file.name.into(), entry);
            }
        }
        // An invalid card is reported, but the model stays usable.
        let (card, card_error) = match self.card().await {
            Ok(card) => (card, Value::Null),
            Err(problem) => (Value::Null, problem.detail.into()),
        };
        Ok(json!({
            "object": "model", "id": self.id, "files": files, "card": card, "card_error": card_error,
        }))
    }

    /// Hash of all files of the policy, equal to `model_hash` of evaluations; `None` if a file is
    /// missing or the configuration is invalid.
    pub(crate) async fn hash(&self, state: &AppState) -> Result<Option<String>, Problem> {
        let files = ModelFile::ALL.map(|file| self.path(file)).to_vec();
        let hashed = match state.cached_hash(files, hash_model).await {
            Ok(hashed) => hashed,
            Err(error) if error.kind() == std::io::ErrorKind::InvalidData => None,
            Err(error) => return Err(Problem::file_unreadable(&error)),
        };
        Ok(hashed.map(|hashed| hashed.blake3.to_hex().to_string()))
    }

    async fn card(&self) -> Result<Value, Problem> {
        let text = match tokio::fs::read(self.folder.join("card.json")).await {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Value::Null),
            Err(error) => return Err(Problem::file_unreadable(&error)),
        };
        serde_json::from_slice(&text).map_err(|error| Problem {
            status: StatusCode::INTERNAL_SERVER_ERROR,
            code: ProblemCode::InvalidCard,
            detail: format!("card.json of model \"{}\" is not JSON: {error}", self.id),
            hint: "delete the file and recreate it with `ngf evaluate --card FILE`".into(),
            param: None,
        })
    }
}

/// Hash of weights, start configurations and the values of the configuration, in this order.
fn hash_model(files: &[PathBuf]) -> std::io::Result<blake3::Hash> {
    let mut hasher = blake3::Hasher::new();
    if let [content @ .., config] = files {
        for file in content {
            hasher.update_reader(std::fs::File::open(file)?)?;
        }
        let config = ModelConfig::parse(&std::fs::read(config)?)
            .map_err(|error| std::io::Error::new(std::io::ErrorKind::InvalidData, error))?;
        hasher.update(&config.canonical_bytes());
    }
    Ok(hasher.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn model_id_cannot_escape_the_models_folder() {
        for good in ["default", "ngf-pcd-2", "0"] {
            assert!(is_valid_id(good), "{good}");
        }
        let long = "a".repeat(65);
        for bad in ["", ".", "..", "../x", "a/b", "a\\b", "A", "a b", "a\0", "\u{e4}", &long] {
            assert!(!is_valid_id(bad), "{bad:?}");
        }
    }
}
