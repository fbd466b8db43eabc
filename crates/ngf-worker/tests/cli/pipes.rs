//! Output to a closed pipe.

use std::process::{Command, Stdio};

#[test]
fn closed_pipe_ends_program_without_panic() {
    for args in [&["objects"][..], &["--help"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut command = Command::new(env!("CARGO_BIN_EXE_ngf-worker"));
        let ended = command.args(args).stdout(writer).stderr(Stdio::piped()).output().unwrap();
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert!(stderr.is_empty(), "{args:?}: {stderr}");
    }
}
