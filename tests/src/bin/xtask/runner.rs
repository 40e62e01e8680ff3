//! Runs one step after the other, times them, counts tests, says at the end how it went.

use std::io::{BufRead, BufReader};
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

/// Tests counted in the output of `cargo test`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Tally {
    /// Tests that passed.
    pub(crate) passed: u64,
    /// Tests that failed.
    pub(crate) failed: u64,
}

impl Tally {
    /// Adds what a line such as `test result: ok. 12 passed; 0 failed; 1 ignored; ...` counts; any
    /// other line counts nothing.
    pub(crate) fn add_line(&mut self, line: &str) {
        let Some(result) = line.trim_start().strip_prefix("test result: ") else {
            return;
        };
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

struct Step {
    name: &'static str,
    outcome: Outcome,
    took: Duration,
}

#[derive(Clone, Copy, PartialEq)]
enum Outcome {
    Passed,
    Failed,
    Skipped,
}

/// The steps run so far.
pub(crate) struct Runner {
    steps: Vec<Step>,
    tally: Tally,
}

impl Runner {
    pub(crate) fn new() -> Self {
        Self {
            steps: Vec::new(),
            tally: Tally::default(),
        }
    }

    /// Runs a check that counts no tests. If it fails, that counts as one failure.
    pub(crate) fn check(&mut self, name: &'static str, command: &mut Command) {
        let start = announce(name, command);
        let passed = match command.status() {
            Ok(status) => status.success(),
            Err(error) => {
                eprintln!("cannot start: {error}");
                false
            }
        };
        self.tally.failed += u64::from(!passed);
        self.record(name, passed, start);
    }

    /// Runs `cargo test` and counts its tests. If it fails without naming a failed test (it does not
    /// compile, say), that counts as one failure.
    pub(crate) fn tests(&mut self, name: &'static str, command: &mut Command) {
        let start = announce(name, command);
        let mut tally = Tally::default();
        let passed = match command.stdout(Stdio::piped()).spawn() {
            Ok(mut child) => {
                let output = child.stdout.take().expect("stdout is piped");
                for line in BufReader::new(output).split(b'\n').map_while(Result::ok) {
                    let line = String::from_utf8_lossy(&line);
                    println!("{line}");
                    tally.add_line(&line);
                }
                child.wait().is_ok_and(|status| status.success())
            }
            Err(error) => {
                eprintln!("cannot start: {error}");
                false
            }
        };
        if !passed && tally.failed == 0 {
            tally.failed = 1;
        }
        self.tally.passed += tally.passed;
        self.tally.failed += tally.failed;
        self.record(name, passed, start);
    }

    /// Notes a step that could not run here, and why.
    pub(crate) fn skip(&mut self, name: &'static str, why: &str) {
        println!("skipped: {name}: {why}");
        self.steps.push(Step {
            name,
            outcome: Outcome::Skipped,
            took: Duration::ZERO,
        });
    }

    fn record(&mut self, name: &'static str, passed: bool, start: Instant) {
        let took = start.elapsed();
        let outcome = if passed {
            Outcome::Passed
        } else {
            Outcome::Failed
        };
        println!("    {} in {:.1} s", word(outcome), took.as_secs_f64());
        self.steps.push(Step {
            name,
            outcome,
            took,
        });
    }

    /// Prints every step and the closing line; failure if anything failed or nothing ran.
    pub(crate) fn finish(self) -> ExitCode {
        println!();
        for step in &self.steps {
            let seconds = step.took.as_secs_f64();
            println!("{:>8} {seconds:7.1} s  {}", word(step.outcome), step.name);
        }
        println!("{} passed, {} failed", self.tally.passed, self.tally.failed);
        if self.tally.failed == 0 && !self.steps.is_empty() {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        }
    }
}

fn word(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Passed => "passed",
        Outcome::Failed => "FAILED",
        Outcome::Skipped => "skipped",
    }
}

fn announce(name: &str, command: &Command) -> Instant {
    let words: Vec<_> = std::iter::once(command.get_program())
        .chain(command.get_args())
        .map(|w| w.to_string_lossy())
        .collect();
    println!("\n==> {name}: {}", words.join(" "));
    Instant::now()
}

#[cfg(test)]
mod tests {
    use super::Tally;

    #[test]
    fn counts_result_lines_only() {
        let mut tally = Tally::default();
        for line in [
            "running 3 tests",
            "test passed ... ok",
            "test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 4 filtered out; finished in 0.1s",
            "test result: FAILED. 7 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out",
            "5 passed; 6 failed",
        ] {
            tally.add_line(line);
        }
        assert_eq!(
            tally,
            Tally {
                passed: 19,
                failed: 2
            }
        );
    }
}
