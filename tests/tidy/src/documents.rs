//! Paths in the documents exist.

use crate::root;
use std::fs::read_to_string;

/// Inline code of Markdown: text between single backticks, outside fenced blocks.
fn inline_code(text: &str) -> Vec<&str> {
    let prose = text.split("```").step_by(2);
    prose
        .flat_map(|part| part.lines().flat_map(|line| line.split('`').skip(1).step_by(2)))
        .collect()
}

/// Whether inline code is a path: it contains a slash or has a known file extension.
fn is_path(word: &str) -> bool {
    let has_ending = [".md", ".rs", ".toml", ".json", ".lock"].iter().any(|e| word.ends_with(e));
    let is_plain = !word.contains(char::is_whitespace) && !word.contains("://");
    is_plain && !word.starts_with('/') && !word.contains('*') && (word.contains('/') || has_ending)
}

/// Build outputs, absent in a fresh clone.
const BUILD_OUTPUTS: [&str; 2] = ["target", "web/dist"];

/// Parts of example paths that the reader of a guide replaces.
const PLACEHOLDERS: [&str; 2] = ["NAME", "FAMILY"];

#[test]
fn paths_in_the_documents_exist() {
    for document in [
        "ARCHITECTURE.md",
        "CONTRIBUTING.md",
        "README.md",
        "assets/README.md",
        "docs/crates.md",
        "docs/departures.md",
        "docs/results.md",
        "docs/guides/add-a-fabric-term.md",
        "docs/guides/add-a-hand.md",
        "docs/guides/add-a-job.md",
        "docs/guides/add-a-mesh-format.md",
        "docs/guides/add-a-policy.md",
        "docs/guides/add-an-object.md",
        "docs/guides/train-your-own.md",
    ] {
        let text = read_to_string(root().join(document)).unwrap();
        let paths: Vec<&str> =
            inline_code(&text).into_iter().filter(|word| is_path(word)).collect();
        assert!(!paths.is_empty(), "no paths in {document}");
        // Targets of Markdown links are also paths.
        let links = text.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next());
        let links = links.filter(|link| !link.is_empty());
        let exists_near = |path: &str| root().join(document).with_file_name(path).exists();
        for link in links.filter(|link| !link.contains("://")) {
            assert!(exists_near(link), "{document} links to {link}, which does not exist");
        }
        let is_output = |path: &str| BUILD_OUTPUTS.iter().any(|output| path.starts_with(output));
        let is_example = |path: &str| PLACEHOLDERS.iter().any(|name| path.contains(name));
        for path in paths.into_iter().filter(|path| !is_output(path) && !is_example(path)) {
            // Relative to the repository root or to the document.
            let exists = root().join(path).exists() || exists_near(path);
            assert!(exists, "{document} names {path}, which does not exist");
        }
    }
}

#[test]
fn crates_document_lists_and_links_every_crate() {
    let text = read_to_string(root().join("docs/crates.md")).unwrap();
    let front_page = read_to_string(root().join("examples/lib.rs")).unwrap();
    let folders = root().join("crates").read_dir().unwrap();
    let paths = folders.map(|entry| entry.unwrap().path());
    for folder in paths.chain(["server", "wasm"].map(|name| root().join(name))) {
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        let source = if folder.join("src/lib.rs").exists() { "lib.rs" } else { "main.rs" };
        let folder = folder.strip_prefix(root()).unwrap().display().to_string();
        let page = format!("//! [{name}]: ../{}/index.html\n", name.replace('-', "_"));
        assert!(text.contains(&format!("\n| [{name}] |")), "no row of {name} in docs/crates.md");
        let link = format!("\n[{name}]: ../{folder}/src/{source}\n");
        assert!(text.contains(&link), "docs/crates.md lacks the line {link}");
        assert!(front_page.contains(&page), "examples/lib.rs lacks the line {page}");
    }
}

#[test]
fn inline_code_is_a_path_when_it_has_slash_or_extension() {
    let text = "a `b/c.rs` d `e f/g`\n```\n`h/i`\n```\n`j.md` `/k/l` `m`";
    let paths: Vec<&str> = inline_code(text).into_iter().filter(|word| is_path(word)).collect();
    assert_eq!(paths, ["b/c.rs", "j.md"]);
}
