//! The OpenAPI description matches the reviewed file.

use std::path::Path;

/// After an intended change, regenerate the file: `UPDATE_EXPECT=1 cargo test -p server openapi`.
#[test]
fn openapi_description_matches_the_reviewed_file() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("openapi.json");
    let current = server::openapi().to_pretty_json().expect("JSON") + "\n";
    if std::env::var_os("UPDATE_EXPECT").is_some() {
        std::fs::write(&path, &current).expect("a file");
    }
    let reviewed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        current == reviewed,
        "server/openapi.json differs from the code; after an intended change run: UPDATE_EXPECT=1 cargo test -p server openapi"
    );
}
