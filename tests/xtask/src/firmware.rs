//! Building the firmware.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::{link_alone, target_folder, target_installed};

/// What the firmware is compiled for.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// A program of the firmware, and how it is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Build<'a> {
    /// `--bin` or `--example`.
    pub kind: &'a str,
    /// Name of the binary or example.
    pub program: &'a str,
    /// Features, separated by commas. With another board the default one is left out.
    pub features: &'a str,
    /// What it is compiled for.
    pub target: &'a str,
    /// `firmware`, or another of the workspace's profiles.
    pub profile: &'a str,
}

impl<'a> Build<'a> {
    /// A program as it goes to the emulated board.
    pub const fn bin(program: &'a str, features: &'a str) -> Self {
        Self {
            kind: "--bin",
            program,
            features,
            target: TARGET,
            profile: "firmware",
        }
    }

    /// An example.
    pub const fn example(program: &'a str, features: &'a str) -> Self {
        Self {
            kind: "--example",
            ..Self::bin(program, features)
        }
    }
}

/// All that tests run or look at, those with most in common one after another: [`build_all`] makes them while something else is
/// checked, so that no test waits for another's build.
const ALL: [Build<'static>; 28] = [
    Build::bin("application", "no-panic"),
    Build::bin("cycles", ""),
    Build::bin("selftest", ""),
    Build::example("sections", ""),
    Build::example("faults", ""),
    Build::example("panics", ""),
    // Not to be built: the linker refuses it.
    Build::example("panics", "no-panic"),
    Build::example("echo", ""),
    Build::example("slow_echo", ""),
    Build::bin("stream_selftest", "no-panic"),
    Build::bin("application", "no-panic,fixed"),
    Build::bin("application", "fixed,no-panic"),
    Build::bin("cycles", "fixed"),
    Build::bin("application", "size-small,fixed,no-panic"),
    Build::bin("cycles", "size-small,fixed"),
    Build::bin("application", "size-large,no-panic"),
    Build::bin("cycles", "size-large"),
    Build::bin("selftest", "board-h743"),
    Build::bin("application", "board-h743"),
    Build::bin("application", "fixed,board-h743"),
    Build::bin("application", "size-small,fixed,board-h743"),
    Build::bin("application", "size-large,board-h743"),
    Build::bin("application", "defmt"),
    Build::bin("application", "board-h743,defmt"),
    Build {
        target: "aarch64-unknown-linux-musl",
        ..Build::bin("stream_selftest", "")
    },
    Build {
        target: "aarch64-unknown-linux-musl",
        ..Build::bin("selftest", "")
    },
    Build {
        target: "riscv32imafc-unknown-none-elf",
        ..Build::bin("stream_selftest", "")
    },
    Build {
        target: "thumbv6m-none-eabi",
        ..Build::bin("stream_selftest", "board-microbit,no-panic")
    },
];

/// Builds all programs, but those for targets that are not installed.
///
/// # Errors
/// As [`try_build`].
pub fn build_all() -> Result<(), String> {
    let refused = Build::example("panics", "no-panic");
    let all = ALL.iter().filter(|build| **build != refused);
    for build in all.filter(|build| target_installed(build.target)) {
        try_build(build).map_err(|error| format!("{build:?}\n{error}"))?;
    }
    Ok(())
}

/// Builds a program, in a target folder of the firmware's own, and copies its ELF to a place that the next
/// build with other features leaves alone. One build at a time, over all processes.
///
/// # Errors
/// What cargo said, or what kept us from running it; that the program is none of those that are built beforehand.
pub fn try_build(build: &Build<'_>) -> Result<PathBuf, String> {
    if !ALL.contains(build) {
        return Err(format!("{build:?} is not in the list of all programs"));
    }
    let folder = target_folder().join("firmware-module");
    let place = folder.join("elf");
    let told = |what: &Path, error| format!("{}: {error}", what.display());
    fs::create_dir_all(&place).map_err(|error| told(&place, error))?;
    let lock = File::create(folder.join("one-at-a-time")).map_err(|e| told(&folder, e))?;
    lock.lock().map_err(|error| told(&folder, error))?;

    let output = cargo(build, &folder).map_err(|error| format!("cargo does not start: {error}"))?;
    let stderr = String::from_utf8_lossy(&output.stderr);
    if stderr.contains("can't find crate for `core`") {
        return Err(format!(
            "the target is missing: rustup target add {}",
            build.target
        ));
    }
    if !output.status.success() {
        return Err(stderr.into_owned());
    }
    let built = folder.join(build.target).join(build.profile);
    let built = match build.kind {
        "--example" => built.join("examples").join(build.program),
        _ => built.join(build.program),
    };
    let name = format!(
        "{}-{}-{}-{}",
        build.program, build.profile, build.features, build.target
    );
    let elf = place.join(name.replace(',', "-"));
    copy_if_other(&built, &elf)?;
    Ok(elf)
}

/// Builds a program; its ELF.
///
/// # Panics
/// If it cannot be built.
pub fn build(build: &Build<'_>) -> PathBuf {
    match try_build(build) {
        Ok(elf) => elf,
        Err(error) => panic!("{build:?}\n{error}"),
    }
}

fn cargo(build: &Build<'_>, folder: &Path) -> std::io::Result<Output> {
    let other_board = build.features.contains("board-");
    let mut command = crate::cargo();
    command
        .args(["build", "--quiet", "--package", "subaperture-firmware"])
        .args(["--locked", "--target", build.target])
        .args(["--profile", build.profile])
        .args([build.kind, build.program, "--features", build.features])
        .args(other_board.then_some("--no-default-features"))
        .arg("--target-dir")
        .arg(folder);
    link_alone(&mut command, build.target);
    command.output()
}

/// The bytes of both are compared, so that what watches the copy sees it change only when it does; the new
/// one takes its place whole.
fn copy_if_other(from: &Path, to: &Path) -> Result<(), String> {
    let told = |what: &Path, error| format!("{}: {error}", what.display());
    let bytes = fs::read(from).map_err(|error| told(from, error))?;
    if fs::read(to).is_ok_and(|there| there == bytes) {
        return Ok(());
    }
    let beside = to.with_extension("new");
    fs::write(&beside, bytes).map_err(|error| told(&beside, error))?;
    // Programs of this machine's own kind are started.
    let mode = fs::metadata(from).map_err(|error| told(from, error))?;
    fs::set_permissions(&beside, mode.permissions()).map_err(|error| told(&beside, error))?;
    fs::rename(&beside, to).map_err(|error| told(to, error))
}

/// Builds the application for the emulated board, medium size, no panic reachable, to
/// `target/module/float` and `target/module/fixed`; the two.
///
/// # Errors
/// As [`try_build`].
pub fn module() -> Result<[PathBuf; 2], String> {
    let place = target_folder().join("module");
    fs::create_dir_all(&place).map_err(|error| format!("{}: {error}", place.display()))?;
    let mut elfs = [place.join("float"), place.join("fixed")];
    for (elf, features) in elfs.iter_mut().zip(["no-panic", "no-panic,fixed"]) {
        copy_if_other(&try_build(&Build::bin("application", features))?, elf)?;
    }
    Ok(elfs)
}
