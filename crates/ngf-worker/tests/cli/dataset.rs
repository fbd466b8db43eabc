//! `ngf dataset` as a process: killed, stopped, with different thread counts, and in foreign folders.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

/// `ngf dataset generate --preset smoke --out DIR` with further options.
fn smoke(dir: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ngf-worker"));
    command.args(["dataset", "generate", "--preset", "smoke", "--out"]).arg(dir).args(more);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn dataset_command(words: &[&str], dir: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ngf-worker"))
        .arg("dataset")
        .args(words)
        .arg(dir)
        .output()
        .unwrap()
}

fn hash(dir: &Path) -> String {
    let output = dataset_command(&["info", "--json"], dir);
    assert!(output.status.success(), "{}", errors(&output));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    json["hash"].as_str().unwrap().to_owned()
}

/// Number of files below a folder.
fn files(dir: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(dir) else { return 0 };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    paths.map(|path| if path.is_dir() { files(&path) } else { 1 }).sum()
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn assert_fails(output: &Output, with: &str) {
    let message = errors(output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains(with), "{message} does not contain \"{with}\"");
    assert!(!message.contains("panicked"), "{message}");
}

/// Kills the run three times, each time after two more files, and resumes it. The bytes equal those of an
/// uninterrupted run, with one thread and with two.
#[test]
fn killed_and_resumed_dataset_has_same_hash() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, one, killed] = ["whole", "one", "killed"].map(|name| folder.path().join(name));
    assert!(smoke(&whole, &["--threads", "2"]).status().unwrap().success());
    assert!(smoke(&one, &["--threads", "1"]).status().unwrap().success());
    assert_eq!(hash(&whole), hash(&one), "the hash depends on the number of threads");
    let listed = dataset_command(&["episodes", "--json", "--first", "1", "--limit", "2"], &whole);
    let listed: serde_json::Value = serde_json::from_slice(&listed.stdout).unwrap();
    let indices: Vec<&serde_json::Value> =
        listed.as_array().unwrap().iter().map(|episode| &episode["index"]).collect();
    assert_eq!(indices, [1, 2]);

    for kill in 1..=3 {
        let before = files(&killed);
        let mut child = smoke(&killed, &["--resume"]).spawn().unwrap();
        while files(&killed) < before + 2 {
            assert!(child.try_wait().unwrap().is_none(), "the process ended before kill {kill}");
            std::thread::sleep(Duration::from_millis(2));
        }
        child.kill().unwrap();
        child.wait().unwrap();
    }
    assert_fails(&smoke(&killed, &[]).output().unwrap(), "complete it with --resume");
    assert!(smoke(&killed, &["--resume"]).status().unwrap().success());
    assert_eq!(hash(&whole), hash(&killed), "killed three times");
    assert!(dataset_command(&["verify"], &killed).status.success());
    // A complete dataset is not generated again.
    assert!(smoke(&killed, &[]).status().unwrap().success());

    let rows = killed.join("data/chunk-000/file-000.parquet");
    let mut bytes = std::fs::read(&rows).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&rows, bytes).unwrap();
    assert_fails(&dataset_command(&["verify"], &killed), "file-000.parquet has changed");
}

