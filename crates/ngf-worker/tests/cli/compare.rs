//! `ngf compare` as a process: first run, cached second run, and invalid inputs.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn ngf(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ngf-worker")).args(arguments).output().unwrap()
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

#[test]
fn comparison_is_cached_and_failures_replay() {
    let folder = tempfile::tempdir().unwrap();
    let (models, out) = (folder.path().join("models"), folder.path().join("out"));
    let model = models.join("ngf-pcd");
    std::fs::create_dir_all(&model).unwrap();
    for file in ["weights.safetensors", "start_configurations.safetensors", "config.json"] {
        std::fs::copy(root().join("models/default").join(file), model.join(file)).unwrap();
    }
    let [models, out_text] = [&models, &out].map(|path| path.to_str().unwrap());
    let data = folder.path().join("data");
    let data = data.to_str().unwrap();
    assert!(ngf(&["dataset", "generate", "--preset", "smoke", "--out", data]).status.success());
    let arguments = [
        "compare",
        "--dataset",
        data,
        "--models-dir",
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
    let table = std::fs::read_to_string(out.join("comparison.md")).unwrap();
    for label in
        ["ngf-pcd", "planner", "play-back", "no policy", "shuffled z", "zero z", "friction 0"]
    {
        assert!(table.contains(&format!("| {label} |")), "{table}");
    }
    assert!(table.contains("| friction 0 | 0 of 2 "), "{table}");
    assert!(String::from_utf8_lossy(&first.stderr).contains("has no mlp-pcd"));
    assert!(std::fs::read_to_string(out.join("comparison.svg")).unwrap().starts_with("<svg"));

    // The second run uses the cached reports.
    let json = std::fs::read(out.join("comparison.json")).unwrap();
    let cached = out.join("reports/ngf-pcd-sugar_box.json");
    let written = std::fs::metadata(&cached).unwrap().modified().unwrap();
    assert!(ngf(&arguments).status.success());
    assert_eq!(std::fs::read(out.join("comparison.json")).unwrap(), json);
    assert_eq!(std::fs::metadata(&cached).unwrap().modified().unwrap(), written);

    let failure = out.join("failures/no-policy-sugar_box/0.json");
    let replayed = ngf(&["replay", failure.to_str().unwrap()]);
    assert!(replayed.status.success(), "{}", String::from_utf8_lossy(&replayed.stderr));
    let slippery = out.join("failures/friction-0-sugar_box/0.json");
    let slippery = slippery.to_str().unwrap();
    let replayed = ngf(&["replay", slippery, "--object", "sugar_box", "--friction", "0"]);
    assert!(replayed.status.success(), "{}", String::from_utf8_lossy(&replayed.stderr));
    assert!(
        !ngf(&["replay", slippery]).status.success(),
        "the hash of the object includes its friction"
    );
}

#[test]
fn invalid_inputs_are_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().to_str().unwrap();
    let fails_with = |arguments: &[&str], message: &str| {
        let output = ngf(arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && text.contains(message), "{text}");
    };
    fails_with(&["compare", "--models-dir", dir, "--out", dir], "contains no model");
    let models = root().join("models");
    let models = models.to_str().unwrap();
    let with = |object| ["compare", "--models-dir", models, "--out", dir, "--objects", object];
    fails_with(&with("teapot"), "no object named teapot");
    fails_with(&with("bleach,bleach"), "two objects are named bleach");
    let baseline = folder.path().join("mlp-pcd");
    std::fs::create_dir_all(&baseline).unwrap();
    for file in ["weights.safetensors", "config.json"] {
        std::fs::copy(root().join("models/default").join(file), baseline.join(file)).unwrap();
    }
    fails_with(
        &["compare", "--models-dir", dir, "--out", dir],
        "a policy of another type than its folder name",
    );
    fails_with(&with("pot.obj:heavy"), "the mass (kg) is not a number");
    fails_with(&with("pot.obj:-1"), "the mass must be between 0.001 and 100 kg");
    fails_with(&with("pot.obj:1"), "cannot read pot.obj");
}
