//! Quotas: limits on queued jobs, write requests, uploads and disk usage.

use crate::Problem;
use std::num::NonZeroU32;
use std::path::Path;

/// Limits set by the operator of the server.
#[derive(Clone, Copy, Debug)]
pub struct Quotas {
    /// Maximum number of queued jobs.
    pub max_queued: usize,
    /// Maximum rate of write requests per client address (1/s); also the maximum burst.
    pub max_writes_per_second: NonZeroU32,
    /// Maximum total size of all stored meshes (bytes).
    pub max_total_mesh_bytes: u64,
    /// Disk space that stays free (bytes): below it, jobs and uploads are rejected.
    pub min_free_bytes: u64,
}

impl Default for Quotas {
    /// Sized for a group that shares one machine.
    fn default() -> Self {
        Self {
            max_queued: 1000,
            max_writes_per_second: NonZeroU32::new(50).unwrap_or(NonZeroU32::MIN),
            max_total_mesh_bytes: 2_000_000_000,
            min_free_bytes: 1_000_000_000,
        }
    }
}

impl Quotas {
    /// Rejects a request if the disk of this folder has less free space than [`Quotas::min_free_bytes`].
    pub(crate) fn ensure_free_space(&self, folder: &Path) -> Result<(), Problem> {
        match fs4::available_space(folder) {
            Ok(free) if free < self.min_free_bytes => {
                Err(Problem::disk_full(free, self.min_free_bytes))
            }
            // Unknown free space does not block requests.
            _ => Ok(()),
        }
    }
}
