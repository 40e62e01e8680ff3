//! Coverage-guided fuzzing by cargo-fuzz.

use std::fs;
use std::process::{Command, ExitCode};

use subaperture_tests::fuzz::TARGETS;
use subaperture_tests::subap::root;

/// Limits of one allocation and of the whole program, megabytes.
const LIMITS: [&str; 2] = ["-malloc_limit_mb=256", "-rss_limit_mb=2048"];

/// Fuzz a target for some seconds, from its seeds and earlier findings.
pub(crate) fn run(name: &str, seconds: &str) -> ExitCode {
    let Some(target) = TARGETS.iter().find(|target| target.name == name) else {
        let names: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
        eprintln!(
            "there is no target '{name}'; choose one of: {}",
            names.join(", ")
        );
        return ExitCode::from(2);
    };
    if seconds.parse::<u32>().is_err() {
        eprintln!("'{seconds}' is not a number of seconds");
        return ExitCode::from(2);
    }
    let corpus = root().join("tests/fuzz/corpus").join(name);
    let written = fs::create_dir_all(&corpus).and_then(|()| {
        for (n, seed) in (target.seeds)().iter().enumerate() {
            fs::write(corpus.join(format!("seed-{n}")), seed)?;
        }
        Ok(())
    });
    if let Err(error) = written {
        eprintln!("{}: {error}", corpus.display());
        return ExitCode::FAILURE;
    }
    if !works(&mut fuzzer(&["--version"])) {
        eprintln!(
            "cargo-fuzz on a nightly Rust is needed: run\n    rustup toolchain install nightly\n    cargo install --locked cargo-fuzz"
        );
        return ExitCode::FAILURE;
    }
    // The fuzzed code has no `unsafe`: AddressSanitizer would find no fault and double the time.
    let mut command = fuzzer(&[
        "run",
        "--fuzz-dir",
        "tests/fuzz",
        "--features",
        "fuzzer",
        "--target-dir",
        "target/fuzz",
        "--sanitizer",
        "none",
    ]);
    command
        .args([
            name,
            "--",
            "-max_len=65536",
            "-timeout=60",
            "-report_slow_units=2",
        ])
        .args(LIMITS)
        .arg(format!("-max_total_time={seconds}"));
    match command.status() {
        Ok(status) if status.success() => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("cannot start cargo: {error}");
            ExitCode::FAILURE
        }
    }
}

/// rustup's cargo, because the running one belongs to another toolchain.
fn fuzzer(arguments: &[&str]) -> Command {
    let mut command = Command::new("rustup");
    command
        .args(["run", "nightly", "cargo", "fuzz"])
        .args(arguments)
        .current_dir(root())
        .env_remove("CARGO");
    command
}

fn works(command: &mut Command) -> bool {
    command.output().is_ok_and(|output| output.status.success())
}
