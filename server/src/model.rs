//! A model as a folder of files: `models/<id>/`.

use crate::{AppState, Code, Problem};
use axum::http::StatusCode;
use serde_json::{Map, Value, json};
use std::path::PathBuf;

/// A model that exists: its folder holds weights.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    pub(crate) id: String,
    folder: PathBuf,
}

/// The files of a model that are served, by their name in the URL.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ModelFile {
    pub(crate) name: &'static str,
    pub(crate) file_name: &'static str,
    pub(crate) content_type: &'static str,
}

pub(crate) const WEIGHTS: ModelFile = ModelFile {
    name: "weights",
    file_name: "weights.safetensors",
    content_type: "application/octet-stream",
};
const STARTS: ModelFile = ModelFile {
    name: "starts",
    file_name: "starts.safetensors",
    content_type: "application/octet-stream",
};
const CONFIG: ModelFile =
    ModelFile { name: "config", file_name: "config.json", content_type: "application/json" };

impl ModelFile {
    /// All of them.
    pub(crate) const ALL: [Self; 3] = [WEIGHTS, STARTS, CONFIG];

    /// The file with this name in the URL.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|file| file.name == name)
    }
}

/// How ids of models that jobs made begin.
pub(crate) const OF_JOB: &str = "mdl_";

/// An id is a folder's name of lower-case letters, digits and hyphens: nothing that could lead out
/// of the models folder.
pub(crate) fn is_id(text: &str) -> bool {
    let allowed = |c: u8| c.is_ascii_lowercase() || c.is_ascii_digit() || c == b'-';
    (1..=64).contains(&text.len()) && text.bytes().all(allowed)
}

impl Model {
    /// The model with this id, if its folder holds weights.
    pub(crate) async fn find(state: &AppState, id: &str) -> Result<Self, Problem> {
        let missing = Problem {
            status: StatusCode::NOT_FOUND,
            code: Code::ModelNotFound,
            detail: format!("there is no model \"{id}\""),
            hint: "GET /api/v1/models lists the models; `ngf train` makes one".into(),
            param: None,
        };
        if id.starts_with(OF_JOB) {
            return Err(missing);
        }
        if !is_id(id) {
            return Err(Problem {
                status: StatusCode::BAD_REQUEST,
                code: Code::InvalidModelId,
                detail: "a model id has 1 to 64 lower-case letters, digits and hyphens".into(),
                hint: "GET /api/v1/models lists the ids".into(),
                param: None,
            });
        }
        let folder = state.models.join(id);
        let has_weights = tokio::fs::metadata(folder.join(WEIGHTS.file_name)).await;
        match has_weights {
            Ok(metadata) if metadata.is_file() => Ok(Self { id: id.into(), folder }),
            _ => Err(missing),
        }
    }

    /// All models, by id.
    pub(crate) async fn all(state: &AppState) -> Result<Vec<Self>, Problem> {
        let mut folders = match tokio::fs::read_dir(&state.models).await {
            Ok(folders) => folders,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(Problem::unreadable(&error)),
        };
        let mut models = Vec::new();
        while let Some(entry) = folders.next_entry().await.map_err(|e| Problem::unreadable(&e))? {
            let name = entry.file_name();
            // Folders that are no models are not errors: drafts and notes may lie beside them.
            if let Ok(model) = Self::find(state, &name.to_string_lossy()).await {
                models.push(model);
            }
        }
        models.sort_by(|a, b| a.id.cmp(&b.id));
        Ok(models)
    }

    /// Where a file of this model lies, if it does.
    pub(crate) fn path(&self, file: ModelFile) -> PathBuf {
        self.folder.join(file.file_name)
    }

    /// The model as JSON: its files with hash and length, and the card that was written for it.
    pub(crate) async fn describe(&self, state: &AppState) -> Result<Value, Problem> {
        let mut files = Map::new();
        for file in ModelFile::ALL {
            let hashed =
                state.hashed(vec![self.path(file)]).await.map_err(|e| Problem::unreadable(&e))?;
            if let Some(hashed) = hashed {
                let blake3 = hashed.blake3.to_hex();
                let url = format!("/api/v1/models/{}/{}?blake3={blake3}", self.id, file.name);
                let entry = json!({ "url": url, "bytes": hashed.bytes, "blake3": blake3.as_str() });
                files.insert(file.name.into(), entry);
            }
        }
        // Weights are of use without their card, so a bad card is told and does no harm.
        let (card, problem) = match self.card().await {
            Ok(card) => (card, Value::Null),
            Err(problem) => (Value::Null, problem.detail.into()),
        };
        Ok(json!({
            "object": "model", "id": self.id, "files": files, "card": card, "card_error": problem,
        }))
    }

    /// Hash of all that acts, as evaluations name it; `None` where a file is missing.
    pub(crate) async fn hash(&self, state: &AppState) -> Result<Option<String>, Problem> {
        let files = ModelFile::ALL.map(|file| self.path(file)).to_vec();
        let hashed = state.hashed(files).await.map_err(|e| Problem::unreadable(&e))?;
        Ok(hashed.map(|hashed| hashed.blake3.to_hex().to_string()))
    }

    async fn card(&self) -> Result<Value, Problem> {
        let text = match tokio::fs::read(self.folder.join("card.json")).await {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Value::Null),
            Err(error) => return Err(Problem::unreadable(&error)),
        };
        serde_json::from_slice(&text).map_err(|error| Problem {
            status: StatusCode::INTERNAL_SERVER_ERROR,
            code: Code::CardInvalid,
            detail: format!("card.json of model \"{}\" is not JSON: {error}", self.id),
            hint: "delete it, then write it again with `ngf evaluate --card FILE`".into(),
            param: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_cannot_leave_the_models_folder() {
        for good in ["default", "ngf-pcd-2", "0"] {
            assert!(is_id(good), "{good}");
        }
        let long = "a".repeat(65);
        for bad in ["", ".", "..", "../x", "a/b", "a\\b", "A", "a b", "a\0", "\u{e4}", &long] {
            assert!(!is_id(bad), "{bad:?}");
        }
    }
}
