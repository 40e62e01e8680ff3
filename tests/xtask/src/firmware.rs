//! Building the firmware.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::target_folder;

/// What the firmware is compiled for.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// A program of the firmware, and how it is built.
#[derive(Clone, Copy, Debug)]
pub struct Build<'a> {
    /// `--bin` or `--example`.
    pub kind: &'a str,
    /// Its name.
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

/// Builds a program, in a target folder of the firmware's own, and copies its ELF to a place that the next
/// build with other features leaves alone. One build at a time, over all processes.
///
/// # Errors
/// What cargo said, or what kept us from running it.
pub fn try_build(build: &Build<'_>) -> Result<PathBuf, String> {
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
    if build.target.ends_with("-musl") {
        // The linker that comes with Rust, and its own C library: no toolchain of the target is needed.
        let name = build.target.to_uppercase().replace('-', "_");
        command
            .env(format!("CARGO_TARGET_{name}_LINKER"), "rust-lld")
            .env(
                format!("CARGO_TARGET_{name}_RUSTFLAGS"),
                "-C link-self-contained=yes",
            );
    }
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
