//! Checks commands of `cargo`, `cargo xtask` and `python` against the workspace, without running them.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Packages and project commands of the workspace.
pub(super) struct Workspace {
    root: PathBuf,
    packages: Vec<Package>,
    /// Sources of `cargo xtask` that declare its commands.
    xtask: String,
}

/// A package with its targets.
struct Package {
    name: String,
    folder: PathBuf,
    /// Kind and name of each target.
    targets: Vec<(String, String)>,
}

impl Workspace {
    /// Reads the packages and the sources of `cargo xtask`.
    pub(super) fn load(root: &Path) -> Self {
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["metadata", "--no-deps", "--offline", "--format-version", "1"]);
        let output = cargo.current_dir(root).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
        let packages = metadata["packages"].as_array().unwrap().iter().map(Package::parse);
        let read = |file: &str| std::fs::read_to_string(root.join("xtask/src").join(file)).unwrap();
        let xtask = read("main.rs") + &read("checks.rs");
        Self { root: root.to_owned(), packages: packages.collect(), xtask }
    }

    /// Checks that everything that a command names exists.
    pub(super) fn check(&self, words: &[String]) -> Result<(), String> {
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        match words.as_slice() {
            ["cargo", "xtask", command, options @ ..] => {
                [&[*command], options].concat().iter().try_for_each(|word| self.check_xtask(word))
            }
            ["cargo", command @ ("build" | "run" | "test"), options @ ..] => {
                self.check_cargo(command, options)
            }
            ["python", script] if self.root.join(script).is_file() => Ok(()),
            ["python", script, ..] => Err(format!("no script {script} without arguments")),
            _ => Err("neither run nor checked: add the program to this test".to_owned()),
        }
    }

    /// Checks that a command or value of `cargo xtask` is a variant of its command line.
    fn check_xtask(&self, word: &str) -> Result<(), String> {
        let mut letters = word.chars();
        let first = letters.next().filter(char::is_ascii_lowercase).map(|c| c.to_ascii_uppercase());
        let variant: String = first.into_iter().chain(letters).collect();
        let is_variant = |line: &str| {
            let rest = line.strip_prefix("    ").and_then(|line| line.strip_prefix(&variant));
            rest.is_some_and(|rest| rest.starts_with(['(', ',', ' ']))
        };
        let is_known = !variant.is_empty() && self.xtask.lines().any(is_variant);
        is_known.then_some(()).ok_or_else(|| format!("cargo xtask has no {word}"))
    }

    /// Checks packages, targets and the test filter of a cargo command.
    fn check_cargo(&self, command: &str, options: &[&str]) -> Result<(), String> {
        let selected = self.selected_packages(options)?;
        let mut options = options.iter();
        while let Some(option) = options.next() {
            match *option {
                "-p" => {
                    options.next();
                }
                "--bin" | "--example" => {
                    let name = options.next().ok_or_else(|| format!("{option} needs a name"))?;
                    let kind = &option[2..];
                    if !selected.iter().any(|package| package.has_target(kind, name)) {
                        return Err(format!("no {kind} named {name}"));
                    }
                }
                filter if command == "test" && !filter.starts_with('-') => {
                    let file = format!("{filter}.rs");
                    if !selected.iter().any(|package| contains_file(&package.folder, &file)) {
                        return Err(format!("no test module {filter} in the selected packages"));
                    }
                }
                unknown => return Err(format!("{unknown} is not checked by this test")),
            }
        }
        Ok(())
    }

    /// Packages of the options `-p`; all packages without such an option.
    fn selected_packages(&self, options: &[&str]) -> Result<Vec<&Package>, String> {
        let names: Vec<&str> =
            options.windows(2).filter_map(|pair| (pair[0] == "-p").then_some(pair[1])).collect();
        if names.is_empty() {
            return Ok(self.packages.iter().collect());
        }
        let find = |name: &&str| {
            let package = self.packages.iter().find(|package| package.name == *name);
            package.ok_or_else(|| format!("no package named {name}"))
        };
        names.iter().map(find).collect()
    }
}

impl Package {
    /// Parses an entry of `cargo metadata`.
    fn parse(entry: &Value) -> Self {
        let text = |value: &Value| value.as_str().unwrap().to_owned();
        let targets = entry["targets"].as_array().unwrap().iter();
        Self {
            name: text(&entry["name"]),
            folder: Path::new(&text(&entry["manifest_path"])).parent().unwrap().to_owned(),
            targets: targets
                .map(|target| (text(&target["kind"][0]), text(&target["name"])))
                .collect(),
        }
    }

    fn has_target(&self, kind: &str, name: &str) -> bool {
        self.targets.iter().any(|(of_kind, of_name)| of_kind == kind && of_name == name)
    }
}

/// Whether the sources or tests of a package contain a file of this name.
fn contains_file(package: &Path, name: &str) -> bool {
    fn is_below(folder: &Path, name: &str) -> bool {
        let Ok(entries) = folder.read_dir() else { return false };
        let mut paths = entries.map(|entry| entry.unwrap().path());
        paths.any(|path| path.ends_with(name) || is_below(&path, name))
    }
    ["src", "tests"].iter().any(|folder| is_below(&package.join(folder), name))
}

#[test]
fn commands_that_name_nothing_are_rejected() {
    let workspace = Workspace::load(&super::root());
    let check = |command: &str| {
        workspace.check(&command.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
    };
    for command in [
        "cargo test -p server openapi",
        "cargo run -p examples --example 02_fabric_plan",
        "cargo xtask stress jobs",
    ] {
        assert_eq!(check(command), Ok(()), "{command}");
    }
    for (command, error) in [
        ("cargo test -p teapot", "no package named teapot"),
        ("cargo test -p server teapot", "no test module teapot"),
        ("cargo run -p examples --example teapot", "no example named teapot"),
        ("cargo build --bin teapot", "no bin named teapot"),
        ("cargo xtask teapot", "cargo xtask has no teapot"),
        ("cargo xtask stress teapot", "cargo xtask has no teapot"),
        ("cargo build --teapot", "--teapot is not checked"),
        ("python teapot.py", "no script teapot.py"),
        ("make all", "neither run nor checked"),
    ] {
        let found = check(command).expect_err(command);
        assert!(found.contains(error), "{command}: {found}");
    }
}
