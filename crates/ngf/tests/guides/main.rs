//! The commands in `docs/guides` work. Commands of `ngf` run with small parameters; all other commands name
//! packages, targets, tests and scripts that exist. `cargo test -p ngf -p ngf-worker` also builds the worker
//! executable.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

mod build_commands;
mod small_parameters;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// Root of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A command of a guide.
struct GuideCommand {
    /// File name of the guide.
    guide: String,
    /// Line in the guide, from 1.
    line: usize,
    /// The command without comment and environment variables.
    words: Vec<String>,
}

/// Guide whose dataset and encoder the other guides use.
const FIRST_GUIDE: &str = "train-your-own.md";

/// All commands in `sh` blocks of the guides, those of [`FIRST_GUIDE`] first.
fn guide_commands() -> Vec<GuideCommand> {
    let folder = root().join("docs/guides").read_dir().unwrap();
    let mut paths: Vec<PathBuf> = folder.map(|entry| entry.unwrap().path()).collect();
    paths.sort_by_key(|path| (!path.ends_with(FIRST_GUIDE), path.clone()));
    let mut commands = Vec::new();
    for path in paths {
        let guide = path.file_name().unwrap().to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&path).unwrap();
        commands.extend(parse_commands(&guide, &text));
    }
    commands
}

/// Commands in the `sh` blocks of a Markdown text. `&&` separates commands; ` #` starts a comment.
fn parse_commands(guide: &str, text: &str) -> Vec<GuideCommand> {
    let mut commands = Vec::new();
    let mut language = None;
    for (index, line) in text.lines().map(str::trim).enumerate() {
        if let Some(name) = line.strip_prefix("```") {
            language = if language.is_none() { Some(name) } else { None };
        } else if language == Some("sh") {
            let is_comment = line.starts_with('#');
            let code = if is_comment { "" } else { line.split(" #").next().unwrap_or_default() };
            for command in code.split("&&").filter(|code| !code.trim().is_empty()) {
                let words =
                    command.split_whitespace().skip_while(|word| *word == "UPDATE_EXPECT=1");
                let words = words.map(str::to_owned).collect();
                commands.push(GuideCommand { guide: guide.to_owned(), line: index + 1, words });
            }
        }
    }
    commands
}

impl GuideCommand {
    /// Arguments of `ngf`; `None` for other programs.
    fn ngf_arguments(&self) -> Option<String> {
        let is_ngf = ["ngf", "target/debug/ngf"].contains(&self.words[0].as_str());
        is_ngf.then(|| self.words[1..].join(" "))
    }

    fn location(&self) -> String {
        format!("docs/guides/{}:{}: {}", self.guide, self.line, self.words.join(" "))
    }
}

/// Runs `ngf` with these arguments in a folder.
fn run_ngf(arguments: &str, folder: &Path, location: &str) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ngf"));
    command.args(arguments.split_whitespace()).current_dir(folder);
    let output = command.output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{location}\n`ngf {arguments}` failed:\n{stderr}");
}

/// File or folder that a command writes.
fn output_path(arguments: &str) -> Option<&str> {
    let mut words = arguments.split_whitespace();
    words.find(|word| ["--out", "--contact-sheet"].contains(word))?;
    words.next()
}

/// STL text of a box (mm) with a side of 60 and a height of 120.
fn box_stl() -> String {
    let corner = |i: usize| [60 * (i & 1), 60 * (i >> 1 & 1), 120 * (i >> 2)];
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut text = "solid box\n".to_owned();
    for [a, b, c] in quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]) {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in [a, b, c].map(corner) {
            text += &format!("vertex {x} {y} {z}\n");
        }
        text += "endloop\nendfacet\n";
    }
    text + "endsolid box\n"
}

#[test]
fn ngf_commands_of_the_guides_succeed_with_small_parameters() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mug.stl"), box_stl()).unwrap();
    let start = Instant::now();
    let mut count = 0;
    for command in guide_commands() {
        let Some(arguments) = command.ngf_arguments() else { continue };
        let location = command.location();
        let arguments = small_parameters::fill_placeholders(&command.guide, &arguments)
            .unwrap_or_else(|error| panic!("{location}\n{error}"));
        // Rejects unknown commands, options and values of the command as written.
        run_ngf(&format!("{arguments} --help"), folder.path(), &location);
        if small_parameters::runs_until_stopped(&arguments) {
            continue;
        }
        let (small, before) = (small_parameters::shrink(&arguments), start.elapsed());
        run_ngf(&small, folder.path(), &location);
        if let Some(path) = output_path(&small) {
            assert!(folder.path().join(path).exists(), "{location}\n{path} was not written");
        }
        println!("{:5.1} s  ngf {small}", (start.elapsed() - before).as_secs_f64());
        count += 1;
    }
    println!("{count} commands in {:.1} s", start.elapsed().as_secs_f64());
    assert!(count >= 10, "only {count} commands");
}

#[test]
fn other_commands_of_the_guides_name_existing_targets() {
    let workspace = build_commands::Workspace::load(&root());
    let commands = guide_commands();
    let others = commands.iter().filter(|command| command.ngf_arguments().is_none());
    let errors: Vec<String> = others
        .filter_map(|command| {
            let error = workspace.check(&command.words).err()?;
            Some(format!("{}\n{error}", command.location()))
        })
        .collect();
    assert!(errors.is_empty(), "{}", errors.join("\n"));
}

#[test]
fn commands_are_read_from_sh_blocks_without_comments() {
    let text = "a\n   ```sh\n   cargo build && ngf x  # note\n   # note\n   UPDATE_EXPECT=1 cargo test\n   ```\n\
                ```toml\nname = 1\n```\n";
    let found: Vec<(usize, String)> = parse_commands("guide.md", text)
        .into_iter()
        .map(|command| (command.line, command.words.join(" ")))
        .collect();
    let wanted = [(3, "cargo build"), (3, "ngf x"), (5, "cargo test")];
    assert_eq!(found, wanted.map(|(line, text)| (line, text.to_owned())));
}
