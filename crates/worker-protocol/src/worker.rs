//! Identity and configuration of a worker.

use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use utoipa::ToSchema;

/// Environment variable with the path of the worker configuration.
pub const WORKER_CONFIG_ENV: &str = "NGF_WORKER_CONFIG";

/// Configuration of a worker, read from the file that the variable [`WORKER_CONFIG_ENV`] names.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct WorkerConfig {
    /// URL for reports.
    pub reports_url: String,
    /// Bearer token, valid for this worker only.
    pub token: String,
    /// File that the worker locks while it runs; a second worker in the same folder waits.
    pub lock_file: PathBuf,
}

/// Worker process of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Worker {
    /// Host name.
    pub host: String,
    /// Process id on that host.
    pub pid: u32,
    /// Version of `ngf`.
    pub version: String,
    /// Hardware threads of the host.
    #[serde(default)]
    pub threads: usize,
}
