//! Which crate may use which, how much of the page is TypeScript, and that the paths which the documents name exist.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use std::collections::BTreeMap;
use std::fs::read_to_string;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Our own crates that each crate may use at run time.
///
/// ARCHITECTURE.md tells what each does. `policy`, `rollout` and what lies below them reach the
/// browser, so candle stays above. `server` knows from `dataset` and `imitation` what can be asked of a job; the work
/// is done by `ngf`, a process of its own.
const MAY_USE: [(&str, &[&str]); 15] = [
    ("geometry", &[]),
    ("robot", &["geometry"]),
    ("fabrics", &["geometry", "robot"]),
    ("scene", &["geometry", "robot"]),
    ("grasps", &["geometry", "robot", "fabrics", "scene"]),
    ("policy", &["geometry", "robot"]),
    ("rollout", &["geometry", "robot", "fabrics", "scene", "grasps", "policy"]),
    ("dataset", &["geometry", "robot", "fabrics", "scene", "grasps"]),
    (
        "imitation",
        &["geometry", "robot", "fabrics", "scene", "grasps", "policy", "rollout", "dataset"],
    ),
    (
        "server",
        &[
            "geometry",
            "robot",
            "fabrics",
            "scene",
            "grasps",
            "policy",
            "rollout",
            "dataset",
            "imitation",
        ],
    ),
    (
        "ngf",
        &[
            "geometry",
            "robot",
            "fabrics",
            "scene",
            "grasps",
            "policy",
            "rollout",
            "dataset",
            "imitation",
            "server",
        ],
    ),
    ("wasm", &["geometry", "robot", "fabrics", "scene", "grasps", "policy", "rollout"]),
    ("fuzz", &["geometry", "robot", "policy", "rollout", "server"]),
    ("xtask", &[]),
    ("wasm-test-runner", &[]),
];

