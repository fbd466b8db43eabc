//! Archives of datasets and models: files, download, import.

use crate::{assert_problem, json_of, send, send_with, state_with_scheduler, test_app};
use axum::Router;
use axum::http::StatusCode;
use axum::response::Response;
use http_body_util::BodyExt;
use serde_json::{Value, json};
use server::app;
use std::path::Path;
use tempfile::TempDir;

async fn bytes(response: Response) -> Vec<u8> {
    assert!(response.status().is_success(), "{}", response.status());
    response.into_body().collect().await.unwrap().to_bytes().to_vec()
}

/// Tar archive of files by path.
fn tar_of(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut builder = tar::Builder::new(Vec::new());
    for (path, contents) in files {
        let mut header = tar::Header::new_ustar();
        header.set_size(contents.len() as u64);
        builder.append_data(&mut header, path, *contents).unwrap();
    }
    builder.into_inner().unwrap()
}

/// Paths and contents of an archive.
fn untar(archive: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut reader = tar::Archive::new(archive);
    let entries = reader.entries().unwrap().map(|entry| {
        let mut entry = entry.unwrap();
        let mut contents = Vec::new();
        std::io::Read::read_to_end(&mut entry, &mut contents).unwrap();
        (entry.path().unwrap().to_string_lossy().into_owned(), contents)
    });
    entries.collect()
}

/// Number of files in the folder of unfinished uploads.
fn num_uploads(folder: &TempDir) -> usize {
    folder.path().join("data/uploads").read_dir().unwrap().count()
}

/// A server with a copy of a built-in model.
async fn app_with_model() -> (Router, TempDir) {
    let (app, folder) = test_app().await;
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default");
    let copy = folder.path().join("models/default");
    std::fs::create_dir_all(&copy).unwrap();
    for name in ["weights.safetensors", "start_configurations.safetensors", "config.json"] {
        std::fs::copy(model.join(name), copy.join(name)).unwrap();
    }
    (app, folder)
}

#[tokio::test]
async fn model_archive_is_imported_as_the_same_model() {
    let (app, folder) = app_with_model().await;
    let archive = bytes(send(&app, "GET", "/models/default/archive", "").await).await;
    let again = bytes(send(&app, "GET", "/models/default/archive", "").await).await;
    assert!(archive == again, "the archive differs between requests");
    let part = send_with(&app, "GET", "/models/default/archive", "", &[("range", "bytes=300-999")]);
    assert_eq!(bytes(part.await).await, archive[300..1000]);

    let created = send(&app, "POST", "/models", archive.clone()).await;
    assert_eq!(created.status(), StatusCode::CREATED);
    let location = created.headers()["location"].to_str().unwrap().to_owned();
    let model = json_of(created).await;
    let id = model["id"].as_str().unwrap().to_owned();
    assert_eq!(location, format!("/api/v1/models/{id}"));
    assert_eq!((&model["kind"], &model["job"]), (&json!("policy"), &Value::Null), "{model}");
    let original = json_of(send(&app, "GET", "/models/default", "").await).await;
    for name in ["weights", "start_configurations", "config"] {
        assert_eq!(model["files"][name]["blake3"], original["files"][name]["blake3"], "{name}");
    }
    let repeated = send(&app, "POST", "/models", archive).await;
    assert_eq!(repeated.status(), StatusCode::OK);
    assert_eq!(json_of(repeated).await, model);

    // The archive of the import has the same files and can be imported again.
    let second = bytes(send(&app, "GET", &format!("/models/{id}/archive"), "").await).await;
    let deleted = send(&app, "DELETE", &format!("/models/{id}"), "").await;
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
    let config = model["files"]["config"]["blake3"].as_str().unwrap();
    let file = send(&app, "GET", &format!("/artifacts/{config}"), "").await;
    assert_eq!(file.status(), StatusCode::NOT_FOUND);
    let restored = send(&app, "POST", "/models", second).await;
    assert_eq!(restored.status(), StatusCode::CREATED);
    assert_eq!(json_of(restored).await["id"], id);
    assert_eq!(num_uploads(&folder), 0);
}

#[tokio::test]
async fn model_archive_is_rejected_when_its_files_do_not_match() {
    let (app, folder) = app_with_model().await;
    let archive = bytes(send(&app, "GET", "/models/default/archive", "").await).await;
    let files = untar(&archive);
    let import = async |files: &[(String, Vec<u8>)], reason: &str| {
        let files: Vec<(&str, &[u8])> =
            files.iter().map(|(path, contents)| (path.as_str(), contents.as_slice())).collect();
        let problem = send(&app, "POST", "/models", tar_of(&files)).await;
        let problem = assert_problem(problem, 422, "invalid_archive").await;
        let detail = problem["detail"].as_str().unwrap();
        assert!(detail.contains(reason), "{detail} has no {reason:?}");
    };
    assert_eq!(files[0].0, "default/model.json");
    let mut damaged = files.clone();
    damaged[1].1[0] ^= 1;
    import(&damaged, "has hash").await;
    import(&files[..3], "is missing").await;
    import(&files[1..], "no model.json at its root").await;
    let foreign = [files.clone(), vec![("default/more".to_owned(), vec![])]].concat();
    import(&foreign, "more is not in model.json").await;
    // The hash matches, but the file is not a policy.
    let text = String::from_utf8(files[0].1.clone()).unwrap();
    let mut manifest: Value = serde_json::from_str(&text).unwrap();
    manifest["files"]["config.json"] =
        json!({ "bytes": 2, "blake3": blake3::hash(b"{}").to_hex().as_str() });
    let mut forged = files.clone();
    forged[0].1 = manifest.to_string().into_bytes();
    let config = forged.iter_mut().find(|(path, _)| path.ends_with("config.json")).unwrap();
    config.1 = b"{}".to_vec();
    import(&forged, "cannot be loaded").await;
    assert_eq!(num_uploads(&folder), 0);
}

