//! `cargo xtask`: every test there is, and the parts of it one by one.
#![forbid(unsafe_code)]

mod checks;
mod executables;
mod fuzz;
mod log;
mod module;
mod prerequisites;
mod python;
mod runner;
mod suite;

use std::process::ExitCode;

use prerequisites::Need;
use runner::Runner;

const HELP: &str = "\
Usage: cargo xtask COMMAND

  test       install what is missing, then run everything below
  fmt        rustfmt, checking only
  clippy     clippy on the host and on the firmware's target, warnings are errors
  doc        rustdoc, warnings are errors
  deny       licences, sources, bans and (when its database can be reached) advisories
  unit       the tests of core, host and tests, doc tests included
  firmware   the firmware under QEMU against the host, and the core's bits on other machines
  fuzz TARGET SECONDS
             fuzz a reader, guided by coverage; needs a nightly Rust and a C++ compiler
  module     build the application for the emulated board: target/module/float and fixed
  module-report
             measure the module and write firmware/REPORT.md; with --check compare it

'cargo xtask test' is what continuous integration runs. It may install Rust targets, Debian
packages (as root or with passwordless sudo), cargo-deny, and sarkit in target/venv unless
SUBAPERTURE_PYTHON names a Python that has it.";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let command = match arguments.as_slice() {
        [] => "help",
        [one] => one.as_str(),
        [one, option] if one == "module-report" && option == "--check" => "module-report --check",
        [one, target, seconds] if one == "fuzz" => return fuzz::run(target, seconds),
        _ => {
            eprintln!("one command at a time\n\n{HELP}");
            return ExitCode::from(2);
        }
    };
    let mut runner = Runner::new();
    let needs: &[Need] = match command {
        "fmt" => &[Need::Rustfmt],
        "clippy" => &[Need::Clippy, Need::FirmwareTarget],
        "doc" => &[Need::FirmwareTarget],
        "unit" => &[],
        "deny" => &[Need::CargoDeny],
        "firmware" | "module-report" | "module-report --check" => {
            &[Need::FirmwareTarget, Need::Qemu]
        }
        "module" => &[Need::FirmwareTarget],
        "test" => &[
            Need::Rustfmt,
            Need::Clippy,
            Need::FirmwareTarget,
            Need::Qemu,
            Need::CargoDeny,
        ],
        "help" | "--help" | "-h" => {
            println!("{HELP}");
            return ExitCode::SUCCESS;
        }
        unknown => {
            eprintln!("unknown command '{unknown}'\n\n{HELP}");
            return ExitCode::from(2);
        }
    };
    if let Err(what_to_do) = prerequisites::ensure(needs) {
        eprintln!("{what_to_do}");
        return ExitCode::FAILURE;
    }
    if matches!(command, "firmware" | "test") {
        prerequisites::ensure_if_possible(&prerequisites::OTHER_MACHINES);
    }
    if command == "test" {
        prerequisites::ensure_if_possible(&prerequisites::BROWSER);
    }
    match command {
        "module" => return module::build(),
        "module-report" => return module::report(false),
        "module-report --check" => return module::report(true),
        _ => {}
    }
    match command {
        "fmt" => checks::fmt(&mut runner),
        "clippy" => checks::clippy(&mut runner),
        "doc" => checks::doc(&mut runner),
        "deny" => checks::deny(&mut runner),
        "unit" => unit(&mut runner),
        "firmware" => suite::firmware(&mut runner),
        _ => {
            checks::fmt(&mut runner);
            checks::clippy(&mut runner);
            checks::doc(&mut runner);
            checks::deny(&mut runner);
            // The firmware's test is one of these.
            unit(&mut runner);
        }
    }
    runner.finish()
}

/// The tests, with sarkit where it can be had: without it they still run, but that counts as a failure.
fn unit(runner: &mut Runner) {
    let python = python::named().or_else(|| {
        prerequisites::ensure(&[Need::Python])
            .and_then(|()| python::ensure_venv())
            .inspect_err(|error| {
                eprintln!("{error}");
                runner.fail(
                    "Python with sarkit",
                    "let pip reach PyPI, or set SUBAPERTURE_PYTHON to a Python that imports sarkit",
                );
            })
            .ok()
    });
    suite::all(runner, python.as_deref());
}
