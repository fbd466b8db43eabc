//! Archives of a dataset, and errors of the episodes of a damaged one.

use crate::server::Server;
use serde_json::{Value, json};
use std::path::Path;

/// Downloads the dataset as an archive, deletes it, and imports it again.
pub(crate) fn assert_archive_restores_dataset(server: &Server, id: &str) {
    let url = format!("{}/api/v1/datasets", server.url);
    let before = server.get(&format!("/datasets/{id}"));
    let files = server.get(&format!("/datasets/{id}/files"));
    let archive = |_| {
        let mut response = ureq::get(format!("{url}/{id}/archive")).call().unwrap();
        response.body_mut().with_config().limit(1 << 30).read_to_vec().unwrap()
    };
    let [first, second] = [0, 1].map(archive);
    assert!(first == second, "the archive differs between requests");
    let mut damaged = first.clone();
    // A byte of a Parquet file, after its magic number.
    let start = damaged.windows(4).position(|bytes| bytes == b"PAR1").unwrap();
    damaged[start + 10] ^= 1;
    let agent = ureq::Agent::config_builder().http_status_as_error(false).build().new_agent();
    let mut rejected = agent.post(&url).send(&damaged[..]).unwrap();
    assert_eq!(rejected.status(), 422);
    let problem: Value = rejected.body_mut().read_json().unwrap();
    assert_eq!(problem["code"], "invalid_archive", "{problem}");
    assert!(problem["detail"].as_str().unwrap().contains("has changed"), "{problem}");
    assert_eq!(server.delete(&format!("/datasets/{id}")), 204);
    let mut imported = ureq::post(&url).send(&first[..]).unwrap();
    assert_eq!(imported.status(), 201);
    let imported: Value = imported.body_mut().read_json().unwrap();
    for member in ["id", "hash", "bytes", "config", "summary"] {
        assert_eq!(imported[member], before[member], "{member}");
    }
    assert_eq!(server.get(&format!("/datasets/{id}/files")), files);
    // Jobs can use it.
    let params = json!({ "dataset_id": id, "preset": "smoke" });
    server.post("/jobs?dry_run=true", &json!({ "kind": "encoder.train", "params": params }));
}

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