/// A server whose worker command verifies datasets with this shell script.
#[cfg(unix)]
async fn app_with_verifier(script: &str) -> (Router, TempDir) {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("worker");
    std::fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    let (state, _) = state_with_scheduler(folder.path(), program, 0).await;
    (app(state), folder)
}

/// Files of a dataset with one data file.
#[cfg(unix)]
fn dataset() -> Vec<(String, Vec<u8>)> {
    use dataset_manifest::{FileEntry, Manifest, Provenance};
    let config = configs::DatasetConfig::preset("smoke", 0).unwrap();
    let provenance =
        Provenance { config, scene: String::new(), objects: std::collections::BTreeMap::new() };
    let files = [
        ("config.json".to_owned(), serde_json::to_vec(&provenance).unwrap()),
        ("meta/info.json".to_owned(), b"{\"fps\": 30}".to_vec()),
        ("summary.json".to_owned(), b"{}".to_vec()),
    ];
    let entry = |(path, contents): &(String, Vec<u8>)| FileEntry {
        path: path.clone(),
        bytes: contents.len() as u64,
        blake3: blake3::hash(contents).to_hex().to_string(),
    };
    let manifest = Manifest {
        generator: "test".into(),
        provenance,
        files: files.iter().map(entry).collect(),
        hash: "ab".repeat(32),
    };
    let manifest = ("manifest.json".to_owned(), serde_json::to_vec(&manifest).unwrap());
    std::iter::once(manifest).chain(files).collect()
}

#[cfg(unix)]
fn tar_of_owned(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let files: Vec<(&str, &[u8])> = files.iter().map(|(p, c)| (p.as_str(), c.as_slice())).collect();
    tar_of(&files)
}

#[cfg(unix)]
#[tokio::test]
async fn imported_dataset_is_served_file_by_file_and_as_archive() {
    let (app, folder) =
        app_with_verifier("test \"$1 $2\" = 'dataset verify' && test -f \"$3/config.json\"").await;
    let mut files = dataset();
    files.push(("log.jsonl".to_owned(), b"{}\n".to_vec()));
    let created = send(&app, "POST", "/datasets", tar_of_owned(&files)).await;
    assert_eq!(created.status(), StatusCode::CREATED);
    let dataset = json_of(created).await;
    let id = dataset["id"].as_str().unwrap();
    assert_eq!((id, &dataset["job"]), ("ds_abababababababab", &Value::Null));
    assert_eq!(num_uploads(&folder), 0);

    let list = json_of(send(&app, "GET", &format!("/datasets/{id}/files"), "").await).await;
    let paths: Vec<&str> = list["data"]
        .as_array()
        .unwrap()
        .iter()
        .map(|file| file["path"].as_str().unwrap())
        .collect();
    // The log is not part of the dataset.
    assert_eq!(paths, ["manifest.json", "config.json", "meta/info.json", "summary.json"]);
    for path in ["meta/info.json", "meta%2Finfo.json"] {
        let response = send(&app, "GET", &format!("/datasets/{id}/files/{path}"), "").await;
        assert_eq!(response.headers()["etag"], format!("{}", list["data"][2]["blake3"]));
        assert_eq!(bytes(response).await, b"{\"fps\": 30}");
    }
    let range = [("range", "bytes=9-10")];
    let part = format!("/datasets/{id}/files/meta/info.json");
    assert_eq!(bytes(send_with(&app, "GET", &part, "", &range).await).await, b"0}");
    for missing in ["log.jsonl", "meta", "..%2F..%2Fjobs.sqlite", "meta/../config.json"] {
        let response = send(&app, "GET", &format!("/datasets/{id}/files/{missing}"), "").await;
        assert_problem(response, 404, "record_not_found").await;
    }

    let archive = format!("/datasets/{id}/archive");
    let response = send(&app, "GET", &archive, "").await;
    assert_eq!(
        response.headers()["content-disposition"],
        format!("attachment; filename=\"{id}.tar\"")
    );
    let archive = bytes(response).await;
    let named = files.iter().filter(|(path, _)| path != "log.jsonl");
    let named: Vec<_> =
        named.map(|(path, contents)| (format!("{id}/{path}"), contents.clone())).collect();
    assert_eq!(untar(&archive), named);
    let known = send(&app, "POST", "/datasets", archive).await;
    assert_eq!(known.status(), StatusCode::OK);
    assert_eq!(json_of(known).await, dataset);
    let deleted = send(&app, "DELETE", &format!("/datasets/{id}"), "").await;
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
}

#[cfg(unix)]
#[tokio::test]
async fn dataset_archive_is_rejected_when_verification_fails() {
    let script = "echo \"error: $3/meta/info.json has changed\" >&2; exit 2";
    let (app, folder) = app_with_verifier(script).await;
    let problem = send(&app, "POST", "/datasets", tar_of_owned(&dataset())).await;
    let problem = assert_problem(problem, 422, "invalid_archive").await;
    let detail = &problem["detail"];
    assert_eq!(detail, "the archive is invalid: meta/info.json has changed");
    let list = json_of(send(&app, "GET", "/datasets", "").await).await;
    assert_eq!(list["data"], json!([]));
    let problem = send(&app, "POST", "/datasets", "not a tar archive").await;
    assert!(problem.status().is_client_error(), "{}", problem.status());
    let empty = send(&app, "POST", "/datasets", "").await;
    assert_problem(empty, 422, "invalid_archive").await;
    assert_eq!(num_uploads(&folder), 0);
}
