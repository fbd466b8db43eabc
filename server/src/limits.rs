//! How much may be asked of the server.

use crate::Problem;
use std::num::NonZeroU32;
use std::path::Path;

/// Bounds that whoever operates the server chooses.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Jobs that may wait at a time.
    pub queued: usize,
    /// Changes that one address may ask for in a second; a burst may be as many.
    pub changes_per_second: NonZeroU32,
    /// Bytes of all meshes that are kept.
    pub kept_mesh_bytes: u64,
    /// Bytes of the disk that stay free: no job and no mesh is taken below.
    pub free_bytes: u64,
}

impl Default for Limits {
    /// Enough for a group that shares a machine.
    fn default() -> Self {
        Self {
            queued: 1000,
            changes_per_second: NonZeroU32::new(50).unwrap_or(NonZeroU32::MIN),
            kept_mesh_bytes: 2_000_000_000,
            free_bytes: 1_000_000_000,
        }
    }
}

impl Limits {
    /// Refuses what would fill the disk of this folder.
    pub(crate) fn leave_space(&self, folder: &Path) -> Result<(), Problem> {
        match fs4::available_space(folder) {
            Ok(free) if free < self.free_bytes => Err(Problem::disk_full(free, self.free_bytes)),
            // A disk that cannot be asked is no reason to refuse.
            _ => Ok(()),
        }
    }
}
