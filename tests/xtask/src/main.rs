//! `cargo xtask`: all tests and checks, together and one by one.
#![forbid(unsafe_code)]

mod checks;
mod dist;
mod executables;
mod guide;
mod log;
mod prerequisites;
mod python;
mod runner;
mod suite;
mod wasm;
mod wheel;
mod words;

use std::path::PathBuf;
use std::process::ExitCode;
use std::thread;

use subaperture_xtask::firmware::module;

use prerequisites::{Need, Talk, ensure, ensure_if_possible};
use runner::Runner;

const HELP: &str = "\
Usage: cargo xtask COMMAND

  test       install missing tools, then run everything below
  fmt        rustfmt, checking only
  clippy     clippy on the host, on core and library with fewer features and on the firmware's target,
             warnings are errors
  doc        rustdoc, warnings are errors
  words [--lower | FOLDER]
             words of unclear sentences, counted for each package against falling budgets;
             list their lines in FOLDER
  deny       licences, sources, bans and (when its database can be reached) advisories
  platforms  library and command, checked for Windows and macOS
  oldest     all that is published, compiled by the oldest Rust that it says it needs
  package    whether all that is published can be packed for crates.io
  unit       the tests of core, host and tests, doc tests included
  wasm       the web page that forms images in WebAssembly: target/wasm
  guide      the guide as a book, its blocks run: target/guide/book
  uhd        the radio's binding to UHD, against a library that stands in for it; needs libuhd-dev
  gpu        images formed by a GPU, against the exact sum; Mesa's lavapipe is one that runs on the processor
  long       the tests that take minutes each, which 'test' leaves out
  firmware   the firmware under QEMU against the host, and the bits of core and kernels on other machines
  miri       unsafe code of the kernels under Miri, in AVX2, AVX-512 and NEON, and all of them under
             AddressSanitizer; needs a nightly Rust with Miri
  fuzz TARGET SECONDS
             fuzz a reader, guided by coverage; needs a nightly Rust and a C++ compiler
  bench      measure image formers: time, error, memory, with other programs and against
             another revision ('cargo xtask bench --help')
  dist       build the release archives: target/dist
  wheel [all]
             build the Python wheel for this machine, or for all targets, and the source archive: target/wheels;
             install and run them in empty environments
  module     build the application for the emulated board: target/module/float and fixed
  module-report
             measure the module and write firmware/REPORT.md; with --check compare it

'cargo xtask test' is what continuous integration runs. It may install Rust targets, Debian
packages (as root or with passwordless sudo), cargo-deny, mdbook, wasm-bindgen-cli, and sarkit in target/venv unless
SUBAPERTURE_PYTHON names a Python that has it.";