/// `ngf dataset adapt` of a dataset to a model of this project.
fn adapt(dataset: &Path, out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ngf-worker"));
    command.args(["dataset", "adapt", "--dataset"]).arg(dataset).arg("--out").arg(out);
    command.arg("--model").arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/default"));
    command.args(more).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Grasps of an object in a dataset.
fn grasps(dir: &Path) -> Vec<serde_json::Value> {
    let text = std::fs::read(dir.join("grasps/sugar_box.json")).unwrap();
    let set: serde_json::Value = serde_json::from_slice(&text).unwrap();
    set["grasps"].as_array().unwrap().clone()
}

/// The default policy grasps the sugar box, so most of its final configurations are near a grasp.
#[test]
fn adapted_dataset_demonstrates_grasps_near_the_policy() {
    let folder = tempfile::tempdir().unwrap();
    let [source, one, killed] = ["source", "one", "killed"].map(|name| folder.path().join(name));
    assert_fails(&adapt(&source, &one, &[]).output().unwrap(), "no config.json");
    assert!(smoke(&source, &[]).status().unwrap().success());
    let source_hash = hash(&source);
    assert!(adapt(&source, &one, &["--threads", "1"]).status().unwrap().success());

    let mut child = adapt(&source, &killed, &[]).spawn().unwrap();
    while files(&killed) < 2 {
        assert!(child.try_wait().unwrap().is_none(), "the process ended before it was killed");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(adapt(&source, &killed, &["--resume"]).status().unwrap().success());
    assert_eq!(hash(&one), hash(&killed));
    assert!(dataset_command(&["verify"], &one).status.success());

    assert_eq!(hash(&source), source_hash, "the source has changed");
    let (before, after) = (grasps(&source), grasps(&one));
    assert_eq!(before, after[..before.len()], "the grasps of the source come first");
    let info: serde_json::Value =
        serde_json::from_slice(&dataset_command(&["info", "--json"], &one).stdout).unwrap();
    let by_grasp = info["summary"]["sugar_box"]["grasps"].as_object().unwrap();
    let is_adapted = |grasp: &&String| grasp.parse::<usize>().unwrap() >= before.len();
    let num_adapted = by_grasp.keys().filter(is_adapted).count();
    assert!(num_adapted >= 2, "adapted grasps at {num_adapted} of 3 poses: {by_grasp:?}");
    let config = std::fs::read_to_string(one.join("config.json")).unwrap();
    assert!(config.contains(&source_hash), "{config}");
    // Another source is another dataset.
    assert_fails(&adapt(&one, &killed, &[]).output().unwrap(), "another configuration");
}

#[cfg(unix)]
#[test]
fn interrupted_generation_can_be_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("data");
    let mut child = smoke(&dir, &["--threads", "1"]).spawn().unwrap();
    // The handler is installed after the configuration has been written.
    while !dir.join("shards").exists() && !dir.join("manifest.json").exists() {
        assert!(child.try_wait().unwrap().is_none(), "the process ended before the signal");
        std::thread::sleep(Duration::from_millis(20));
    }
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    assert_fails(&child.wait_with_output().unwrap(), "use --resume to continue");
    assert!(smoke(&dir, &["--resume"]).status().unwrap().success());
}

#[test]
fn foreign_folders_are_rejected_and_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let thesis = folder.path().join("thesis.tex");
    std::fs::write(&thesis, "important").unwrap();
    assert_fails(&smoke(folder.path(), &[]).output().unwrap(), "thesis.tex");
    assert_fails(&smoke(&thesis, &[]).output().unwrap(), "thesis.tex");
    assert_eq!(std::fs::read_to_string(&thesis).unwrap(), "important");
    assert_eq!(folder.path().read_dir().unwrap().count(), 1);
    assert_fails(&dataset_command(&["info"], folder.path()), "no config.json");
    assert_fails(&dataset_command(&["verify"], &folder.path().join("nowhere")), "no config.json");
    let incomplete =
        Command::new(env!("CARGO_BIN_EXE_ngf-worker")).arg("dataset").output().unwrap();
    assert_fails(&incomplete, "generate");
    let unknown = ["dataset", "generate", "--preset", "huge", "--out", "x"];
    let unknown = Command::new(env!("CARGO_BIN_EXE_ngf-worker")).args(unknown).output().unwrap();
    assert_fails(&unknown, "invalid value 'huge'");
}

/// A file size limit simulates a full disk.
#[cfg(unix)]
#[test]
fn full_disk_is_an_error_and_keeps_finished_files() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("data");
    let limited = format!(
        "trap '' XFSZ; ulimit -f 100; exec {} dataset generate --preset smoke --out {}",
        env!("CARGO_BIN_EXE_ngf-worker"),
        dir.display()
    );
    let output = Command::new("bash").args(["-c", &limited]).output().unwrap();
    assert_fails(&output, "cannot write");
    assert!(dir.join("grasps/sugar_box.json").exists());
    assert!(smoke(&dir, &["--resume"]).status().unwrap().success());
    assert!(dataset_command(&["verify"], &dir).status.success());
}
