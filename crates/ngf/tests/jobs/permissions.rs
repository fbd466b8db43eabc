//! Warnings about a token file or data folder that other users can read.

use crate::server::Server;
use serde_json::Value;
use std::fs::{File, Permissions, metadata, set_permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Starts a server with the files `token` and `data` in `folder`; returns the paths of its warnings.
fn paths_of_warnings(folder: &Path) -> Vec<PathBuf> {
    let log = folder.join("log");
    let mut serve = Command::new(env!("CARGO_BIN_EXE_ngf"));
    serve.args(["serve", "--port", "0", "--log", "json", "--data-dir"]).arg(folder.join("data"));
    serve.arg("--token-file").arg(folder.join("token")).env("NGF_LOG", "warn");
    // The address is printed after the warnings.
    let _server = Server::spawn(serve.stderr(File::create(&log).unwrap()));
    let text = std::fs::read_to_string(&log).unwrap();
    let path_of = |line: &str| {
        let line: Value = serde_json::from_str(line).unwrap();
        let (_, path) = line["message"].as_str()?.split_once("run chmod o-rwx ")?;
        Some(PathBuf::from(path))
    };
    text.lines().filter_map(path_of).collect()
}

#[test]
fn token_file_and_data_folder_that_others_can_read_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let (token, data) = (folder.path().join("token"), folder.path().join("data"));
    std::fs::write(&token, "0123456789abcdef").unwrap();
    std::fs::create_dir(&data).unwrap();
    for (token_mode, data_mode, expected) in [
        (0o600, 0o700, vec![]),
        (0o644, 0o700, vec![token.clone()]),
        (0o600, 0o755, vec![data.clone()]),
        (0o644, 0o755, vec![token.clone(), data.clone()]),
    ] {
        set_permissions(&token, Permissions::from_mode(token_mode)).unwrap();
        set_permissions(&data, Permissions::from_mode(data_mode)).unwrap();
        let warned = paths_of_warnings(folder.path());
        assert_eq!(warned, expected, "token {token_mode:o}, data {data_mode:o}");
    }
}

#[test]
fn new_data_folder_is_private_with_the_usual_umask() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let mut shell = Command::new("sh");
    shell.args(["-c", "umask 022 && exec \"$0\" serve --port 0 --data-dir \"$1\""]);
    shell.arg(env!("CARGO_BIN_EXE_ngf")).arg(&data);
    let _server = Server::spawn(shell.env("NGF_LOG", "warn"));
    let mode = metadata(&data).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode, 0o700, "{mode:o}");
}
