//! `ngf train` as a process: killed at random times and resumed, and resumed from corrupt checkpoints.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;
use std::time::Duration;
use tempfile::TempDir;

/// Inputs that all tests share and do not modify.
struct Trained {
    data: PathBuf,
    /// An encoder, a policy and (in its own subfolder) a start network, from uninterrupted trainings.
    whole: PathBuf,
}

static TRAINED: LazyLock<Trained> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("train");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).unwrap();
    }
    let [data, whole] = ["data", "whole"].map(|name| folder.join(name));
    let mut dataset = Command::new(env!("CARGO_BIN_EXE_ngf-worker"));
    dataset.args(["dataset", "generate", "--preset", "smoke", "--out"]).arg(&data);
    succeeded(dataset);
    for what in ["encoder", "policy", "start"] {
        let out = folder_of(&whole, what);
        succeeded(train(what, &data, &out, &whole));
    }
    Trained { data, whole }
});

impl Trained {
    /// A copy of the uninterrupted training, for a test to modify.
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

/// Output folder of a training below `dir`.
fn folder_of(dir: &Path, what: &str) -> PathBuf {
    let folder = if what == "start" { dir.join(what) } else { dir.to_owned() };
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn ngf(words: &[&str], data: &Path, out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ngf-worker"));
    command.args(words).arg("--dataset").arg(data).arg("--out").arg(out);
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

/// Trains a full-size network for a few small steps. A start network learns from the model in the folder
/// `policy`.
fn train(what: &str, data: &Path, out: &Path, policy: &Path) -> Command {
    let steps = match what {
        "encoder" => "60",
        "policy" => "30",
        _ => "400",
    };
    let network = if what == "start" { "start-net" } else { what };
    let words = ["train", network, "--batch", "4", "--checkpoint-every", "4", "--steps", steps];
    let mut command = ngf(&words, data, out);
    if what == "start" {
        command.arg("--model").arg(policy);
    }
    command
}

fn succeeded(mut command: Command) -> Output {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

fn rejected(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "the command succeeded: {stderr}");
    stderr
}

/// Kills the training three times, each at a random time after it has written a checkpoint, then lets it
/// finish. Returns the number of kills.
fn train_with_kills(what: &str, out: &Path) -> usize {
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
fn killed_and_resumed_training_gives_same_weights() {
    let folder = tempfile::tempdir().unwrap();
    for (what, files) in [
        ("encoder", &["encoder.safetensors", "latent.safetensors"][..]),
        ("policy", &["weights.safetensors", "start_configurations.safetensors", "config.json"][..]),
        ("start", &["start_configurations.safetensors"][..]),
    ] {
        let [whole, killed] = [&TRAINED.whole, folder.path()].map(|dir| folder_of(dir, what));
        let kills = train_with_kills(what, &killed);
        assert!(kills >= 2, "{what}: killed only {kills} times");
        for file in files {
            let [a, b] = [&whole, &killed].map(|dir| std::fs::read(dir.join(file)).unwrap());
            assert!(a == b, "{what}, killed {kills} times: {file} differs");
        }
    }
}

#[test]
fn corrupt_checkpoint_falls_back_to_previous() {
    let cut = TRAINED.copy();
    let checkpoint = cut.path().join("policy.checkpoint.safetensors");
    let bytes = std::fs::read(&checkpoint).unwrap();
    std::fs::write(&checkpoint, &bytes[..bytes.len() - 7]).unwrap();
    let stderr = succeeded(TRAINED.train("policy", cut.path())).stderr;
    let stderr = String::from_utf8_lossy(&stderr).into_owned();
    assert!(stderr.contains("is damaged") && stderr.contains("of step 28"), "{stderr}");
    let [a, b] =
        [&TRAINED.whole, cut.path()].map(|dir| std::fs::read(dir.join("weights.safetensors")));
    assert!(a.unwrap() == b.unwrap(), "the repeated steps give other weights");
}

#[test]
fn other_settings_reject_checkpoint_and_keep_training_record() {
    let copy = TRAINED.copy();
    let mut other = TRAINED.train("policy", copy.path());
    assert!(rejected(other.args(["--lr", "0.001"])).contains("other settings (learning_rate)"));
    let record = std::fs::read(copy.path().join("training.json")).unwrap();
    let record: Value = serde_json::from_slice(&record).unwrap();
    assert_eq!((&record["learning_rate"], &record["steps"]), (&5e-4.into(), &30.into()));
    assert!(record["dataset_hash"].is_string() && record["encoder_hash"].is_string());
    assert!(record["max_poses"].is_null());
    let mut onto_itself = ngf(&["train", "policy", "--steps", "60"], &TRAINED.data, copy.path());
    let stderr = rejected(onto_itself.arg("--init-from").arg(copy.path()));
    assert!(stderr.contains("would be overwritten"), "{stderr}");
}

#[test]
fn invalid_options_are_rejected() {
    for (options, message) in [
        (&["--lr", "-1"][..], "between 0 and 1"),
        (&["--grad-clip", "0"][..], "must be positive and finite"),
        (&["--grad-clip", "inf"], "must be positive and finite"),
        (&["--horizon", "60000"], "60000"),
        (&["--policy", "mlp-pcd", "--potential-only-fraction", "0.5"], "needs a fabric policy"),
    ] {
        let stderr = rejected(TRAINED.train("policy", TRAINED.copy().path()).args(options));
        assert!(stderr.contains(message), "{stderr}");
    }
}

#[test]
fn poses_and_added_datasets_determine_the_demonstration_groups() {
    let groups = |words: &[&str]| {
        let out = tempfile::tempdir().unwrap();
        let few = ["train", "policy", "--batch", "4", "--steps", "4"];
        let mut command = ngf(&few, &TRAINED.data, out.path());
        command.args(words).arg("--encoder").arg(&TRAINED.whole).stdout(Stdio::piped());
        let stdout = String::from_utf8(succeeded(command).stdout).unwrap();
        stdout.split_once(" demonstration groups").unwrap().0.parse::<usize>().unwrap()
    };
    let (all, fewer) = (groups(&[]), groups(&["--max-poses", "1"]));
    assert!(0 < fewer && fewer < all, "{fewer} of {all}");
    assert_eq!(groups(&["--add-dataset", TRAINED.data.to_str().unwrap()]), 2 * all);
}

#[test]
fn validate_prints_fingertip_error_per_object() {
    let mut validate = Command::new(env!("CARGO_BIN_EXE_ngf-worker"));
    validate.args(["validate", "--samples", "2", "--model"]).arg(&TRAINED.whole);
    validate.arg("--dataset").arg(&TRAINED.data);
    let stdout = String::from_utf8(succeeded(validate).stdout).unwrap();
    let row = stdout.lines().find(|line| line.starts_with("sugar_box")).unwrap();
    let numbers: Vec<f64> = row.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    assert!(numbers.len() >= 2 && numbers.iter().take(2).all(|error| *error > 1.0), "{stdout}");
}

/// Log of a training of 30 steps with a checkpoint every 4 steps.
#[test]
fn log_contains_progress_and_rate() {
    let log = std::fs::read_to_string(TRAINED.whole.join("policy.log.jsonl")).unwrap();
    let steps: Vec<Value> = log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let at: Vec<u64> = steps.iter().map(|line| line["step"].as_u64().unwrap()).collect();
    assert_eq!(at, [4, 8, 12, 16, 20, 24, 28, 30]);
    for (line, name) in steps.iter().flat_map(|line| [(line, "loss"), (line, "gradient_norm")]) {
        assert!(line[name].as_f64().unwrap() > 0.0, "{name} in {line}");
    }
    // The rate is defined from the second report on.
    assert!(steps[0]["samples_per_s"].is_null());
    assert!(steps[1..].iter().all(|line| line["samples_per_s"].as_f64().unwrap() > 0.0));
    assert_eq!(steps[7]["seconds_left"], 0.0);
}
