//! Builds of the firmware.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::{link_alone, target_folder, target_installed};

/// Target of the firmware.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// A program of the firmware and its build options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Build<'a> {
    /// `--bin` or `--example`.
    pub kind: &'a str,
    /// Name of the binary or example.
    pub program: &'a str,
    /// Features, separated by commas. A board other than the default one replaces it.
    pub features: &'a str,
    /// Compilation target.
    pub target: &'a str,
    /// `firmware`, or another profile of the workspace.
    pub profile: &'a str,
}

impl<'a> Build<'a> {
    /// A program for the emulated board.
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

/// All programs that tests run or inspect, ordered by common features. [`build_all`] builds them during other checks, so that no test waits
/// for a build.
const ALL: [Build<'static>; 31] = [
    Build::bin("application", "no-panic"),
    Build::bin("cycles", ""),
    Build::bin("selftest", ""),
    Build::example("sections", ""),
    Build::example("faults", ""),
    Build::example("panics", ""),
    // Not built beforehand, because the linker refuses it.
    Build::example("panics", "no-panic"),
    Build::example("echo", ""),
    Build::example("slow_echo", ""),
    Build::bin("application", "ethernet"),
    Build::example("echo", "ethernet"),
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
    Build::bin("application", "board-h743,no-log"),
    Build::bin("application", "board-h743,usb"),
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

/// Build all programs, except those for targets that are not installed.
///
/// # Errors
/// See [`try_build`].
pub fn build_all() -> Result<(), String> {
    let refused = Build::example("panics", "no-panic");
    let all = ALL.iter().filter(|build| **build != refused);
    for build in all.filter(|build| target_installed(build.target)) {
        try_build(build).map_err(|error| format!("{build:?}\n{error}"))?;
    }
    Ok(())
}

/// Build a program in the firmware's own target folder, and copy its ELF to a path that builds with other features do not touch. One build
/// at a time, over all processes.
///
/// # Errors
/// Output of cargo, or the reason why it could not run; or that the program is not in the list of those built beforehand.
pub fn try_build(build: &Build<'_>) -> Result<PathBuf, String> {
    if !ALL.contains(build) {
        return Err(format!("{build:?} is not in the list of all programs"));
    }
    let folder = target_folder().join("firmware-module");
    let place = folder.join("elf");
    let fault = |path: &Path, error| format!("{}: {error}", path.display());
    fs::create_dir_all(&place).map_err(|error| fault(&place, error))?;
    let lock = File::create(folder.join("one-at-a-time")).map_err(|e| fault(&folder, e))?;
    lock.lock().map_err(|error| fault(&folder, error))?;

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

/// Build a program; returns the path of its ELF.
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

/// The bytes are compared first, so that the copy changes only when its content does; the new file replaces it by a rename.
fn copy_if_other(from: &Path, to: &Path) -> Result<(), String> {
    let fault = |path: &Path, error| format!("{}: {error}", path.display());
    let bytes = fs::read(from).map_err(|error| fault(from, error))?;
    if fs::read(to).is_ok_and(|there| there == bytes) {
        return Ok(());
    }
    let new = to.with_extension("new");
    fs::write(&new, bytes).map_err(|error| fault(&new, error))?;
    // Programs for this machine are executable.
    let mode = fs::metadata(from).map_err(|error| fault(from, error))?;
    fs::set_permissions(&new, mode.permissions()).map_err(|error| fault(&new, error))?;
    fs::rename(&new, to).map_err(|error| fault(to, error))
}

/// Build the application for the emulated board, medium size, without reachable panics, as `target/module/float` and `target/module/fixed`;
/// returns both paths.
///
/// # Errors
/// See [`try_build`].
pub fn module() -> Result<[PathBuf; 2], String> {
    let place = target_folder().join("module");
    fs::create_dir_all(&place).map_err(|error| format!("{}: {error}", place.display()))?;
    let mut elfs = [place.join("float"), place.join("fixed")];
    for (elf, features) in elfs.iter_mut().zip(["no-panic", "no-panic,fixed"]) {
        copy_if_other(&try_build(&Build::bin("application", features))?, elf)?;
    }
    Ok(elfs)
}
