//! Sequence of checks: a failure does not end it, and the last line counts the test cases.

use crate::test_count::TestCount;
use crate::workspace::display;
use anyhow::{Context, Result};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::Instant;

/// Results of the stages so far.
pub(crate) struct StageRunner {
    total: TestCount,
    failed: Vec<&'static str>,
    start: Instant,
}

impl StageRunner {
    pub(crate) fn new() -> Self {
        Self { total: TestCount::default(), failed: Vec::new(), start: Instant::now() }
    }

    /// Runs one stage. A failure is printed and recorded; later stages still run.
    pub(crate) fn stage(&mut self, name: &'static str, work: impl FnOnce(&mut Self) -> Result<()>) {
        println!("\n--- {name}");
        let start = Instant::now();
        match work(self) {
            Ok(()) => println!("{name}: {:.1} s", start.elapsed().as_secs_f32()),
            Err(error) => {
                println!("{name}: failed: {error:#}");
                self.failed.push(name);
            }
        }
    }

    /// Runs a command, prints its output, and adds the test cases in it to the count.
    pub(crate) fn count(&mut self, command: &mut Command) -> Result<()> {
        let mut child = command
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot run {}", display(command)))?;
        let output = child.stdout.take().context("no pipe for the output")?;
        for line in BufReader::new(output).split(b'\n') {
            let line = line?;
            let line = String::from_utf8_lossy(&line);
            println!("{line}");
            self.total += TestCount::of_line(&line);
        }
        let status = child.wait()?;
        anyhow::ensure!(status.success(), "`{}` failed ({status})", display(command));
        Ok(())
    }

    /// Prints the number of passed and failed test cases and the failed stages. Returns whether all passed.
    pub(crate) fn report(&self) -> bool {
        let TestCount { passed, failed } = self.total;
        let seconds = self.start.elapsed().as_secs_f32();
        let stages = match self.failed.as_slice() {
            [] => "all stages passed".to_owned(),
            failed => format!("failed stages: {}", failed.join(", ")),
        };
        println!("\n{passed} passed, {failed} failed; {stages} ({seconds:.0} s)");
        failed == 0 && self.failed.is_empty()
    }
}
