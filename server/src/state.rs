//! State shared by all routes: folders, configuration, and a cache of file hashes.

use crate::jobs::scheduler::JobScheduler;
use crate::metrics::Metrics;
use crate::middleware::access::Access;
use crate::middleware::auth::WriteRateLimiter;
use crate::quotas::{Quotas, SpaceReservations};
use crate::routes::MetricCache;
use axum::http::HeaderValue;
use std::collections::HashMap;
use std::io;
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

/// Alias of the model that the operator selected with `--default-model`.
pub(crate) const DEFAULT_MODEL_ID: &str = "default";

/// Configuration and shared state of the server; cheap to clone.
#[derive(Clone, Debug)]
pub struct AppState {
    /// Folder of the built page; contains `index.html`.
    pub web_dir: Arc<Path>,
    /// Folder of the built-in models, one subfolder per model.
    pub models_dir: Arc<Path>,
    hashes: Arc<Mutex<HashMap<Vec<PathBuf>, FileHash>>>,
    /// Job scheduler; `None` if jobs are disabled.
    pub(crate) scheduler: Option<Arc<JobScheduler>>,
    /// Token, host names and trusted proxies.
    pub(crate) access: Access,
    /// Foreign origins whose pages may send write requests.
    pub(crate) origins: Arc<[HeaderValue]>,
    /// Id of the model that the alias `default` resolves to.
    default_model: Arc<str>,
    /// Limits on jobs, uploads and disk space.
    pub(crate) quotas: Quotas,
    /// Rate limiter of write requests, per client address.
    pub(crate) write_rate: Arc<WriteRateLimiter>,
    /// Locks of mesh uploads and deletions.
    pub(crate) mesh_locks: Arc<MeshLocks>,
    /// Prometheus metrics.
    pub(crate) metrics: Arc<Metrics>,
    /// Metric tables of recently requested jobs.
    pub(crate) metric_cache: Arc<MetricCache>,
    /// Becomes true when the server shuts down.
    shutdown: tokio::sync::watch::Receiver<bool>,
}

/// Maximum number of concurrent inspections: a parsed mesh needs many times the memory of its file.
const MAX_INSPECTIONS: usize = 2;

/// Locks of mesh uploads and deletions.
#[derive(Debug)]
pub(crate) struct MeshLocks {
    /// Held while a mesh is added or deleted, so that its file and its record stay consistent.
    pub(crate) records: tokio::sync::Mutex<()>,
    /// Permits of [`MAX_INSPECTIONS`].
    pub(crate) inspections: Arc<tokio::sync::Semaphore>,
    /// Disk space reserved by uploads.
    pub(crate) reserved: SpaceReservations,
}

impl Default for MeshLocks {
    fn default() -> Self {
        let inspections = Arc::new(tokio::sync::Semaphore::new(MAX_INSPECTIONS));
        let reserved = SpaceReservations::default();
        Self { records: tokio::sync::Mutex::default(), inspections, reserved }
    }
}

/// Cached hash of files, valid while their lengths and modification times do not change.
#[derive(Clone, Debug)]
pub(crate) struct FileHash {
    /// Total length of the files (bytes).
    pub(crate) bytes: u64,
    /// Length (bytes) and modification time of each file.
    stamps: Vec<(u64, SystemTime)>,
    /// Hash of the content.
    pub(crate) blake3: blake3::Hash,
}

impl AppState {
    /// State without jobs that serves the page from `web` and models from `models`. The folders may be
    /// created later.
    pub fn new(web: &Path, models: &Path) -> Self {
        Self {
            web_dir: web.into(),
            models_dir: models.into(),
            hashes: Arc::default(),
            scheduler: None,
            access: Access::default(),
            origins: Arc::from([]),
            default_model: Arc::from(DEFAULT_MODEL_ID),
            quotas: Quotas::default(),
            write_rate: Arc::new(WriteRateLimiter::new(&Quotas::default())),
            mesh_locks: Arc::default(),
            metrics: Arc::new(Metrics::new()),
            metric_cache: Arc::default(),
            shutdown: tokio::sync::watch::channel(false).1,
        }
    }

