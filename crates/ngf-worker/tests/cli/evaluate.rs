//! `ngf evaluate` as a process.

use std::path::Path;
use std::process::{Command, Output};

fn evaluate(options: &[&str]) -> Output {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut command = Command::new(env!("CARGO_BIN_EXE_ngf-worker"));
    command.args(["evaluate", "--model", "planner"]).args(options).current_dir(root);
    command.output().unwrap()
}

/// Parses "K of N lifted" in the line of an object or a family.
fn counts(table: &str, of: &str) -> [u64; 2] {
    let line = table.lines().find(|line| line.split_whitespace().nth(1) == Some(of));
    let words: Vec<&str> = line.unwrap().split_whitespace().collect();
    [words[2].parse().unwrap(), words[4].parse().unwrap()]
}

#[test]
fn evaluate_sums_objects_by_family() {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("report.json");
    let output = evaluate(&[
        "--family",
        "jars,toys",
        "--attempts",
        "1",
        "--seed",
        "3",
        "--json",
        json.to_str().unwrap(),
    ]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = String::from_utf8(output.stdout).unwrap();

    let reports: Vec<serde_json::Value> =
        serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    let mut sums = Vec::new();
    for family in ["jars", "toys"] {
        let mut sum = [0, 0];
        for entry in objects::catalog::entries_of_family(family) {
            let report = reports.iter().find(|r| r["object"] == entry.name).unwrap();
            let [lifted, attempts] =
                ["lifted", "attempts"].map(|key| report[key].as_u64().unwrap());
            assert_eq!(counts(&table, entry.name), [lifted, attempts]);
            assert_eq!(attempts, 1);
            sum = [sum[0] + lifted, sum[1] + attempts];
        }
        assert_eq!(counts(&table, family), sum);
        sums.push(sum);
    }
    assert!(sums.iter().all(|sum| sum[0] > 0), "the planner lifts objects of each family: {table}");
    assert_eq!(counts(&table, "all"), [sums[0][0] + sums[1][0], sums[0][1] + sums[1][1]]);
    assert_eq!(reports.len() as u64, sums[0][1] + sums[1][1]);
}

#[test]
fn unknown_family_error_lists_known_families() {
    let output = evaluate(&["--family", "teapots"]);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "{stderr}");
    assert!(stderr.contains("teapots") && stderr.contains("jars, mugs"), "{stderr}");
}

#[test]
fn planner_lifts_a_mesh_with_the_grasps_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (mesh, grasps) = (path("box.obj"), path("grasps.json"));
    let object = objects::object::Object::from_catalog("sugar_box").unwrap();
    let vertices = object.mesh.vertices.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let triangles = object.mesh.triangles.iter().map(|t| t.map(|i| i + 1));
    let faces = triangles.map(|[a, b, c]| format!("f {a} {b} {c}\n"));
    std::fs::write(&mesh, vertices.chain(faces).collect::<String>()).unwrap();
    let of_mesh = ["--mesh", &mesh, "--mass", "0.5", "--attempts", "4"];

    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut search = Command::new(env!("CARGO_BIN_EXE_ngf-worker"));
    search.args(["grasps", "--effort", "quick", "--out", &grasps]).args(&of_mesh[..4]);
    assert!(search.current_dir(root).status().unwrap().success());
    let output = evaluate(&[&of_mesh[..], &["--grasps", &grasps]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let [lifted, attempts] = counts(&String::from_utf8(output.stdout).unwrap(), "box");
    assert!(lifted >= 3 && attempts == 4, "{lifted} of {attempts}");

    std::fs::write(&grasps, "{}").unwrap();
    let output = evaluate(&[&of_mesh[..], &["--grasps", &grasps]].concat());
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("grasps.json contains no grasps"), "{message}");
}
