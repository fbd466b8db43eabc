//! What every route may read: where the files lie, and their hashes.

use crate::engine::Engine;
use crate::guard::Pace;
use crate::limits::Limits;
use crate::metrics::Metrics;
use axum::http::HeaderValue;
use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

/// Stands for the model that whoever operates the server chose.
pub(crate) const DEFAULT: &str = "default";

/// Folders to serve from; cheap to clone.
#[derive(Clone, Debug)]
pub struct AppState {
    /// The built page, with `index.html` in it.
    pub web: Arc<Path>,
    /// One folder per model.
    pub models: Arc<Path>,
    hashes: Arc<Mutex<HashMap<Vec<PathBuf>, Hashed>>>,
    /// What does jobs, if the server does any.
    pub(crate) engine: Option<Arc<Engine>>,
    /// BLAKE3 of the token that changes need, if they need one.
    token: Option<blake3::Hash>,
    /// Origins of pages, beside our own, that may ask for changes.
    pub(crate) origins: Arc<[HeaderValue]>,
    /// Id of the model that `default` stands for.
    default_model: Arc<str>,
    /// How much may be asked.
    pub(crate) limits: Limits,
    /// How often each address asked.
    pub(crate) pace: Arc<Pace>,
    /// What is counted.
    pub(crate) metrics: Arc<Metrics>,
    /// Whether the server is about to end.
    stopping: tokio::sync::watch::Receiver<bool>,
}

/// The hash of files, good for as long as their lengths and times of change stay.
#[derive(Clone, Debug)]
pub(crate) struct Hashed {
    pub(crate) bytes: u64,
    marks: Vec<(u64, SystemTime)>,
    pub(crate) blake3: blake3::Hash,
}

impl AppState {
    /// Serves the page from `web` and models from `models`; neither has to exist yet.
    pub fn new(web: &Path, models: &Path) -> Self {
        Self {
            web: web.into(),
            models: models.into(),
            hashes: Arc::default(),
            engine: None,
            token: None,
            origins: Arc::from([]),
            default_model: Arc::from(DEFAULT),
            limits: Limits::default(),
            pace: Arc::new(Pace::new(&Limits::default())),
            metrics: Arc::new(Metrics::new()),
            stopping: tokio::sync::watch::channel(false).1,
        }
    }

    /// Does jobs, too; streams end when `stopping` becomes true.
    pub fn with_engine(
        self,
        engine: Arc<Engine>,
        stopping: tokio::sync::watch::Receiver<bool>,
    ) -> Self {
        let metrics = engine.metrics.clone();
        Self { engine: Some(engine), stopping, metrics, ..self }
    }

    /// Pages of these origins (`https://example.org`) may use the API, too.
    pub fn with_origins(self, origins: impl IntoIterator<Item = HeaderValue>) -> Self {
        Self { origins: origins.into_iter().collect(), ..self }
    }

    /// `default` stands for this model: one that was there before, or one of a job.
    pub fn with_default_model(self, id: &str) -> Self {
        Self { default_model: id.into(), ..self }
    }

    /// Which model an id stands for.
    pub(crate) fn model_of<'a>(&'a self, id: &'a str) -> &'a str {
        if id == DEFAULT { &self.default_model } else { id }
    }

    /// With other limits than the standard ones.
    pub fn with_limits(self, limits: Limits) -> Self {
        Self { limits, pace: Arc::new(Pace::new(&limits)), ..self }
    }

    /// Changes need this token, too.
    pub fn with_token(self, token: &str) -> Self {
        Self { token: Some(blake3::hash(token.as_bytes())), ..self }
    }

    /// Whether changes need a token.
    pub(crate) fn has_token(&self) -> bool {
        self.token.is_some()
    }

    /// Whether a change may be asked for with this token. Hashes are compared in constant time.
    pub(crate) fn admits(&self, token: &str) -> bool {
        self.token.is_none_or(|known| known == blake3::hash(token.as_bytes()))
    }

    /// Becomes true when the server is about to end.
    pub(crate) fn stopping(&self) -> tokio::sync::watch::Receiver<bool> {
        self.stopping.clone()
    }

    /// Length and BLAKE3 of files one after another, computed once until one of them changes; `None` if one is not there.
    pub(crate) async fn hashed(&self, paths: Vec<PathBuf>) -> io::Result<Option<Hashed>> {
        let mut marks = Vec::new();
        for path in &paths {
            match tokio::fs::metadata(path).await {
                Ok(metadata) if metadata.is_file() => {
                    marks.push((metadata.len(), metadata.modified()?));
                }
                Ok(_) => return Ok(None),
                Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
                Err(error) => return Err(error),
            }
        }
        let known = self.hashes().get(&paths).cloned();
        if let Some(known) = known.filter(|known| known.marks == marks) {
            return Ok(Some(known));
        }
        // Piece by piece, on a thread of its own: models are long.
        let files = paths.clone();
        let hash = tokio::task::spawn_blocking(move || {
            let mut hasher = blake3::Hasher::new();
            for file in files {
                hasher.update_reader(std::fs::File::open(file)?)?;
            }
            io::Result::Ok(hasher.finalize())
        });
        let bytes = marks.iter().map(|(bytes, _)| bytes).sum();
        let hashed = Hashed { bytes, marks, blake3: hash.await?? };
        self.hashes().insert(paths, hashed.clone());
        Ok(Some(hashed))
    }

    /// A panic elsewhere cannot leave the map half written, so a poisoned lock is still good.
    fn hashes(&self) -> std::sync::MutexGuard<'_, HashMap<Vec<PathBuf>, Hashed>> {
        self.hashes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
