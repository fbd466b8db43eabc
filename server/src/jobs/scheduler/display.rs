//! The command line of a worker as text for the log.

use std::path::Path;

/// The command as a shell line for the log. Paths inside `folders` are shown relative to them: clients do not
/// need the layout of the server's disk.
pub(super) fn display(argv: &[String], folders: &[&Path]) -> String {
    let relative = |arg: &String| {
        let path = Path::new(arg);
        let inside = folders.iter().find_map(|folder| path.strip_prefix(folder).ok());
        shell_quote(&inside.unwrap_or(path).display().to_string())
    };
    let args: Vec<String> = argv.iter().map(relative).collect();
    format!("ngf {}", args.join(" "))
}

/// Quotes an argument for a POSIX shell if necessary.
fn shell_quote(arg: &str) -> String {
    let is_safe = |c: char| c.is_ascii_alphanumeric() || "_-./:=,+%@".contains(c);
    if !arg.is_empty() && arg.chars().all(is_safe) {
        return arg.to_owned();
    }
    format!("'{}'", arg.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displayed_command_is_shell_quoted_and_hides_server_folders() {
        let argv = ["evaluate", "--model", "/home/me/models/default", "--mesh"];
        let argv: Vec<String> = argv
            .into_iter()
            .chain(["/data/jobs/1/it's a mug.obj", ""])
            .map(str::to_owned)
            .collect();
        let folders = [Path::new("/data/jobs/1"), Path::new("/data"), Path::new("/home/me/models")];
        let line = display(&argv, &folders);
        assert_eq!(line, r"ngf evaluate --model default --mesh 'it'\''s a mug.obj' ''");
    }
}