/// The only crates that may use a library whose types stay in one place. The command line caps
/// threads with rayon; everything below `dataset` runs on the thread it is called on.
const KEPT_IN: [(&str, &[&str]); 11] = [
    ("rapier3d", &["scene"]),
    ("parry3d", &["geometry"]),
    ("candle-core", &["imitation"]),
    ("gemm", &["imitation"]),
    ("rayon", &["dataset", "imitation", "ngf"]),
    ("parquet", &["dataset"]),
    ("arrow-array", &["dataset"]),
    ("sqlx", &["server"]),
    ("object_store", &["server"]),
    ("tokio", &["server", "ngf", "fuzz"]),
    ("wasm-bindgen", &["wasm"]),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Every manifest of the workspace by package name, its members found as cargo finds them.
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

/// Names of the dependencies in all tables that end up in what is shipped.
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
fn crates_use_what_they_may() {
    let manifests = manifests();
    for name in manifests.keys().filter(|name| *name != "tests") {
        assert!(MAY_USE.iter().any(|(known, _)| known == name), "{name} is not in the table");
    }
    for (name, allowed) in MAY_USE {
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
fn heavy_libraries_stay_in_their_crates() {
    for (name, manifest) in &manifests() {
        for used in dependencies(manifest) {
            if let Some((_, homes)) = KEPT_IN.iter().find(|(library, _)| *library == used) {
                assert!(homes.contains(&name.as_str()), "{name} must not use {used}");
            }
        }
    }
}

#[test]
fn versions_stand_in_one_place() {
    for (name, manifest) in &manifests() {
        for kind in ["dependencies", "dev-dependencies", "build-dependencies"] {
            for (used, how) in manifest.get(kind).and_then(Value::as_table).into_iter().flatten() {
                let shared = how.get("workspace").and_then(Value::as_bool).unwrap_or(false);
                assert!(shared, "{name} names its own version of {used}");
            }
        }
    }
}

/// The files with this ending in a folder and below.
fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let entries = folder.read_dir().unwrap_or_else(|e| panic!("{folder:?}: {e}"));
    let of_entry = |path: PathBuf| match path.is_dir() {
        true => files(&path, ending),
        false if path.extension().is_some_and(|found| found == ending) => vec![path],
        false => Vec::new(),
    };
    entries.flat_map(|entry| of_entry(entry.unwrap().path())).collect()
}

/// Their lines.
fn lines(folder: &Path, ending: &str) -> usize {
    files(folder, ending).iter().map(|file| read_to_string(file).unwrap().lines().count()).sum()
}

/// Folders of what runs in the browser.
fn in_the_browser() -> impl Iterator<Item = PathBuf> {
    let (_, below) = MAY_USE.iter().find(|(name, _)| *name == "wasm").unwrap();
    let crates = below.iter().map(|name| root().join("crates").join(name).join("src"));
    crates.chain([root().join("wasm/src")])
}

/// Functions of the system's mathematics, which differ from machine to machine; `libm` has them all.
const OF_THE_SYSTEM: [&str; 20] = [
    "sin()",
    "cos()",
    "tan()",
    "sin_cos()",
    "asin()",
    "acos()",
    "atan()",
    "atan2(",
    "sinh()",
    "cosh()",
    "tanh()",
    "exp()",
    "exp2()",
    "ln()",
    "log2()",
    "log10()",
    "cbrt()",
    "powf(",
    "hypot(",
    "mul_add(",
];

/// What a browser's worker has not, or has otherwise.
const OF_A_COMPUTER: [&str; 4] = ["std::fs", "std::thread", "std::time", "std::env::"];

#[test]
fn what_must_come_out_the_same_everywhere_asks_no_system_for_mathematics() {
    let mut looked_at = 0;
    for file in in_the_browser().flat_map(|folder| files(&folder, "rs")) {
        let text = read_to_string(&file).unwrap();
        // Tests may.
        let shipped = text.split("#[cfg(test)]").next().unwrap_or_default();
        looked_at += 1;
        for name in OF_THE_SYSTEM {
            assert!(!shipped.contains(&format!(".{name}")), "{file:?} calls .{name}");
        }
        for name in OF_A_COMPUTER {
            assert!(!shipped.contains(name), "{file:?} uses {name}");
        }
    }
    assert!(looked_at > 100, "{looked_at} files");
}

/// TypeScript holds views and controls: what decides anything is in Rust, where it is tested without a browser.
#[test]
fn the_page_is_mostly_rust() {
    let rust: usize = in_the_browser().map(|folder| lines(&folder, "rs")).sum();
    let script = lines(&root().join("web/src"), "ts");
    let share = 100 * script / (script + rust);
    println!("{script} lines of TypeScript, {rust} of Rust: {share} %");
    assert!(script > 0 && share < 35, "{share} % of the page's lines are TypeScript");
}

/// What the page is built from goes with it, and its licence wants to be named.
#[test]
fn what_the_page_is_built_from_is_named() {
    let package = read_to_string(root().join("web/package.json")).unwrap();
    let package: serde_json::Value = serde_json::from_str(&package).unwrap();
    let notice = read_to_string(root().join("NOTICE")).unwrap().to_lowercase();
    let names: Vec<&String> = package["dependencies"].as_object().unwrap().keys().collect();
    assert!(!names.is_empty());
    for name in names {
        let name = name.trim_start_matches("@fontsource-variable/");
        assert!(notice.contains(name), "NOTICE does not name {name}");
    }
}

/// Text between single backticks, outside fenced blocks.
fn in_backticks(text: &str) -> Vec<&str> {
    let prose = text.split("```").step_by(2);
    prose
        .flat_map(|part| part.lines().flat_map(|line| line.split('`').skip(1).step_by(2)))
        .collect()
}

/// Whether a word in backticks is meant as a path: it has a slash, or the ending of a file.
fn is_path(word: &str) -> bool {
    let has_ending = [".md", ".rs", ".toml", ".json", ".lock"].iter().any(|e| word.ends_with(e));
    let is_plain = !word.contains(char::is_whitespace) && !word.contains("://");
    is_plain && !word.starts_with('/') && !word.contains('*') && (word.contains('/') || has_ending)
}

/// Folders of what is built, which a fresh clone has not.
const BUILT: [&str; 2] = ["target", "web/dist"];

#[test]
fn paths_in_the_documents_exist() {
    for document in [
        "ARCHITECTURE.md",
        "README.md",
        "assets/README.md",
        "docs/departures.md",
        "docs/results.md",
    ] {
        let text = read_to_string(root().join(document)).unwrap();
        let paths: Vec<&str> =
            in_backticks(&text).into_iter().filter(|word| is_path(word)).collect();
        assert!(!paths.is_empty(), "{document} names no path");
        // Links of Markdown lead to files too.
        let links = text.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next());
        let links = links.filter(|link| !link.is_empty());
        let near = |path: &str| root().join(document).with_file_name(path).exists();
        for link in links.filter(|link| !link.contains("://")) {
            assert!(near(link), "{document} links to {link}, which does not exist");
        }
        let is_built = |path: &str| BUILT.iter().any(|built| path.starts_with(built));
        for path in paths.into_iter().filter(|path| !is_built(path)) {
            // From the root, or from where the document lies.
            let is_there = root().join(path).exists() || near(path);
            assert!(is_there, "{document} names {path}, which does not exist");
        }
    }
}

#[test]
fn words_in_backticks_are_told_apart() {
    let text = "a `b/c.rs` d `e f/g`\n```\n`h/i`\n```\n`j.md` `/k/l` `m`";
    let paths: Vec<&str> = in_backticks(text).into_iter().filter(|word| is_path(word)).collect();
    assert_eq!(paths, ["b/c.rs", "j.md"]);
}
