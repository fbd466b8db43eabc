//! Allowed dependencies between crates, and libraries that are confined to some crates.

use crate::root;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::read_to_string;
use std::path::{Path, PathBuf};
use std::process::Command;
use toml::{Table, Value};

/// Workspace crates that each crate may depend on at run time.
///
/// ARCHITECTURE.md describes the crates. `policy`, `rollout` and their dependencies run in the browser and
/// must not depend on candle. `server` links no physics, training or Parquet: jobs, and the commands that read
/// a dataset, run in worker processes.
pub(crate) const ALLOWED_DEPENDENCIES: [(&str, &[&str]); 29] = [
    ("progress", &[]),
    ("mesh", &[]),
    ("mesh-reader", &["mesh"]),
    ("geometry", &["mesh"]),
    ("objects", &["progress", "mesh", "geometry"]),
    ("robot", &["geometry"]),
    ("fabrics", &["geometry", "robot"]),
    ("scene", &["mesh", "geometry", "objects", "robot"]),
    ("grasps", &["progress", "mesh", "geometry", "objects", "robot", "fabrics", "scene"]),
    ("policy", &["geometry", "robot"]),
    ("rollout", &["mesh", "geometry", "objects", "robot", "scene", "grasps", "policy"]),
    ("files", &[]),
    ("configs", &["objects", "policy"]),
    ("dataset-manifest", &["configs"]),
    ("worker-protocol", &[]),
    ("dataset", &["progress", "geometry", "robot", "files", "configs", "dataset-manifest"]),
    (
        "datagen",
        &[
            "progress",
            "mesh",
            "geometry",
            "objects",
            "robot",
            "scene",
            "grasps",
            "files",
            "configs",
            "dataset-manifest",
            "dataset",
        ],
    ),
    ("evaluation", &["objects", "robot", "scene", "rollout", "files"]),
    (
        "imitation",
        &[
            "geometry",
            "objects",
            "robot",
            "scene",
            "grasps",
            "policy",
            "rollout",
            "files",
            "configs",
            "dataset",
            "evaluation",
        ],
    ),
    (
        "server",
        &["mesh", "objects", "robot", "policy", "configs", "dataset-manifest", "worker-protocol"],
    ),
    (
        "ngf-worker",
        &[
            "progress",
            "mesh",
            "objects",
            "robot",
            "scene",
            "grasps",
            "policy",
            "rollout",
            "files",
            "configs",
            "dataset-manifest",
            "dataset",
            "datagen",
            "evaluation",
            "imitation",
            "worker-protocol",
        ],
    ),
    ("ngf", &["server"]),
    (
        "wasm",
        &[
            "progress", "mesh", "geometry", "objects", "robot", "fabrics", "scene", "grasps",
            "policy", "rollout",
        ],
    ),
    ("fuzz", &["mesh", "geometry", "objects", "robot", "policy", "rollout", "server"]),
    ("tidy", &[]),
    ("examples", &[]),
    ("xtask", &[]),
    ("wasm-bindings", &[]),
    ("wasm-test-runner", &[]),
];

/// Libraries that only the listed crates may use. `ngf` limits the number of threads with rayon; crates
/// below `datagen` run on the calling thread, except for the grasp search.
const CONFINED_LIBRARIES: [(&str, &[&str]); 11] = [
    ("rapier3d", &["scene"]),
    ("parry3d", &["geometry"]),
    ("candle-core", &["imitation"]),
    ("gemm", &["imitation"]),
    ("rayon", &["grasps", "datagen", "evaluation", "imitation", "ngf-worker"]),
    ("parquet", &["dataset"]),
    ("arrow-array", &["dataset"]),
    ("sqlx", &["server"]),
    ("object_store", &["server"]),
    ("tokio", &["server", "ngf", "ngf-worker", "fuzz"]),
    ("wasm-bindgen", &["mesh-reader", "wasm"]),
];

