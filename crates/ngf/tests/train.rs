//! `ngf train` as a process: killed at random moments and resumed, with checkpoints that are damaged.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

fn ngf(words: &[&str], data: &Path, out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ngf"));
    command.args(words).arg("--data").arg(data).arg("--out").arg(out);
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

/// Trains an encoder, a policy or a start model of full size for a few small steps; a start model, in
/// a folder of its own, learns from the policy in the folder `whole` beside the one it is in.
fn train(what: &str, data: &Path, out: &Path) -> Command {
    let steps = match what {
        "encoder" => "60",
        "policy" => "30",
        _ => "400",
    };
    let words = ["train", what, "--batch", "4", "--checkpoint", "4", "--steps", steps];
    let mut command = ngf(&words, data, out);
    if what == "start" {
        command.arg("--from").arg(out.join("../../whole"));
    }
    command
}

fn succeeded(mut command: Command) -> Output {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Kills it thrice, each time at a random moment after it has written a checkpoint, and then lets it end; gives how often
/// it was killed.
fn disturbed(what: &str, data: &Path, out: &Path) -> usize {
    let mut rng = ChaCha8Rng::seed_from_u64(what.len() as u64);
    let checkpoint = out.join(format!("{what}.checkpoint.safetensors"));
    let written = || std::fs::metadata(&checkpoint).and_then(|file| file.modified()).ok();
    for kills in 0..3 {
        let before = written();
        let mut child = train(what, data, out).spawn().unwrap();
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
    succeeded(train(what, data, out));
    3
}

#[test]
fn killed_and_resumed_it_ends_in_the_same_weights() {
    let folder = tempfile::tempdir().unwrap();
    let [data, whole, killed] = ["data", "whole", "killed"].map(|name| folder.path().join(name));
    let mut dataset = Command::new(env!("CARGO_BIN_EXE_ngf"));
    dataset.args(["dataset", "--preset", "smoke", "--out"]).arg(&data);
    succeeded(dataset);
    for (what, files) in [
        ("encoder", &["encoder.safetensors", "latent.safetensors"][..]),
        ("policy", &["weights.safetensors", "starts.safetensors", "config.json"][..]),
        ("start", &["starts.safetensors"][..]),
    ] {
        let folder = if what == "start" { what } else { "" };
        let [whole, killed] = [&whole, &killed].map(|dir| dir.join(folder));
        [&whole, &killed].into_iter().for_each(|dir| std::fs::create_dir_all(dir).unwrap());
        succeeded(train(what, &data, &whole));
        let kills = disturbed(what, &data, &killed);
        assert!(kills >= 2, "{what}: killed {kills} times only");
        for file in files {
            let [a, b] = [&whole, &killed].map(|dir| std::fs::read(dir.join(file)).unwrap());
            assert!(a == b, "{what}, killed {kills} times: {file} differs");
        }
    }

    // What it can do on the poses that it was taught is told for each object.
    let mut examine = Command::new(env!("CARGO_BIN_EXE_ngf"));
    examine.args(["examine", "--lessons", "2", "--model"]).arg(&whole).arg("--data").arg(&data);
    let said = String::from_utf8(succeeded(examine).stdout).unwrap();
    let row = said.lines().find(|line| line.starts_with("sugar_box")).unwrap();
    let numbers: Vec<f64> = row.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    assert!(numbers.len() >= 2 && numbers[0] > 1.0 && numbers[1] >= numbers[0], "{said}");

    // The last checkpoint is cut short: the one before it is used, and its steps are taken again.
    let checkpoint = killed.join("policy.checkpoint.safetensors");
    let bytes = std::fs::read(&checkpoint).unwrap();
    std::fs::write(&checkpoint, &bytes[..bytes.len() - 7]).unwrap();
    let said = succeeded(train("policy", &data, &killed)).stderr;
    let said = String::from_utf8_lossy(&said).into_owned();
    assert!(said.contains("is damaged") && said.contains("of step 28"), "{said}");
    let [a, b] = [&whole, &killed].map(|dir| std::fs::read(dir.join("weights.safetensors")));
    assert!(a.unwrap() == b.unwrap(), "the steps that were taken again differ");

    // Neither of the two is of use to another training.
    let mut other = train("policy", &data, &killed);
    assert!(refused(other.args(["--rate", "0.001"])).contains("other settings (rate)"));
    // What lies beside the weights still tells of the training that made them.
    let about = std::fs::read(killed.join("dagger.json")).unwrap();
    let about: Value = serde_json::from_slice(&about).unwrap();
    assert_eq!((&about["rate"], &about["steps"]), (&5e-4.into(), &30.into()));
    assert!(about["data"].is_string() && about["encoder"].is_string() && about["poses"].is_null());

    its_log_tells_how_far_and_how_fast(&whole);
    // Of fewer poses there are fewer lessons.
    let lessons = |name: &str, words: &[&str]| {
        let mut command = ngf(
            &["train", "policy", "--batch", "4", "--steps", "4"],
            &data,
            &folder.path().join(name),
        );
        command.args(words).arg("--encoder").arg(&whole).stdout(Stdio::piped());
        let said = String::from_utf8(succeeded(command).stdout).unwrap();
        said.split_once(" lessons").unwrap().0.parse::<usize>().unwrap()
    };
    let (all, fewer) = (lessons("all", &[]), lessons("fewer", &["--poses", "1"]));
    assert!(0 < fewer && fewer < all, "{fewer} of {all}");

    // What makes no sense is refused before anything is done.
    for (words, why) in [
        (&["--rate", "-1"][..], "between 0 and 1"),
        (&["--horizon", "60000"], "60000"),
        (&["--policy", "mlp-pcd", "--potential-share", "0.5"], "is of a fabric's networks"),
    ] {
        let said = refused(train("policy", &data, &whole).args(words));
        assert!(said.contains(why), "{said}");
    }
    let mut onto_itself = ngf(&["train", "policy", "--steps", "60"], &data, &whole);
    let said = refused(onto_itself.arg("--from").arg(&whole));
    assert!(said.contains("would be lost"), "{said}");
}

/// A training of 30 steps with a checkpoint every 4.
fn its_log_tells_how_far_and_how_fast(out: &Path) {
    let log = std::fs::read_to_string(out.join("policy.log.jsonl")).unwrap();
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

fn refused(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "it was done: {said}");
    said
}
