//! Prose is plain technical English: words of `prose_words.txt` are rejected in comments, strings, Markdown
//! and HTML.

use crate::root;
use regex::{Captures, Regex, RegexBuilder};
use std::fs::read_to_string;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Folders without text of the project.
const SKIPPED_FOLDERS: [&str; 5] = ["target", "node_modules", "dist", "engine", "sim"];

/// Text files of the repository with one of the extensions, without [`SKIPPED_FOLDERS`] and hidden ones.
fn repository_files(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let entries = folder.read_dir().unwrap_or_else(|e| panic!("{folder:?}: {e}"));
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let of_entry = |path: PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name.starts_with('.') || SKIPPED_FOLDERS.contains(&name.as_str()) {
            return Vec::new();
        }
        if path.is_dir() {
            return repository_files(&path, extensions);
        }
        let extension = path.extension().unwrap_or_default().to_string_lossy().into_owned();
        if extensions.contains(&extension.as_str()) { vec![path] } else { Vec::new() }
    };
    paths.into_iter().flat_map(of_entry).collect()
}

/// Comment block, string literal or document.
struct Passage {
    /// Line number of the first line.
    line: usize,
    text: String,
}

/// Replaces matches by their line breaks, so that line numbers stay valid.
fn blank(pattern: &Regex, text: &str) -> String {
    let blanked =
        pattern.replace_all(text, |found: &Captures| "\n".repeat(found[0].matches('\n').count()));
    blanked.into_owned()
}

fn regex(pattern: &str) -> Regex {
    Regex::new(pattern).unwrap()
}

/// Fenced blocks and inline code of Markdown and doc comments.
static CODE_SPANS: LazyLock<Regex> = LazyLock::new(|| regex(r"(?s)```.*?```|`[^`\n]*`"));

/// Comment delimiters at the start of a line.
static COMMENT_MARKERS: LazyLock<Regex> =
    LazyLock::new(|| regex(r"(?m)^[ \t]*(?://[/!]?|/\*+|\*+/?)"));

/// Comments; adjacent line comments match as one.
const COMMENTS: &str = r"//[^\n]*(?:\n[ \t]*//[^\n]*)*|/\*.*?\*/";

static RUST_TOKENS: LazyLock<Regex> = LazyLock::new(|| {
    let strings = r###"\br"[^"]*"|\br#".*?"#|\br##".*?"##|"(?:\\.|[^"\\])*""###;
    let chars = r"'(?:\\[^\n]{1,8}?|[^'\\])'";
    regex(&format!("(?s){COMMENTS}|{strings}|{chars}"))
});

static SCRIPT_TOKENS: LazyLock<Regex> = LazyLock::new(|| {
    let strings = r#""(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'|`(?:\\.|[^`\\])*`"#;
    regex(&format!("(?s){COMMENTS}|{strings}"))
});

/// Comment blocks and string literals of Rust, TypeScript or JavaScript.
fn source_passages(source: &str, tokens: &Regex) -> Vec<Passage> {
    let passage = |token: regex::Match| {
        let text = token.as_str();
        let line = 1 + source[..token.start()].matches('\n').count();
        let text = if text.starts_with('/') {
            blank(&CODE_SPANS, &COMMENT_MARKERS.replace_all(text, ""))
        } else {
            let content = text.trim_start_matches(['r', '#']);
            content.trim_matches(['"', '\'', '`', '#']).replace("\\\n", "\n")
        };
        Passage { line, text: text.trim_end().to_owned() }
    };
    tokens.find_iter(source).map(passage).collect()
}

/// Passages of a file by its extension.
fn passages(extension: &str, text: &str) -> Vec<Passage> {
    match extension {
        "rs" => source_passages(text, &RUST_TOKENS),
        "ts" | "js" => source_passages(text, &SCRIPT_TOKENS),
        "md" => vec![Passage { line: 1, text: blank(&CODE_SPANS, text) }],
        _ => vec![Passage { line: 1, text: text.to_owned() }],
    }
}

/// Rules of `prose_words.txt`.
struct ProseRules {
    prose: Vec<Regex>,
    allow: Vec<Regex>,
    code: Vec<Regex>,
    what: Regex,
}

