//! What is printed to somebody who reads no further.

use std::process::{Command, Stdio};

#[test]
fn a_reader_that_leaves_ends_the_program_without_a_panic() {
    for args in [&["objects"][..], &["--help"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut command = Command::new(env!("CARGO_BIN_EXE_ngf"));
        let ended = command.args(args).stdout(writer).stderr(Stdio::piped()).output().unwrap();
        let said = String::from_utf8_lossy(&ended.stderr);
        assert!(said.is_empty(), "{args:?}: {said}");
    }
}
