//! Parser of the output of `cargo test -- --show-output`: counts tests, collects skipped ones, and selects the lines to print.

/// Output of `cargo test` so far.
#[derive(Debug, Default)]
pub(crate) struct TestLog {
    /// Number of tests that passed.
    pub(crate) passed: u64,
    /// Number of tests that failed.
    pub(crate) failed: u64,
    /// Names of failed tests, as far as they were printed.
    pub(crate) failures: Vec<String>,
    /// Distinct lines that state skipped tests.
    pub(crate) skipped: Vec<String>,
    /// Inside the output of tests that passed.
    in_successes: bool,
}

impl TestLog {
    /// Add a line; returns whether it should be printed. Output of passing tests is not printed, but contains the lines about skipped
    /// tests.
    pub(crate) fn add_line(&mut self, line: &str) -> bool {
        if line.starts_with("skipped: ") {
            note(&mut self.skipped, line);
        }
        let failure = line.strip_prefix("test ");
        if let Some(name) = failure.and_then(|rest| rest.strip_suffix(" ... FAILED")) {
            self.failures.push(name.to_owned());
        }
        if line == "successes:" {
            self.in_successes = true;
        } else if line == "failures:" || line.starts_with("test result: ") {
            self.in_successes = false;
        }
        if let Some(result) = line.strip_prefix("test result: ") {
            self.count(result);
        }
        !self.in_successes
    }

    /// Count the tests in a line such as `test result: ok. 12 passed; 0 failed; 1 ignored; ...`.
    fn count(&mut self, result: &str) {
        // "ok. 12 passed" is the first field, "0 failed" the second.
        for field in result.split(';') {
            let mut words = field.split_whitespace().rev();
            let (Some(kind), Some(Ok(count))) = (words.next(), words.next().map(str::parse::<u64>))
            else {
                continue;
            };
            match kind {
                "passed" => self.passed += count,
                "failed" => self.failed += count,
                _ => {}
            }
        }
    }
}

/// Add `line` unless it is present.
pub(crate) fn note(lines: &mut Vec<String>, line: &str) {
    if !lines.iter().any(|known| known == line) {
        lines.push(line.to_owned());
    }
}

#[cfg(test)]
mod tests {
    use super::TestLog;

    #[test]
    fn counts_result_lines_only() {
        let mut log = TestLog::default();
        for line in [
            "running 3 tests",
            "test passed ... ok",
            "test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 4 filtered out; finished in 0.1s",
            "test result: FAILED. 7 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out",
            "5 passed; 6 failed",
        ] {
            assert!(log.add_line(line), "{line}");
        }
        assert_eq!((log.passed, log.failed), (19, 2));
        assert!(log.skipped.is_empty());
    }

    #[test]
    fn output_of_passing_tests_is_used_only_for_skipped_ones() {
        let mut log = TestLog::default();
        let printed: Vec<&str> = "\
running 3 tests
test a ... ok
test b ... ok
test c ... FAILED

successes:

---- a stdout ----
error 1e-7
skipped: x.mat not found

---- b stdout ----
skipped: x.mat not found
skipped: y.mat not found


successes:
    a
    b

failures:

---- c stdout ----
wrong

failures:
    c

test result: FAILED. 2 passed; 1 failed; 0 ignored; 0 measured; 0 filtered out"
            .lines()
            .filter(|line| log.add_line(line) && !line.is_empty())
            .collect();
        assert_eq!(
            printed,
            [
                "running 3 tests",
                "test a ... ok",
                "test b ... ok",
                "test c ... FAILED",
                "failures:",
                "---- c stdout ----",
                "wrong",
                "failures:",
                "    c",
                "test result: FAILED. 2 passed; 1 failed; 0 ignored; 0 measured; 0 filtered out",
            ]
        );
        assert_eq!((log.passed, log.failed), (2, 1));
        assert_eq!(log.failures, ["c"]);
        assert_eq!(
            log.skipped,
            ["skipped: x.mat not found", "skipped: y.mat not found"]
        );
    }
}
