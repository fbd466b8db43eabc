//! `check --fast`: format, lints, documentation and unit tests of the packages whose files changed.
//!
//! Packages are selected with `-p`, so cargo may select fewer features of their dependencies than `check` does,
//! and compiles these once more, in the first run.

use crate::stages::StageRunner;
use crate::tools;
use crate::workspace::{Workspace, output_of, run};
use anyhow::Result;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Assets that a package embeds, by folder.
const ASSETS: [(&str, &str); 4] = [
    ("assets/grasps", "grasps"),
    ("assets/objects", "objects"),
    ("assets/robot", "robot"),
    ("assets/scene", "scene"),
];

/// Packages whose tests need a browser, a fuzzer or minutes.
const ONLY_LINTED: [&str; 4] = ["fuzz", "tests", "wasm", "wasm-test-runner"];

/// Runs the checks of files that differ from the revision `since`, including untracked files.
pub(crate) fn run_checks(workspace: &Workspace, since: &str) -> Result<bool> {
    let files = changed_files(workspace, since)?;
    let all_packages = workspace_packages(workspace)?;
    let packages = changed_packages(&all_packages, &files);
    println!("changed: {}", packages.iter().cloned().collect::<Vec<_>>().join(", "));
    let select = |skip: &[&str]| -> Vec<String> {
        let kept = packages.iter().filter(|name| !skip.contains(&name.as_str()));
        kept.flat_map(|name| ["-p".to_owned(), name.clone()]).collect()
    };
    let mut stages = StageRunner::new();
    stages.stage("format", |_| run(&mut workspace.cargo(&["fmt", "--all", "--check"])));
    // The rules for documents and prose concern every change.
    stages.stage("tidy", |stages| stages.count(&mut workspace.cargo(&["test", "-p", "tidy"])));
    let linted = select(&["tidy", "wasm-test-runner"]);
    if !linted.is_empty() {
        stages.stage("lints", |_| {
            let mut clippy = workspace.cargo(&["clippy", "-q", "--all-targets"]);
            run(clippy.args(&linted).args(["--", "-D", "warnings"]))
        });
        stages.stage("docs", |_| {
            let mut doc = workspace.cargo(&["doc", "-q", "--no-deps"]);
            run(doc.args(&linted).env("RUSTDOCFLAGS", "-D warnings"))
        });
    }
    let tested = select(&[&["tidy"], &ONLY_LINTED[..]].concat());
    if !tested.is_empty() {
        stages.stage("unit tests", |stages| {
            let mut cargo = workspace.cargo(&["test", "--no-fail-fast", "--bins"]);
            // cargo rejects `--lib` if no selected package has a library.
            let has_library = |(name, folder): &Package| {
                tested.contains(name) && workspace.root.join(folder).join("src/lib.rs").exists()
            };
            if all_packages.iter().any(has_library) {
                cargo.arg("--lib");
            }
            stages.count(cargo.args(&tested))
        });
    }
    if files.iter().any(|file| file.starts_with("web")) {
        stages.stage("types", |_| {
            tools::npm_packages(workspace, "packages", &workspace.web())?;
            run(&mut workspace.npm(&workspace.web(), &["run", "--silent", "typecheck"]))
        });
    }
    Ok(stages.report())
}

/// Files that differ from a revision, relative to the root.
fn changed_files(workspace: &Workspace, since: &str) -> Result<BTreeSet<PathBuf>> {
    let diff = output_of(&mut workspace.command("git", &["diff", "--name-only", since, "--"]))?;
    let untracked = ["ls-files", "--others", "--exclude-standard"];
    let untracked = output_of(&mut workspace.command("git", &untracked))?;
    Ok(diff.lines().chain(untracked.lines()).map(PathBuf::from).collect())
}

/// A workspace package: its name and its folder relative to the root.
type Package = (String, PathBuf);

fn workspace_packages(workspace: &Workspace) -> Result<Vec<Package>> {
    #[derive(Deserialize)]
    struct Metadata {
        packages: Vec<MetadataPackage>,
    }
    #[derive(Deserialize)]
    struct MetadataPackage {
        name: String,
        manifest_path: PathBuf,
    }
    let args = ["metadata", "--no-deps", "--offline", "--format-version", "1"];
    let metadata: Metadata = serde_json::from_str(&output_of(&mut workspace.cargo(&args))?)?;
    let relative = |package: MetadataPackage| {
        let folder = package.manifest_path.parent().unwrap_or(Path::new(""));
        (package.name, folder.strip_prefix(&workspace.root).unwrap_or(folder).to_owned())
    };
    Ok(metadata.packages.into_iter().map(relative).collect())
}

/// Packages of changed files: each file belongs to the package with the innermost folder.
fn changed_packages(packages: &[Package], files: &BTreeSet<PathBuf>) -> BTreeSet<String> {
    let owner = |file: &PathBuf| {
        let assets = ASSETS.iter().find(|(folder, _)| file.starts_with(folder));
        let containing = packages.iter().filter(|(_, folder)| file.starts_with(folder));
        let innermost = containing.max_by_key(|(_, folder)| folder.components().count());
        assets.map(|(_, name)| (*name).to_owned()).or(innermost.map(|(name, _)| name.clone()))
    };
    files.iter().filter_map(owner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_belongs_to_package_with_innermost_folder() {
        let package = |name: &str, folder: &str| (name.to_owned(), PathBuf::from(folder));
        let packages = [
            package("tests", "tests"),
            package("tidy", "tests/tidy"),
            package("scene", "crates/scene"),
            package("scene-tools", "crates/scene-tools"),
        ];
        let of = |files: &[&str]| -> Vec<String> {
            let files = files.iter().map(PathBuf::from).collect();
            changed_packages(&packages, &files).into_iter().collect()
        };
        assert_eq!(of(&["tests/tidy/src/lib.rs"]), ["tidy"]);
        assert_eq!(of(&["tests/tests/main.rs", "crates/scene/src/a.rs"]), ["scene", "tests"]);
        assert_eq!(of(&["assets/scene/scene.toml", "README.md"]), ["scene"]);
        assert_eq!(of(&["web/src/a.ts"]), [""; 0]);
    }
}
