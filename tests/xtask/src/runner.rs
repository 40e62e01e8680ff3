//! Steps run one after another, with times, counts of tests, and a summary at the end.

use std::io::{BufRead, BufReader};
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use subaperture_xtask::processor::{self, Of};

use crate::executables::{self, Run};
use crate::log::{TestLog, note};
use crate::prerequisites::{Talk, run_shown};

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

/// Steps run so far.
pub(crate) struct Runner {
    steps: Vec<Step>,
    /// Amount of shown output.
    talk: Talk,
    passed: u64,
    failed: u64,
    /// Lines about failures.
    failures: Vec<String>,
    /// Lines about skipped tests and steps, with reasons.
    skipped: Vec<String>,
}

impl Runner {
    pub(crate) fn new(talk: Talk) -> Self {
        Self {
            steps: Vec::new(),
            talk,
            passed: 0,
            failed: 0,
            failures: Vec::new(),
            skipped: Vec::new(),
        }
    }

    /// Run a check that counts no tests. A failure counts as one.
    pub(crate) fn check(&mut self, name: &'static str, command: &mut Command) {
        let start = match self.talk {
            Talk::Shown => announce(name, command),
            Talk::OfFailure => Instant::now(),
        };
        let passed = match run_shown(command, self.talk) {
            Ok(passed) => passed,
            Err(error) => {
                eprintln!("cannot start: {error}");
                false
            }
        };
        self.failed += u64::from(!passed);
        self.record(name, passed, start);
    }

    /// Do work that counts no tests, and print the error if it fails, which counts as one failure.
    pub(crate) fn work(&mut self, name: &'static str, work: impl FnOnce() -> Result<(), String>) {
        let start = Instant::now();
        match work() {
            Ok(()) => self.record(name, true, start),
            Err(message) => {
                eprintln!("{message}");
                self.failed += 1;
                self.record(name, false, start);
            }
        }
    }

    /// Add the steps of another runner.
    pub(crate) fn add_all(&mut self, other: Self) {
        self.steps.extend(other.steps);
        self.passed += other.passed;
        self.failed += other.failed;
        self.failures.extend(other.failures);
        for line in &other.skipped {
            note(&mut self.skipped, line);
        }
    }

    /// Run `cargo test -- --show-output`, count its tests and collect skipped ones. A failure without the name of a test (such as a
    /// compiler error) counts as one failure.
    pub(crate) fn tests(&mut self, name: &'static str, command: &mut Command) {
        let start = announce(name, command);
        let mut log = TestLog::default();
        let passed = match command.stdout(Stdio::piped()).spawn() {
            Ok(mut child) => {
                let output = child.stdout.take().expect("stdout is piped");
                for line in BufReader::new(output).split(b'\n').map_while(Result::ok) {
                    let line = String::from_utf8_lossy(&line);
                    if log.add_line(&line) {
                        println!("{line}");
                    }
                }
                child.wait().is_ok_and(|status| status.success())
            }
            Err(error) => {
                eprintln!("cannot start: {error}");
                false
            }
        };
        self.add(name, &log, passed);
        self.record(name, passed, start);
    }

    /// Build test executables with `command`, call `built`, and run them, several at once, each modified by `prepare`; count and collect as
    /// in [`Self::tests`].
    pub(crate) fn executables(
        &mut self,
        name: &'static str,
        command: &mut Command,
        built: impl FnOnce(&mut Self),
        prepare: impl Fn(&mut Command) + Sync,
    ) {
        let start = announce(name, command);
        let found = executables::build(command);
        let build_s = start.elapsed().as_secs_f64();
        built(self);
        let found = match found {
            Ok(found) => found,
            Err(message) => {
                eprintln!("{message}");
                self.failed += 1;
                return self.record(name, false, start);
            }
        };
        let mut all_passed = true;
        println!("{} executables, built in {build_s:.1} s", found.len());
        executables::run_all(
            found,
            prepare,
            |Run {
                 name,
                 output,
                 succeeded,
                 took,
             }| {
                let mut log = TestLog::default();
                println!(
                    "\n     Ran {name} in {:.1} s, {:.1} s from the start",
                    took.as_secs_f64(),
                    start.elapsed().as_secs_f64()
                );
                for line in output.lines() {
                    if log.add_line(line) {
                        println!("{line}");
                    }
                }
                all_passed &= succeeded;
                self.add(&name, &log, succeeded);
            },
        );
        self.record(name, all_passed, start);
    }

    /// Add the log of a run of tests; a failure without the name of a test counts as one failure.
    fn add(&mut self, name: &str, log: &TestLog, passed: bool) {
        self.passed += log.passed;
        self.failed += match (passed, log.failed) {
            (false, 0) => 1,
            (_, failed) => failed,
        };
        let named = log.failures.iter();
        self.failures
            .extend(named.map(|test| format!("FAILED: {name}: {test}")));
        if !passed && log.failures.is_empty() {
            self.failures.push(format!("FAILED: {name}"));
        }
        for line in &log.skipped {
            note(&mut self.skipped, line);
        }
    }

    /// Record a step that could not run here, with the reason.
    pub(crate) fn skip(&mut self, name: &'static str, why: &str) {
        let line = format!("skipped: {name}: {why}");
        println!("{line}");
        note(&mut self.skipped, &line);
        self.steps.push(Step {
            name,
            outcome: Outcome::Skipped,
            took: Duration::ZERO,
        });
    }

    /// Count a step that could not be prepared as one failure, and print the remedy.
    pub(crate) fn fail(&mut self, name: &'static str, remedy: &str) {
        eprintln!("{name}: {remedy}");
        self.failed += 1;
        self.record(name, false, Instant::now());
    }

    fn record(&mut self, name: &'static str, passed: bool, start: Instant) {
        let took = start.elapsed();
        let outcome = if passed {
            Outcome::Passed
        } else {
            Outcome::Failed
        };
        let seconds = took.as_secs_f64();
        match self.talk {
            Talk::Shown => println!("    {} in {seconds:.1} s", word(outcome)),
            Talk::OfFailure => println!(
                "    {name}, in another thread: {} in {seconds:.1} s",
                word(outcome)
            ),
        }
        self.steps.push(Step {
            name,
            outcome,
            took,
        });
    }

    /// Print every step, skipped tests and the closing line; a failure if any step failed or no step ran.
    pub(crate) fn finish(self) -> ExitCode {
        println!();
        for step in &self.steps {
            let seconds = step.took.as_secs_f64();
            println!("{:>8} {seconds:7.1} s  {}", word(step.outcome), step.name);
        }
        for line in self.skipped.iter().chain(&self.failures) {
            println!("{line}");
        }
        if let Some(seconds) = processor::seconds(Of::Children) {
            println!("{seconds:.0} s of processor time");
        }
        println!("{} passed, {} failed", self.passed, self.failed);
        if self.failed == 0 && !self.steps.is_empty() {
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
