//! Counts of passed and failed test cases, parsed from the output of the test tools.

use std::ops::AddAssign;

/// Number of passed and failed test cases.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TestCount {
    pub(crate) passed: u32,
    pub(crate) failed: u32,
}

impl AddAssign for TestCount {
    fn add_assign(&mut self, other: Self) {
        self.passed += other.passed;
        self.failed += other.failed;
    }
}

impl TestCount {
    /// Parses one line of output. cargo and the wasm runner print `test result: ok. 3 passed; 0 failed;`.
    /// Node prints `# pass 3` and `# fail 0`, with ℹ instead of # on a terminal.
    pub(crate) fn of_line(line: &str) -> Self {
        if let Some((_, counts)) = line.split_once("test result: ") {
            let count = |label: &str| {
                let before = counts.split_once(label)?.0;
                before.trim_end().rsplit(' ').next()?.parse().ok()
            };
            let (passed, failed) = (count("passed"), count("failed"));
            return Self { passed: passed.unwrap_or(0), failed: failed.unwrap_or(0) };
        }
        match *line.split_whitespace().collect::<Vec<_>>().as_slice() {
            ["#" | "\u{2139}", "pass", n] => Self { passed: n.parse().unwrap_or(0), failed: 0 },
            ["#" | "\u{2139}", "fail", n] => Self { passed: 0, failed: n.parse().unwrap_or(0) },
            _ => Self::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_parsed_from_every_tool() {
        let text = "running 4 tests\n\
            test result: FAILED. 3 passed; 1 failed; 0 ignored; 0 measured; finished in 0.02s\n\
            test result: ok. 12 passed; 0 failed; 0 ignored; 0 filtered out\n\
            \u{2139} tests 5\n\u{2139} pass 4\n\u{2139} fail 1\n# pass 2\n# fail 0\n\
            the test result: not a count; pass 7 is not one either\n";
        let mut total = TestCount::default();
        for line in text.lines() {
            total += TestCount::of_line(line);
        }
        assert_eq!(total, TestCount { passed: 21, failed: 2 });
    }
}