/// Manifests of all workspace members by package name.
fn manifests() -> BTreeMap<String, Table> {
    let parse = |folder: &Path| -> Table {
        let path = folder.join("Cargo.toml");
        toml::from_str(&read_to_string(&path).unwrap_or_else(|e| panic!("{path:?}: {e}"))).unwrap()
    };
    let mut folders = Vec::new();
    for member in parse(&root())["workspace"]["members"].as_array().unwrap() {
        match member.as_str().unwrap().strip_suffix("/*") {
            None => folders.push(root().join(member.as_str().unwrap())),
            Some(parent) => {
                let entries = root().join(parent).read_dir().unwrap();
                folders.extend(entries.map(|entry| entry.unwrap().path()));
            }
        }
    }
    let named = |folder: &PathBuf| {
        let manifest = parse(folder);
        (manifest["package"]["name"].as_str().unwrap().to_owned(), manifest)
    };
    folders.iter().map(named).collect()
}

/// Names of all dependencies except dev-dependencies.
fn dependencies(manifest: &Table) -> Vec<String> {
    let names = |table: Option<&Value>| -> Vec<String> {
        table.and_then(Value::as_table).map_or(vec![], |table| table.keys().cloned().collect())
    };
    let mut found = Vec::new();
    for kind in ["dependencies", "build-dependencies"] {
        found.extend(names(manifest.get(kind)));
        for target in manifest.get("target").and_then(Value::as_table).into_iter().flatten() {
            found.extend(names(target.1.get(kind)));
        }
    }
    found
}

#[test]
fn crates_use_only_allowed_crates() {
    let manifests = manifests();
    for name in manifests.keys().filter(|name| *name != "tests") {
        assert!(
            ALLOWED_DEPENDENCIES.iter().any(|(known, _)| known == name),
            "{name} is not in ALLOWED_DEPENDENCIES"
        );
    }
    for (name, allowed) in ALLOWED_DEPENDENCIES {
        let manifest = manifests.get(name).unwrap_or_else(|| panic!("no crate {name}"));
        for used in dependencies(manifest) {
            assert_ne!(used, "tests", "{name} must not use the tests");
            if manifests.contains_key(&used) {
                assert!(allowed.contains(&used.as_str()), "{name} must not use {used}");
            }
        }
    }
}

#[test]
fn confined_libraries_are_used_only_by_listed_crates() {
    for (name, manifest) in &manifests() {
        for used in dependencies(manifest) {
            if let Some((_, homes)) =
                CONFINED_LIBRARIES.iter().find(|(library, _)| *library == used)
            {
                assert!(homes.contains(&name.as_str()), "{name} must not use {used}");
            }
        }
    }
}

#[test]
fn dependency_versions_are_in_the_workspace_manifest() {
    for (name, manifest) in &manifests() {
        for kind in ["dependencies", "dev-dependencies", "build-dependencies"] {
            for (used, how) in manifest.get(kind).and_then(Value::as_table).into_iter().flatten() {
                let shared = how.get("workspace").and_then(Value::as_bool).unwrap_or(false);
                assert!(shared, "{name} specifies its own version of {used}");
            }
        }
    }
}

/// Crates with their versions and features, without development dependencies or with them.
fn features(edges: &str) -> BTreeSet<String> {
    let tree = ["tree", "--workspace", "--locked", "--prefix", "none"];
    let output = Command::new(env!("CARGO"))
        .args(tree)
        .args(["--format", "{p} {f}", "--edges", edges])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    // Repeated crates are marked.
    text.lines().map(|line| line.trim_end_matches(" (*)").to_owned()).collect()
}

/// Otherwise, a build of the executables after one of the tests compiles most crates again.
#[test]
fn development_dependencies_enable_no_features_of_shared_crates() {
    let [without, with] = ["normal,build", "normal,build,dev"].map(features);
    assert!(without.len() > 300, "{} crates", without.len());
    let different: Vec<&String> = without.difference(&with).collect();
    assert!(
        different.is_empty(),
        "name these crates in [dependencies] of tests/Cargo.toml, with all features: {different:?}"
    );
}
