//! Python packages: `cargo xtask wheel` writes wheels and the source archive to `target/wheels`, installs them in empty environments, and
//! forms an image with each.
//!
//! Wheels are built by maturin with zig as the linker, so that they run with old C libraries, and for AArch64 without a cross toolchain. A
//! wheel suits Python 3.10 and later (abi3). It holds the command `subap` as well: both share the native module.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use subaperture_xtask::{root, target_folder};

use crate::dist::{DOCUMENTS, LICENCES, licences};
use crate::prerequisites::{Need, Talk, ensure};
use crate::python;

/// Limit of a wheel's size.
const MAX_BYTES: u64 = 15_000_000;

/// Targets with the C library that their wheels name.
const TARGETS: [(&str, &str); 4] = [
    ("x86_64-unknown-linux-gnu", "manylinux_2_17"),
    ("aarch64-unknown-linux-gnu", "manylinux_2_17"),
    ("x86_64-unknown-linux-musl", "musllinux_1_2"),
    ("aarch64-unknown-linux-musl", "musllinux_1_2"),
];

/// Interpreters in whose environments wheels are tested, if they exist.
const INTERPRETERS: [&str; 5] = [
    "python3.10",
    "python3.11",
    "python3.12",
    "python3.13",
    "python3.14",
];

/// Build the wheel for this machine and the source archive, or the wheels for `all` targets too, and test those for this machine.
///
/// # Errors
/// The command that failed, or a wheel that is too large.
pub(crate) fn build(all: bool) -> Result<(), String> {
    ensure(&[Need::Python], Talk::Shown)?;
    let builder = python::ensure_builder()?;
    let place = target_folder().join("wheels");
    let _ = fs::remove_dir_all(&place);
    fs::create_dir_all(&place).map_err(|error| at(&place, &error))?;
    let package = root().join("host/python");
    for name in DOCUMENTS.iter().filter(|name| name.starts_with("LICENSE")) {
        let to = package.join(name);
        fs::copy(root().join(name), &to).map_err(|error| at(&to, &error))?;
    }
    let own = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    for (target, library) in TARGETS {
        if all || target == own {
            ensure(&[Need::Target(target)], Talk::Shown)?;
            let notices = package.join(LICENCES);
            fs::write(&notices, licences("subaperture-python", target)?)
                .map_err(|error| at(&notices, &error))?;
            maturin(
                &builder,
                &[
                    "build",
                    "--release",
                    "--locked",
                    "--zig",
                    "--target",
                    target,
                    "--compatibility",
                    library,
                ],
                &place,
            )?;
        }
    }
    maturin(&builder, &["sdist"], &place)?;
    let files = listed(&place)?;
    for file in &files {
        let bytes = fs::metadata(file).map_err(|error| at(file, &error))?.len();
        println!("{}: {:.1} MB", file.display(), bytes as f64 / 1e6);
        if bytes > MAX_BYTES {
            return Err(format!(
                "{}: expected at most {MAX_BYTES} bytes, found {bytes}",
                file.display()
            ));
        }
    }
    let is_own = |file: &&PathBuf| {
        let name = file.to_string_lossy();
        name.contains("manylinux") && name.contains(std::env::consts::ARCH)
    };
    let wheel = files
        .iter()
        .find(is_own)
        .ok_or("no wheel for this machine")?;
    let mut tested = false;
    for interpreter in INTERPRETERS {
        let exists = Command::new(interpreter).arg("--version").output();
        if exists.is_ok_and(|output| output.status.success()) {
            try_package(Path::new(interpreter), wheel)?;
            tested = true;
        }
    }
    if !tested {
        try_package(Path::new(python::interpreter().ok_or("no Python")?), wheel)?;
    }
    let archive = files
        .iter()
        .find(|file| file.extension().is_some_and(|e| e == "gz"));
    let archive = archive.ok_or("no source archive")?;
    try_package(
        Path::new(python::interpreter().ok_or("no Python")?),
        archive,
    )
}

fn maturin(builder: &Path, arguments: &[&str], place: &Path) -> Result<(), String> {
    let mut path = vec![builder.parent().unwrap_or(Path::new(".")).to_owned()];
    path.extend(std::env::split_paths(
        &std::env::var_os("PATH").unwrap_or_default(),
    ));
    let path = std::env::join_paths(path).map_err(|error| error.to_string())?;
    python::run(
        Command::new(builder)
            .args(["-m", "maturin"])
            .args(arguments)
            .arg("--out")
            .arg(place)
            .arg("--manifest-path")
            .arg(root().join("host/python/Cargo.toml"))
            .env("PATH", path)
            .env("CARGO_TARGET_DIR", target_folder().join("wheel-build"))
            .env("CARGO_PROFILE_RELEASE_DEBUG", "none")
            .env_remove("CARGO"),
    )
}

/// Install a package in an empty environment, run the command, and form the example's image in an empty folder.
fn try_package(interpreter: &Path, package: &Path) -> Result<(), String> {
    let venv = target_folder().join("venv-empty");
    let python = python::empty(interpreter, &venv)?;
    python::install(&python, &[package])?;
    let folder = target_folder().join("wheels/trial");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).map_err(|error| at(&folder, &error))?;
    python::run(
        Command::new(venv.join("bin/subap"))
            .arg("--version")
            .current_dir(&folder),
    )?;
    let example = root().join("host/python/examples/first_image.py");
    let output = Command::new(&python)
        .arg(example)
        .current_dir(&folder)
        .output();
    let output = output.map_err(|error| format!("{}: {error}", python.display()))?;
    let said = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() || !folder.join("first-image/image.png").is_file() {
        return Err(format!(
            "{}: the example failed:\n{said}{errors}",
            package.display()
        ));
    }
    println!(
        "{} in {}: {}",
        package.display(),
        interpreter.display(),
        said.trim()
    );
    Ok(())
}

fn listed(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(folder).map_err(|error| at(folder, &error))?;
    let files = entries.filter_map(|entry| Some(entry.ok()?.path()));
    Ok(files.filter(|path| path.is_file()).collect())
}

fn at(path: &Path, error: &dyn std::fmt::Display) -> String {
    format!("{}: {error}", path.display())
}
