//! `ngf train` as a process: killed at random moments and resumed, with checkpoints that are damaged.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;
use std::time::Duration;
use tempfile::TempDir;

/// What the tests share and leave as it is.
struct Trained {
    data: PathBuf,
    /// An encoder, a policy and, in a folder of its own, a start network; nothing disturbed their training.
    whole: PathBuf,
}

static TRAINED: LazyLock<Trained> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("train");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).unwrap();
    }
    let [data, whole] = ["data", "whole"].map(|name| folder.join(name));
    let mut dataset = Command::new(env!("CARGO_BIN_EXE_ngf"));
    dataset.args(["dataset", "--preset", "smoke", "--out"]).arg(&data);
    succeeded(dataset);
    for what in ["encoder", "policy", "start"] {
        let out = folder_of(&whole, what);
        succeeded(train(what, &data, &out, &whole));
    }
    Trained { data, whole }
});

impl Trained {
    /// A copy of the undisturbed training, to be spoilt.
    fn copy(&self) -> TempDir {
        let copy = tempfile::tempdir().unwrap();
        for entry in std::fs::read_dir(&self.whole).unwrap().map(Result::unwrap) {
            if entry.file_type().unwrap().is_file() {
                std::fs::copy(entry.path(), copy.path().join(entry.file_name())).unwrap();
            }
        }
        copy
    }

    fn train(&self, what: &str, out: &Path) -> Command {
        train(what, &self.data, out, &self.whole)
    }
}

