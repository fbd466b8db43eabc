//! `ngf suite` as a user runs it: once, again, and with what cannot be compared.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn ngf(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ngf")).args(arguments).output().unwrap()
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

#[test]
fn a_suite_counts_once_and_every_failure_can_be_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let (models, out) = (folder.path().join("models"), folder.path().join("out"));
    let model = models.join("ngf-pcd");
    std::fs::create_dir_all(&model).unwrap();
    for file in ["weights.safetensors", "starts.safetensors", "config.json"] {
        std::fs::copy(root().join("models/default").join(file), model.join(file)).unwrap();
    }
    let [models, out_text] = [&models, &out].map(|path| path.to_str().unwrap());
    let data = folder.path().join("data");
    let data = data.to_str().unwrap();
    assert!(ngf(&["dataset", "--preset", "smoke", "--out", data]).status.success());
    let arguments = [
        "suite",
        "--data",
        data,
        "--models",
        models,
        "--objects",
        "sugar_box",
        "--attempts",
        "2",
        "--out",
        out_text,
    ];
    let first = ngf(&arguments);
    assert!(first.status.success(), "{}", String::from_utf8_lossy(&first.stderr));
    let table = std::fs::read_to_string(out.join("suite.md")).unwrap();
    for who in
        ["ngf-pcd", "planner", "play-back", "no policy", "shuffled z", "zero z", "friction 0"]
    {
        assert!(table.contains(&format!("| {who} |")), "{table}");
    }
    assert!(table.contains("| friction 0 | 0 of 2 "), "{table}");
    assert!(String::from_utf8_lossy(&first.stderr).contains("has no mlp-pcd"));
    assert!(std::fs::read_to_string(out.join("suite.svg")).unwrap().starts_with("<svg"));

    // Nothing is tried twice.
    let json = std::fs::read(out.join("suite.json")).unwrap();
    let cell = out.join("cells/ngf-pcd-sugar_box.json");
    let written = std::fs::metadata(&cell).unwrap().modified().unwrap();
    assert!(ngf(&arguments).status.success());
    assert_eq!(std::fs::read(out.join("suite.json")).unwrap(), json);
    assert_eq!(std::fs::metadata(&cell).unwrap().modified().unwrap(), written);

    let failure = out.join("failures/no-policy-sugar_box/0.json");
    let replayed = ngf(&["replay", failure.to_str().unwrap()]);
    assert!(replayed.status.success(), "{}", String::from_utf8_lossy(&replayed.stderr));
    let slippery = out.join("failures/friction-0-sugar_box/0.json");
    let slippery = slippery.to_str().unwrap();
    let replayed = ngf(&["replay", slippery, "--object", "sugar_box", "--friction", "0"]);
    assert!(replayed.status.success(), "{}", String::from_utf8_lossy(&replayed.stderr));
    assert!(!ngf(&["replay", slippery]).status.success(), "with friction it is another object");
}

#[test]
fn what_cannot_be_compared_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().to_str().unwrap();
    let says = |arguments: &[&str], wanted: &str| {
        let output = ngf(arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && text.contains(wanted), "{text}");
    };
    says(&["suite", "--models", dir, "--out", dir], "holds no model");
    let models = root().join("models");
    let models = models.to_str().unwrap();
    let with = |object| ["suite", "--models", models, "--out", dir, "--objects", object];
    says(&with("teapot"), "no object named teapot");
    says(&with("bleach,bleach"), "two objects are named bleach");
    let baseline = folder.path().join("mlp-pcd");
    std::fs::create_dir_all(&baseline).unwrap();
    for file in ["weights.safetensors", "config.json"] {
        std::fs::copy(root().join("models/default").join(file), baseline.join(file)).unwrap();
    }
    says(&["suite", "--models", dir, "--out", dir], "another policy than its name says");
    says(&with("pot.obj:heavy"), "the mass (kg) is no number");
    says(&with("pot.obj:-1"), "positive number of kilograms");
    says(&with("pot.obj:1"), "cannot read pot.obj");
}
