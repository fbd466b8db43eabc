//! The token of the server, and warnings about files that other users can read.

use anyhow::{Context, bail};
use std::net::IpAddr;
use std::path::Path;

/// Minimum number of characters of a token.
const MIN_TOKEN_LEN: usize = 16;

/// Reads the bearer token; required unless the server listens on a loopback address.
pub(crate) fn read(file: Option<&Path>, bind: IpAddr) -> anyhow::Result<Option<String>> {
    let Some(path) = file else {
        if !bind.is_loopback() {
            bail!(
                "any host that reaches {bind} could start jobs; pass a token with --token-file FILE, or listen on 127.0.0.1"
            );
        }
        return Ok(None);
    };
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the token in {}", path.display()))?;
    let token = text.trim().to_owned();
    if token.len() < MIN_TOKEN_LEN {
        bail!("the token in {} has fewer than {MIN_TOKEN_LEN} characters", path.display());
    }
    warn_if_readable(path, "token file", "the token");
    Ok(Some(token))
}

/// Logs a warning if all users can read a file, or enter a folder.
pub(crate) fn warn_if_readable(path: &Path, name: &str, content: &str) {
    if is_readable_by_all(path) {
        let path = path.display();
        tracing::warn!(
            "every user of this machine can read {content}: the {name} {path} has the permissions of others; \
             run chmod o-rwx {path}"
        );
    }
}

/// Whether users other than the owner and its group have access.
#[cfg(unix)]
fn is_readable_by_all(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    std::fs::metadata(path).is_ok_and(|metadata| metadata.permissions().mode() & 0o007 != 0)
}

/// Whether users other than the owner and its group have access; unknown on this system.
#[cfg(not(unix))]
fn is_readable_by_all(_: &Path) -> bool {
    false
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn file_with_permissions_of_others_is_readable_by_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        std::fs::write(&path, "0123456789abcdef").unwrap();
        for (mode, expected) in [(0o600, false), (0o640, false), (0o644, true), (0o601, true)] {
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
            assert_eq!(is_readable_by_all(&path), expected, "{mode:o}");
        }
    }

    #[test]
    fn token_is_required_beyond_the_loopback_address() {
        let [loopback, any]: [IpAddr; 2] =
            ["127.0.0.1", "0.0.0.0"].map(|text| text.parse().unwrap());
        assert_eq!(read(None, loopback).unwrap(), None);
        assert!(read(None, any).unwrap_err().to_string().contains("--token-file"));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        std::fs::write(&path, "0123456789abcde\n").unwrap();
        assert!(read(Some(&path), any).unwrap_err().to_string().contains("fewer than 16"));
        std::fs::write(&path, "0123456789abcdef\n").unwrap();
        assert_eq!(read(Some(&path), any).unwrap().as_deref(), Some("0123456789abcdef"));
    }
}
