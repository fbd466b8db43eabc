//! The description of all requests is the one that was reviewed.

use std::path::Path;

/// After a change that is meant, write it anew: `NGF_WRITE=1 cargo test -p server openapi`.
#[test]
fn the_description_is_the_one_that_was_reviewed() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("openapi.json");
    let now = server::openapi().to_pretty_json().expect("JSON") + "\n";
    if std::env::var_os("NGF_WRITE").is_some() {
        std::fs::write(&path, &now).expect("a file");
    }
    let before = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        now == before,
        "server/openapi.json is not what the code says; if it should: NGF_WRITE=1 cargo test -p server openapi"
    );
}