    /// Enables jobs. Event streams end when `stopping` becomes true.
    pub fn with_scheduler(
        self,
        engine: Arc<JobScheduler>,
        stopping: tokio::sync::watch::Receiver<bool>,
    ) -> Self {
        let metrics = engine.metrics.clone();
        Self { scheduler: Some(engine), shutdown: stopping, metrics, ..self }
    }

    /// Allows pages of these origins (`https://example.org`) to use the API.
    pub fn with_origins(self, origins: impl IntoIterator<Item = HeaderValue>) -> Self {
        Self { origins: origins.into_iter().collect(), ..self }
    }

    /// Selects the model that the alias `default` resolves to: a built-in model or a model trained by a job.
    pub fn with_default_model(self, id: &str) -> Self {
        Self { default_model: id.into(), ..self }
    }

    /// Resolves the alias `default`; returns other ids unchanged.
    pub(crate) fn resolve_model_id<'a>(&'a self, id: &'a str) -> &'a str {
        if id == DEFAULT_MODEL_ID { &self.default_model } else { id }
    }

    /// Replaces the default quotas.
    pub fn with_quotas(self, limits: Quotas) -> Self {
        Self { quotas: limits, write_rate: Arc::new(WriteRateLimiter::new(&limits)), ..self }
    }

    /// Requires this token for write requests.
    pub fn with_token(mut self, token: &str) -> Self {
        self.access.set_token(token);
        self
    }

    /// Requires the token for read requests, too.
    pub fn with_token_for_reads(mut self) -> Self {
        self.access.set_reads_need_token();
        self
    }

    /// Host names under which clients may address the server, in addition to its addresses.
    pub fn with_host_names(mut self, names: Vec<String>) -> Self {
        self.access.set_host_names(names);
        self
    }

    /// Proxies whose `X-Forwarded-For` and `X-Forwarded-Proto` headers are used.
    pub fn with_trusted_proxies(mut self, addresses: Vec<IpAddr>) -> Self {
        self.access.set_trusted_proxies(addresses);
        self
    }

    /// Receiver of a value that becomes true when the server shuts down.
    pub(crate) fn shutdown_signal(&self) -> tokio::sync::watch::Receiver<bool> {
        self.shutdown.clone()
    }

    /// Length and BLAKE3 of a file; `None` if it does not exist.
    pub(crate) async fn file_hash(&self, path: PathBuf) -> io::Result<Option<FileHash>> {
        let hash_content = |paths: &[PathBuf]| {
            let mut hasher = blake3::Hasher::new();
            // Read in chunks: model files are large.
            for path in paths {
                hasher.update_reader(std::fs::File::open(path)?)?;
            }
            Ok(hasher.finalize())
        };
        self.cached_hash(vec![path], hash_content).await
    }

    /// Total length of the files, and the hash that `hash` computes on a blocking thread; `None` if a file
    /// does not exist. The result is cached until a file changes.
    pub(crate) async fn cached_hash(
        &self,
        paths: Vec<PathBuf>,
        hash: impl FnOnce(&[PathBuf]) -> io::Result<blake3::Hash> + Send + 'static,
    ) -> io::Result<Option<FileHash>> {
        let mut stamps = Vec::new();
        for path in &paths {
            match tokio::fs::metadata(path).await {
                Ok(metadata) if metadata.is_file() => {
                    stamps.push((metadata.len(), metadata.modified()?));
                }
                Ok(_) => return Ok(None),
                Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
                Err(error) => return Err(error),
            }
        }
        let known = self.hashes().get(&paths).cloned();
        if let Some(known) = known.filter(|known| known.stamps == stamps) {
            return Ok(Some(known));
        }
        let files = paths.clone();
        let hash = tokio::task::spawn_blocking(move || hash(&files));
        let bytes = stamps.iter().map(|(bytes, _)| bytes).sum();
        let hashed = FileHash { bytes, stamps, blake3: hash.await?? };
        self.hashes().insert(paths, hashed.clone());
        Ok(Some(hashed))
    }

    /// Locks the cache. A panic cannot leave the map half written, so a poisoned lock is used as is.
    fn hashes(&self) -> std::sync::MutexGuard<'_, HashMap<Vec<PathBuf>, FileHash>> {
        self.hashes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