impl ProseRules {
    fn load() -> Self {
        let (mut prose, mut allow, mut code) = (Vec::new(), Vec::new(), Vec::new());
        let mut section = "";
        for line in include_str!("prose_words.txt").lines().map(str::trim) {
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            if line.starts_with('[') {
                section = line;
                continue;
            }
            let words = line.replace(' ', r"\s+");
            let compile = |pattern: String, ignores_case: bool| {
                RegexBuilder::new(&pattern).case_insensitive(ignores_case).build().unwrap()
            };
            match section {
                "[prose]" => prose.push(compile(format!(r"\b(?:{words})\b"), true)),
                "[allow]" => allow.push(compile(format!(r"^(?:{words})"), true)),
                "[code]" => code.push(compile(format!(r"\b(?:{words})"), false)),
                _ => panic!("prose_words.txt: {line} is in no section"),
            }
        }
        let what = regex(r"(?:^\s*|[.!?:;|>#]\s+|\n\s*[-*]\s+)(What\s+[a-z])");
        Self { prose, allow, code, what }
    }

    /// Byte offsets of rejected words and phrases.
    fn rejected_words(&self, text: &str) -> Vec<usize> {
        let is_allowed = |at: &usize| self.allow.iter().any(|rule| rule.is_match(&text[*at..]));
        let found = self.prose.iter().flat_map(|rule| rule.find_iter(text));
        found.map(|found| found.start()).filter(|at| !is_allowed(at)).collect()
    }

    /// Byte offsets of sentences that begin with "What" and are not questions.
    fn clauses_with_what(&self, text: &str) -> Vec<usize> {
        let starts = self.what.captures_iter(text).map(|found| found.get(1).unwrap().start());
        let is_question = |at: &usize| {
            let end = text[*at..].find(['.', '?', '!']);
            end.is_some_and(|end| text[*at + end..].starts_with('?'))
        };
        starts.filter(|at| !is_question(at)).collect()
    }
}

/// The line of `text` that contains the byte offset.
fn line_at(text: &str, at: usize) -> &str {
    let start = text[..at].rfind('\n').map_or(0, |end| end + 1);
    text[start..].lines().next().unwrap_or_default().trim()
}

#[test]
fn prose_is_plain_technical_english() {
    let rules = ProseRules::load();
    let mut hits = Vec::new();
    let mut num_files = 0;
    for file in repository_files(&root(), &["rs", "ts", "js", "md", "html"]) {
        let source = read_to_string(&file).unwrap();
        let extension = file.extension().unwrap_or_default().to_string_lossy();
        let name = file.strip_prefix(root()).unwrap().display().to_string();
        num_files += 1;
        let mut report = |passage: &Passage, at: usize| {
            let line = passage.line + passage.text[..at].matches('\n').count();
            hits.push(format!("{name}:{line}: {}", line_at(&passage.text, at)));
        };
        for passage in passages(&extension, &source) {
            let words = rules.rejected_words(&passage.text);
            let sentences = rules.clauses_with_what(&passage.text);
            words.into_iter().chain(sentences).for_each(|at| report(&passage, at));
        }
        if matches!(&*extension, "rs" | "ts" | "js") {
            let code = Passage { line: 1, text: source };
            for rule in &rules.code {
                rule.find_iter(&code.text).for_each(|found| report(&code, found.start()));
            }
        }
    }
    println!("{}\n{} hits in {num_files} files", hits.join("\n"), hits.len());
    assert!(num_files > 300, "only {num_files} files");
    assert!(hits.is_empty(), "{} passages with words of prose_words.txt, see above", hits.len());
}

#[test]
fn passages_are_comments_and_strings_with_line_numbers() {
    let source = concat!(
        "// One\n/// `two` three\n",
        "let a = 'x'; let b = \"f\\\"g\";\n",
        "let c: &'a str = r#\"h\"i\"#;\n"
    );
    let found = source_passages(source, &RUST_TOKENS);
    let found: Vec<(usize, &str)> = found.iter().map(|p| (p.line, p.text.as_str())).collect();
    assert_eq!(found, [(1, " One\n  three"), (3, "x"), (3, "f\\\"g"), (4, "h\"i")]);
    let found = source_passages("f(`a ${b}`, 'c'); // d\n", &SCRIPT_TOKENS);
    let found: Vec<&str> = found.iter().map(|passage| passage.text.as_str()).collect();
    assert_eq!(found, ["a ${b}", "c", " d"]);
}

#[test]
fn clause_with_what_is_rejected_unless_it_is_a_question() {
    let rules = ProseRules::load();
    assert_eq!(
        rules.clauses_with_what("Is it so? What is it? Yes. What\nremains is this."),
        [27_usize]
    );
    assert!(rules.clauses_with_what("Do what is needed. Whatsoever.").is_empty());
}

#[test]
fn rejected_word_is_found_across_line_breaks_unless_allowed() {
    let rules = ProseRules::load();
    assert_eq!(rules.rejected_words(&["start a", "new, so\nma", "ny"].concat()), [6_usize, 12]);
    assert!(rules.rejected_words("it is no longer used").is_empty());
}