/// Needs of the web page.
const WASM: [Need; 2] = [Need::Target(prerequisites::WASM_TARGET), Need::WasmBindgen];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let mut runner = Runner::new(Talk::Shown);
    let done = match words[..] {
        [] | ["help" | "--help" | "-h"] => {
            println!("{HELP}");
            return ExitCode::SUCCESS;
        }
        ["module"] => match ensure(&[Need::FIRMWARE_TARGET], Talk::Shown).and_then(|()| module()) {
            Ok([float, fixed]) => {
                println!("{}\n{}", float.display(), fixed.display());
                return ExitCode::SUCCESS;
            }
            Err(error) => Err(error),
        },
        ["module-report"] | ["module-report", "--check"] => {
            match ensure(&[Need::FIRMWARE_TARGET, Need::Qemu], Talk::Shown) {
                Ok(()) => return with_the_library(&words),
                error => error,
            }
        }
        ["dist"] => match dist::build() {
            Ok(()) => return ExitCode::SUCCESS,
            Err(error) => Err(error),
        },
        ["wheel"] | ["wheel", "all"] => match wheel::build(words.len() > 1) {
            Ok(()) => return ExitCode::SUCCESS,
            Err(error) => Err(error),
        },
        ["fuzz", _, _] => return with_the_library(&words),
        ["bench", ..] => return bench(&words[1..]),
        ["fmt"] => ensure(&[Need::Rustfmt], Talk::Shown).map(|()| checks::fmt(&mut runner)),
        ["clippy"] => ensure(&[Need::Clippy, Need::FIRMWARE_TARGET], Talk::Shown).map(|()| {
            checks::clippy_host(&mut runner);
            checks::clippy_core(&mut runner);
            checks::clippy_library(&mut runner);
            checks::clippy_firmware(&mut runner);
        }),
        ["doc"] => ensure(&[Need::FIRMWARE_TARGET], Talk::Shown).map(|()| {
            checks::doc_host(&mut runner);
            checks::doc_firmware(&mut runner);
        }),
        ["words"] => {
            runner.work("words", || words::check(false));
            Ok(())
        }
        ["words", "--lower"] => {
            runner.work("words", || words::check(true));
            Ok(())
        }
        ["words", folder] => match words::list(folder) {
            Ok(()) => return ExitCode::SUCCESS,
            Err(error) => Err(error),
        },
        ["deny"] => ensure(&[Need::CargoDeny], Talk::Shown).map(|()| checks::deny(&mut runner)),
        ["platforms"] => {
            ensure_if_possible(&prerequisites::OTHER_PLATFORMS, Talk::Shown);
            checks::platforms(&mut runner);
            Ok(())
        }
        ["oldest"] => {
            ensure_if_possible(&[Need::OldestRust], Talk::Shown);
            checks::oldest_rust(&mut runner);
            Ok(())
        }
        ["miri"] => {
            if prerequisites::nightly_has("miri") {
                checks::miri(&mut runner);
                checks::address_sanitizer(&mut runner);
                Ok(())
            } else {
                Err("Miri is needed: run\n    rustup toolchain install nightly --component miri,rust-src".to_owned())
            }
        }
        ["package"] => {
            checks::packages(&mut runner);
            Ok(())
        }
        ["unit"] => {
            let python = python(Talk::Shown);
            unit(&mut runner, python, |_| {});
            Ok(())
        }
        ["wasm"] => ensure(&WASM, Talk::Shown).map(|()| {
            wasm::clippy(&mut runner);
            runner.work("web page", wasm::build);
            runner.work("kernels' tests for WebAssembly", wasm::build_tests);
        }),
        ["guide"] => ensure(&[&[Need::Mdbook][..], &WASM].concat(), Talk::Shown).map(|()| {
            runner.work("web page", wasm::build);
            suite::guide_pages(&mut runner);
            runner.work("guide", guide::build);
        }),
        ["uhd"] => {
            ensure_if_possible(&[Need::Uhd], Talk::Shown);
            suite::uhd(&mut runner);
            Ok(())
        }
        ["gpu"] => {
            ensure_if_possible(&[Need::Vulkan], Talk::Shown);
            suite::gpu(&mut runner);
            Ok(())
        }
        ["long"] => {
            suite::long(&mut runner);
            Ok(())
        }
        ["firmware"] => ensure(&[Need::FIRMWARE_TARGET, Need::Qemu], Talk::Shown).map(|()| {
            ensure_if_possible(&prerequisites::OTHER_TARGETS, Talk::Shown);
            ensure_if_possible(&prerequisites::OTHER_EMULATORS, Talk::Shown);
            suite::firmware(&mut runner);
            suite::kernels_elsewhere(&mut runner);
        }),
        ["test"] => test(&mut runner),
        _ => {
            eprintln!("unknown command '{}'\n\n{HELP}", words.join(" "));
            return ExitCode::from(2);
        }
    };
    if let Err(remedy) = done {
        eprintln!("{remedy}");
        return ExitCode::FAILURE;
    }
    runner.finish()
}