/// Where in a folder this is trained.
fn folder_of(dir: &Path, what: &str) -> PathBuf {
    let folder = if what == "start" { dir.join(what) } else { dir.to_owned() };
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn ngf(words: &[&str], data: &Path, out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ngf"));
    command.args(words).arg("--data").arg(data).arg("--out").arg(out);
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

/// Trains an encoder, a policy or a start network of full size for a few small steps; a start network learns from the policy
/// in the folder `policy`.
fn train(what: &str, data: &Path, out: &Path, policy: &Path) -> Command {
    let steps = match what {
        "encoder" => "60",
        "policy" => "30",
        _ => "400",
    };
    let words = ["train", what, "--batch", "4", "--checkpoint", "4", "--steps", steps];
    let mut command = ngf(&words, data, out);
    if what == "start" {
        command.arg("--from").arg(policy);
    }
    command
}

fn succeeded(mut command: Command) -> Output {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

fn refused(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "it was done: {said}");
    said
}

/// Kills it thrice, each time at a random moment after it has written a checkpoint, and then lets it end; gives how often
/// it was killed.
fn disturbed(what: &str, out: &Path) -> usize {
    let mut rng = ChaCha8Rng::seed_from_u64(what.len() as u64);
    let checkpoint = out.join(format!("{what}.checkpoint.safetensors"));
    let written = || std::fs::metadata(&checkpoint).and_then(|file| file.modified()).ok();
    for kills in 0..3 {
        let before = written();
        let mut child = TRAINED.train(what, out).spawn().unwrap();
        while written() == before || written().is_none() {
            if child.try_wait().unwrap().is_some() {
                return kills;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        std::thread::sleep(Duration::from_millis(rng.random_range(0..200)));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    succeeded(TRAINED.train(what, out));
    3
}

#[test]
fn killed_and_resumed_it_ends_in_the_same_weights() {
    let folder = tempfile::tempdir().unwrap();
    for (what, files) in [
        ("encoder", &["encoder.safetensors", "latent.safetensors"][..]),
        ("policy", &["weights.safetensors", "starts.safetensors", "config.json"][..]),
        ("start", &["starts.safetensors"][..]),
    ] {
        let [whole, killed] = [&TRAINED.whole, folder.path()].map(|dir| folder_of(dir, what));
        let kills = disturbed(what, &killed);
        assert!(kills >= 2, "{what}: killed {kills} times only");
        for file in files {
            let [a, b] = [&whole, &killed].map(|dir| std::fs::read(dir.join(file)).unwrap());
            assert!(a == b, "{what}, killed {kills} times: {file} differs");
        }
    }
}

#[test]
fn a_checkpoint_that_is_cut_short_gives_way_to_the_one_before() {
    let cut = TRAINED.copy();
    let checkpoint = cut.path().join("policy.checkpoint.safetensors");
    let bytes = std::fs::read(&checkpoint).unwrap();
    std::fs::write(&checkpoint, &bytes[..bytes.len() - 7]).unwrap();
    let said = succeeded(TRAINED.train("policy", cut.path())).stderr;
    let said = String::from_utf8_lossy(&said).into_owned();
    assert!(said.contains("is damaged") && said.contains("of step 28"), "{said}");
    let [a, b] =
        [&TRAINED.whole, cut.path()].map(|dir| std::fs::read(dir.join("weights.safetensors")));
    assert!(a.unwrap() == b.unwrap(), "the steps that were taken again differ");
}

#[test]
fn another_training_refuses_the_checkpoints_and_leaves_what_is_told_of_the_first() {
    let copy = TRAINED.copy();
    let mut other = TRAINED.train("policy", copy.path());
    assert!(refused(other.args(["--rate", "0.001"])).contains("other settings (rate)"));
    let about = std::fs::read(copy.path().join("dagger.json")).unwrap();
    let about: Value = serde_json::from_slice(&about).unwrap();
    assert_eq!((&about["rate"], &about["steps"]), (&5e-4.into(), &30.into()));
    assert!(about["data"].is_string() && about["encoder"].is_string() && about["poses"].is_null());
    let mut onto_itself = ngf(&["train", "policy", "--steps", "60"], &TRAINED.data, copy.path());
    let said = refused(onto_itself.arg("--from").arg(copy.path()));
    assert!(said.contains("would be lost"), "{said}");
}

#[test]
fn what_makes_no_sense_is_refused() {
    for (words, why) in [
        (&["--rate", "-1"][..], "between 0 and 1"),
        (&["--clip", "0"][..], "more than 0, and finite"),
        (&["--clip", "inf"], "more than 0, and finite"),
        (&["--horizon", "60000"], "60000"),
        (&["--policy", "mlp-pcd", "--potential-share", "0.5"], "is of a fabric's networks"),
    ] {
        let said = refused(TRAINED.train("policy", TRAINED.copy().path()).args(words));
        assert!(said.contains(why), "{said}");
    }
}

#[test]
fn of_fewer_poses_there_are_fewer_lessons() {
    let lessons = |words: &[&str]| {
        let out = tempfile::tempdir().unwrap();
        let few = ["train", "policy", "--batch", "4", "--steps", "4"];
        let mut command = ngf(&few, &TRAINED.data, out.path());
        command.args(words).arg("--encoder").arg(&TRAINED.whole).stdout(Stdio::piped());
        let said = String::from_utf8(succeeded(command).stdout).unwrap();
        said.split_once(" lessons").unwrap().0.parse::<usize>().unwrap()
    };
    let (all, fewer) = (lessons(&[]), lessons(&["--poses", "1"]));
    assert!(0 < fewer && fewer < all, "{fewer} of {all}");
}

#[test]
fn what_it_can_do_on_the_poses_that_it_was_taught_is_told_for_each_object() {
    let mut examine = Command::new(env!("CARGO_BIN_EXE_ngf"));
    examine.args(["examine", "--lessons", "2", "--model"]).arg(&TRAINED.whole);
    examine.arg("--data").arg(&TRAINED.data);
    let said = String::from_utf8(succeeded(examine).stdout).unwrap();
    let row = said.lines().find(|line| line.starts_with("sugar_box")).unwrap();
    let numbers: Vec<f64> = row.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    assert!(numbers.len() >= 2 && numbers.iter().take(2).all(|off| *off > 1.0), "{said}");
}

/// Of a training of 30 steps with a checkpoint every 4.
#[test]
fn its_log_tells_how_far_and_how_fast() {
    let log = std::fs::read_to_string(TRAINED.whole.join("policy.log.jsonl")).unwrap();
    let steps: Vec<Value> = log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let at: Vec<u64> = steps.iter().map(|line| line["step"].as_u64().unwrap()).collect();
    assert_eq!(at, [4, 8, 12, 16, 20, 24, 28, 30]);
    for (line, name) in steps.iter().flat_map(|line| [(line, "loss"), (line, "gradient_norm")]) {
        assert!(line[name].as_f64().unwrap() > 0.0, "{name} in {line}");
    }
    // A pace is known from the second report on.
    assert!(steps[0]["samples_per_s"].is_null());
    assert!(steps[1..].iter().all(|line| line["samples_per_s"].as_f64().unwrap() > 0.0));
    assert_eq!(steps[7]["seconds_left"], 0.0);
}
