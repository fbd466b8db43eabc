//! Limit of open files, and the number of connections that it permits.

/// Limit of open files that is requested if the hard limit permits it.
#[cfg(unix)]
const OPEN_FILES: u64 = 65_536;

/// Number of connections without a limit of open files.
const MAX_CONNECTIONS: usize = 50_000;

/// Minimum number of open files for the database, worker processes and downloads.
const MIN_OTHER_FILES: usize = 64;

/// Number of connections that a limit of open files permits: three quarters, the others are for files.
fn max_connections(open_files: usize) -> usize {
    let others = (open_files / 4).max(MIN_OTHER_FILES);
    open_files.saturating_sub(others).min(MAX_CONNECTIONS)
}

/// Raises the limit of open files and returns the number of connections that it permits. Shells and systemd set a
/// soft limit of 1024 by default.
#[cfg(unix)]
pub(crate) fn raise_limit() -> usize {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    let wanted = limit.maximum.map_or(OPEN_FILES, |maximum| maximum.min(OPEN_FILES));
    let mut current = limit.current;
    if current.is_some_and(|current| current < wanted) {
        let raised = Rlimit { current: Some(wanted), maximum: limit.maximum };
        // Without permission, the lower limit applies.
        if setrlimit(Resource::Nofile, raised).is_ok() {
            current = Some(wanted);
        }
    }
    current.map_or(MAX_CONNECTIONS, |current| {
        max_connections(usize::try_from(current).unwrap_or(usize::MAX))
    })
}

/// Number of connections.
#[cfg(not(unix))]
pub(crate) fn raise_limit() -> usize {
    MAX_CONNECTIONS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_leave_open_files_for_the_database_and_downloads() {
        assert_eq!(max_connections(256), 192);
        assert_eq!(max_connections(1024), 768);
        assert_eq!(max_connections(65_536), 49_152);
        assert_eq!(max_connections(50), 0);
        assert_eq!(max_connections(usize::MAX), MAX_CONNECTIONS);
    }
}