/// Run everything. Packages are downloaded while this machine compiles.
fn test(runner: &mut Runner) -> Result<(), String> {
    // The Rust toolchain is not changed while it is in use.
    ensure(
        &[
            Need::Rustfmt,
            Need::Clippy,
            Need::FIRMWARE_TARGET,
            Need::Target(prerequisites::WASM_TARGET),
        ],
        Talk::Shown,
    )?;
    ensure_if_possible(&prerequisites::OTHER_TARGETS, Talk::Shown);
    ensure_if_possible(&prerequisites::OTHER_PLATFORMS, Talk::Shown);
    ensure_if_possible(&[Need::OldestRust], Talk::Shown);
    let installation = thread::spawn(|| {
        // Debian's packages in one call, because each call takes as long as most packages.
        let debian = [Need::Qemu, Need::Chromium, Need::Uhd, Need::Vulkan];
        let debian = [&debian, prerequisites::OTHER_EMULATORS.as_slice()].concat();
        ensure_if_possible(&debian, Talk::OfFailure);
        ensure(
            &[Need::Qemu, Need::CargoDeny, Need::Mdbook],
            Talk::OfFailure,
        )
        .map(|()| python(Talk::OfFailure))
    });
    // Steps with their own target folders run in other threads: one build leaves processors idle where it waits for one crate.
    let firmware = thread::spawn(|| {
        let mut firmware = Runner::new(Talk::OfFailure);
        checks::build_firmware(&mut firmware);
        firmware
    });
    let second = thread::spawn(|| {
        let mut second = Runner::new(Talk::OfFailure);
        checks::oldest_rust(&mut second);
        checks::platforms(&mut second);
        wasm::clippy(&mut second);
        match ensure(&[Need::WasmBindgen], Talk::OfFailure) {
            Ok(()) => {
                second.work("web page", wasm::build);
                second.work("kernels' tests for WebAssembly", wasm::build_tests);
            }
            Err(remedy) => {
                eprintln!("{remedy}");
                second.fail(
                    "web page",
                    "let cargo reach crates.io, or install wasm-bindgen-cli",
                );
            }
        }
        second
    });
    checks::fmt(runner);
    runner.work("words", || words::check(false));
    checks::clippy_host(runner);
    checks::clippy_core(runner);
    checks::clippy_library(runner);
    let python = installation.join().expect("installing does not panic")?;
    checks::packages(runner);
    checks::doc_host(runner);
    // Tests of the command wait for one process at a time, and other threads use the other processors.
    suite::hardware(runner);
    checks::clippy_firmware(runner);
    checks::doc_firmware(runner);
    checks::deny(runner);
    suite::kernels_elsewhere(runner);
    // The firmware's test is one of these. Firmware and web page are needed when they run.
    unit(runner, python, |runner| {
        for thread in [firmware, second] {
            runner.add_all(thread.join().expect("checking does not panic"));
        }
    });
    runner.work("guide", guide::build);
    Ok(())
}

/// A Python with sarkit, or the reason why there is none.
fn python(talk: Talk) -> Result<PathBuf, String> {
    match python::named() {
        Some(python) => Ok(python),
        None => ensure(&[Need::Python], talk).and_then(|()| python::ensure_venv()),
    }
}

/// Run the tests, with sarkit if available; without it they still run, but that counts as a failure. `built` is called before they start.
fn unit(runner: &mut Runner, python: Result<PathBuf, String>, built: impl FnOnce(&mut Runner)) {
    let python = python.inspect_err(|error| {
        eprintln!("{error}");
        runner.fail(
            "Python with sarkit, rio-cogeo and stanag4607",
            "let pip reach PyPI, or set SUBAPERTURE_PYTHON to a Python that imports sarkit, rio_cogeo and stanag4607",
        );
    });
    suite::all(runner, python.ok().as_deref(), built);
}

/// Tasks that need the library.
fn with_the_library(words: &[&str]) -> ExitCode {
    run(&["--bin", "tasks"], words)
}

/// Run the benchmark, optimised like users' programs.
fn bench(words: &[&str]) -> ExitCode {
    run(&["--release", "--bin", "bench"], words)
}

/// Run a program of the tests.
fn run(which: &[&str], words: &[&str]) -> ExitCode {
    let run = ["run", "--quiet", "--package", "subaperture-tests"];
    let mut command = checks::cargo(&run);
    command.args(which).arg("--").args(words);
    match command.status() {
        Ok(status) if status.success() => ExitCode::SUCCESS,
        Ok(status) => status
            .code()
            .and_then(|code| u8::try_from(code).ok())
            .map_or(ExitCode::FAILURE, ExitCode::from),
        Err(error) => {
            eprintln!("cannot start cargo: {error}");
            ExitCode::FAILURE
        }
    }
}
