//! Small parameters for the commands of the guides: values of placeholders, short runs.

/// Values of the placeholders of each guide.
const PLACEHOLDERS: [(&str, &str, &str); 7] = [
    ("add-a-mesh-format.md", "FILE", "mug.stl"),
    ("add-a-policy.md", "DATA", "data"),
    ("add-a-policy.md", "DIR", "policies"),
    ("add-a-policy.md", "ENCODER", "model"),
    ("add-a-policy.md", "NAME", "mlp-pcd"),
    ("add-a-policy.md", "OUT", "comparison"),
    ("add-an-object.md", "NAME", "soup_can"),
];

/// Replaced values of options.
const VALUES: [(&str, &str); 3] = [("--preset", "smoke"), ("--steps", "20"), ("--attempts", "1")];

/// Options added to the commands that begin with these words, unless the command has them.
const ADDED_OPTIONS: [(&str, &str, &str); 6] = [
    ("compare", "--objects", "sugar_box"),
    ("grasps", "--effort", "quick"),
    ("train encoder", "--batch", "8"),
    ("train encoder", "--steps", "20"),
    ("train policy", "--batch", "8"),
    ("validate", "--samples", "2"),
];

/// Commands that run until they are stopped; only their options are checked.
const SERVERS: [&str; 1] = ["serve"];

/// The grasp search for a mesh takes minutes; built-in objects have stored grasps.
const MESH_OF_DATASET: (&str, &str) = ("--mesh mug.stl --mass 0.25", "--object sugar_box");

/// Replaces the placeholders of a guide; fails if a word in capitals remains.
pub(super) fn fill_placeholders(guide: &str, arguments: &str) -> Result<String, String> {
    let mut filled = arguments.to_owned();
    for (_, name, value) in PLACEHOLDERS.iter().filter(|(of, ..)| *of == guide) {
        filled = filled.replace(name, value);
    }
    let is_placeholder =
        |word: &&str| word.len() > 1 && word.bytes().all(|byte| byte.is_ascii_uppercase());
    if let Some(word) = filled.split(|c: char| !c.is_alphanumeric()).find(is_placeholder) {
        return Err(format!("the placeholder {word} has no value; add one to PLACEHOLDERS"));
    }
    Ok(filled)
}

/// Whether a command runs until it is stopped.
pub(super) fn runs_until_stopped(arguments: &str) -> bool {
    arguments.split_whitespace().next().is_some_and(|command| SERVERS.contains(&command))
}

/// The command with small parameters.
pub(super) fn shrink(arguments: &str) -> String {
    let mut words: Vec<&str> = arguments.split_whitespace().collect();
    for i in 1..words.len() {
        if let Some((_, value)) = VALUES.iter().find(|(option, _)| *option == words[i - 1]) {
            words[i] = *value;
        }
    }
    let mut small = words.join(" ");
    if small.starts_with("dataset generate") {
        small = small.replace(MESH_OF_DATASET.0, MESH_OF_DATASET.1);
    }
    for (command, option, value) in ADDED_OPTIONS {
        if small.starts_with(command) && !words.contains(&option) {
            small += &format!(" {option} {value}");
        }
    }
    small
}

#[test]
fn placeholders_and_long_runs_are_replaced() {
    let filled = fill_placeholders("add-a-policy.md", "train policy --out DIR/NAME --steps 9");
    assert_eq!(filled.as_deref(), Ok("train policy --out policies/mlp-pcd --steps 9"));
    assert_eq!(
        shrink(&filled.unwrap()),
        "train policy --out policies/mlp-pcd --steps 20 --batch 8"
    );
    assert!(fill_placeholders("add-an-object.md", "mesh inspect FILE").is_err());
}
