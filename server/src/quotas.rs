//! Quotas: limits on queued jobs, write requests, uploads and disk usage.

use crate::Problem;
use std::num::NonZeroU32;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

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

/// Free disk space without which the database cannot record a job and its end (bytes).
const MIN_DATABASE_BYTES: u64 = 1 << 20;

impl Quotas {
    /// Rejects a request if the disk of this folder has less free space than [`Quotas::min_free_bytes`], or too
    /// little for the database.
    pub(crate) fn ensure_free_space(&self, folder: &Path) -> Result<(), Problem> {
        self.ensure_free_space_for(folder, 0)
    }

    /// Rejects a request if too little space would remain free after writing `bytes`.
    pub(crate) fn ensure_free_space_for(&self, folder: &Path, bytes: u64) -> Result<(), Problem> {
        let min = self.min_free_bytes.max(MIN_DATABASE_BYTES);
        match free_space(folder) {
            Some(free) if free < min.saturating_add(bytes) => Err(Problem::disk_full(free, min)),
            // Unknown free space does not block requests.
            _ => Ok(()),
        }
    }
}

/// Disk space reserved by all uploads (bytes).
#[derive(Clone, Debug, Default)]
pub(crate) struct SpaceReservations(Arc<AtomicU64>);

/// Reservation of one upload; released when dropped.
#[derive(Debug)]
pub(crate) struct ReservedSpace {
    bytes: u64,
    all: SpaceReservations,
}

impl SpaceReservations {
    /// Reserves space for an upload.
    pub(crate) fn reserve(&self, bytes: u64) -> ReservedSpace {
        self.0.fetch_add(bytes, Ordering::SeqCst);
        ReservedSpace { bytes, all: self.clone() }
    }
}

impl ReservedSpace {
    /// Space reserved by all uploads, including this one (bytes).
    pub(crate) fn total(&self) -> u64 {
        self.all.0.load(Ordering::SeqCst)
    }
}

impl Drop for ReservedSpace {
    fn drop(&mut self) {
        self.all.0.fetch_sub(self.bytes, Ordering::SeqCst);
    }
}

/// Whether the disk of this folder has space for the database.
pub(crate) fn has_database_space(folder: &Path) -> bool {
    free_space(folder).is_none_or(|free| free >= MIN_DATABASE_BYTES)
}

/// Free space of the disk of a folder (bytes); `None` if it is unknown. Some network file systems report a size
/// of 0.
fn free_space(folder: &Path) -> Option<u64> {
    let stats = fs4::statvfs(folder).ok()?;
    (stats.total_space() > 0).then(|| stats.available_space())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn concurrent_uploads_are_counted_against_the_free_space() {
        let folder = tempfile::tempdir().unwrap();
        let free = free_space(folder.path()).unwrap();
        let quotas = Quotas { min_free_bytes: free / 2, ..Quotas::default() };
        let reservations = SpaceReservations::default();
        let fits = |upload: &ReservedSpace| {
            quotas.ensure_free_space_for(folder.path(), upload.total()).is_ok()
        };
        let first = reservations.reserve(free / 4);
        assert!(fits(&first));
        let second = reservations.reserve(free / 3);
        assert!(!fits(&second));
        drop(first);
        assert!(fits(&second));
    }
}
