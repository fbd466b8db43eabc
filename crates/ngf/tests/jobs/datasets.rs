//! Errors of the episodes of a damaged dataset.

use crate::server::Server;
use serde_json::json;
use std::path::Path;

/// Damages the dataset in `folder` step by step and checks the errors of its episodes.
pub(crate) fn assert_unreadable_episodes_are_reported(server: &Server, id: &str, folder: &Path) {
    let assert_problem = |path: &str, status: u16, code: &str, detail: &str| {
        let problem = server.get_problem(&format!("/datasets/{id}/episodes{path}"), status);
        assert_eq!(problem["code"], code, "{problem}");
        assert!(problem["detail"].as_str().unwrap().contains(detail), "{problem}");
    };
    assert_problem("/9999", 404, "episode_not_found", "has no episode 9999");
    std::fs::remove_file(folder.join("poses.parquet")).unwrap();
    assert_problem("", 500, "file_unreadable", "poses.parquet");
    let other = server.get(&format!("/datasets/{id}/episodes?object=%00"));
    assert_eq!(other["data"], json!([]));
    std::fs::remove_file(folder.join("manifest.json")).unwrap();
    for path in ["", "/0"] {
        assert_problem(path, 409, "incompatible_dataset", "is not a complete dataset");
    }
    std::fs::write(folder.join("config.json"), "{}").unwrap();
    assert_problem("", 409, "incompatible_dataset", "does not have format version");
}
