//! `ngf dataset` as a process: killed, stopped, on one thread and on two, in folders that are not its own.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

/// `ngf dataset --preset smoke --out DIR` and more.
fn smoke(dir: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ngf"));
    command.args(["dataset", "--preset", "smoke", "--out"]).arg(dir).args(more);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn look(words: &[&str], dir: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ngf")).arg("dataset").args(words).arg(dir).output().unwrap()
}

fn hash(dir: &Path) -> String {
    let said = look(&["info", "--json"], dir);
    assert!(said.status.success(), "{}", errors(&said));
    let json: serde_json::Value = serde_json::from_slice(&said.stdout).unwrap();
    json["hash"].as_str().unwrap().to_owned()
}

/// Files in a folder and all below it.
fn files(dir: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(dir) else { return 0 };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    paths.map(|path| if path.is_dir() { files(&path) } else { 1 }).sum()
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn fails(output: &Output, with: &str) {
    let message = errors(output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains(with), "{message} does not say \"{with}\"");
    assert!(!message.contains("panicked"), "{message}");
}

/// Killed three times, each time when two more files are there, and resumed: the bytes are those of a run that
/// nothing disturbed, on one thread or on two.
#[test]
fn killed_and_resumed_it_has_the_same_hash() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, one, killed] = ["whole", "one", "killed"].map(|name| folder.path().join(name));
    assert!(smoke(&whole, &["--threads", "2"]).status().unwrap().success());
    assert!(smoke(&one, &["--threads", "1"]).status().unwrap().success());
    assert_eq!(hash(&whole), hash(&one), "the hash depends on the number of threads");

    for kill in 1..=3 {
        let before = files(&killed);
        let mut child = smoke(&killed, &["--resume"]).spawn().unwrap();
        while files(&killed) < before + 2 {
            assert!(child.try_wait().unwrap().is_none(), "it ended before kill {kill}");
            std::thread::sleep(Duration::from_millis(2));
        }
        child.kill().unwrap();
        child.wait().unwrap();
    }
    fails(&smoke(&killed, &[]).output().unwrap(), "complete it with --resume");
    assert!(smoke(&killed, &["--resume"]).status().unwrap().success());
    assert_eq!(hash(&whole), hash(&killed), "killed three times");
    assert!(look(&["verify"], &killed).status.success());
    // What is complete is not made again.
    assert!(smoke(&killed, &[]).status().unwrap().success());

    let rows = killed.join("data/chunk-000/file-000.parquet");
    let mut bytes = std::fs::read(&rows).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&rows, bytes).unwrap();
    fails(&look(&["verify"], &killed), "file-000.parquet has changed");
}

#[cfg(unix)]
#[test]
fn stopped_by_the_keyboard_it_can_be_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("data");
    let mut child = smoke(&dir, &["--threads", "1"]).spawn().unwrap();
    // The handler is there once the configuration is written.
    while !dir.join("parts").exists() && !dir.join("manifest.json").exists() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it was stopped");
        std::thread::sleep(Duration::from_millis(20));
    }
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    fails(&child.wait_with_output().unwrap(), "--resume goes on");
    assert!(smoke(&dir, &["--resume"]).status().unwrap().success());
}

#[test]
fn folders_that_are_not_its_own_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let thesis = folder.path().join("thesis.tex");
    std::fs::write(&thesis, "important").unwrap();
    fails(&smoke(folder.path(), &[]).output().unwrap(), "thesis.tex");
    fails(&smoke(&thesis, &[]).output().unwrap(), "thesis.tex");
    assert_eq!(std::fs::read_to_string(&thesis).unwrap(), "important");
    assert_eq!(folder.path().read_dir().unwrap().count(), 1);
    fails(&look(&["info"], folder.path()), "no config.json");
    fails(&look(&["verify"], &folder.path().join("nowhere")), "no config.json");
    let nothing = Command::new(env!("CARGO_BIN_EXE_ngf")).arg("dataset").output().unwrap();
    fails(&nothing, "--preset NAME --out DIR");
    let unknown = ["dataset", "--preset", "huge", "--out", "x"];
    let unknown = Command::new(env!("CARGO_BIN_EXE_ngf")).args(unknown).output().unwrap();
    fails(&unknown, "there is no preset huge");
}

/// A limit on the size of files stands in for a full disk.
#[cfg(unix)]
#[test]
fn a_disk_that_is_full_is_an_error_and_what_was_there_stays() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("data");
    let limited = format!(
        "trap '' XFSZ; ulimit -f 100; exec {} dataset --preset smoke --out {}",
        env!("CARGO_BIN_EXE_ngf"),
        dir.display()
    );
    let output = Command::new("bash").args(["-c", &limited]).output().unwrap();
    fails(&output, "cannot write");
    assert!(dir.join("grasps/sugar_box.json").exists());
    assert!(smoke(&dir, &["--resume"]).status().unwrap().success());
    assert!(look(&["verify"], &dir).status.success());
}
