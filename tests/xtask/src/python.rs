//! Python of the tests: that of `SUBAPERTURE_PYTHON`, otherwise `target/venv` with the packages of `tests/requirements.txt`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use subaperture_xtask::{root, target_folder};

/// Requirements of the tests, one per line; also the mark of a complete environment.
const REQUIREMENTS: &str = include_str!("../../requirements.txt");
/// Requirements of building wheels.
const OF_WHEELS: &str = include_str!("../../requirements-wheel.txt");
/// Name of the mark in an environment.
const MARK: &str = "requirements.txt";

/// A Python of at least 3.11 (sarkit needs it) that can make environments.
pub(crate) fn interpreter() -> Option<&'static str> {
    let candidates = ["python3", "/usr/bin/python3", "python3.13", "python3.12"];
    candidates.into_iter().chain(["python3.11"]).find(|python| {
        Command::new(python)
            .args([
                "-c",
                "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))",
            ])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status()
            .is_ok_and(|status| status.success())
    })
}

/// The Python of `SUBAPERTURE_PYTHON`, if it has the packages of the tests; otherwise a message is printed.
pub(crate) fn named() -> Option<PathBuf> {
    let mut python = PathBuf::from(std::env::var_os("SUBAPERTURE_PYTHON")?);
    // Tests run in other folders, so a relative path is made absolute. A bare name is found in PATH; links are kept, because Python finds
    // its environment by them.
    if python.components().count() > 1 {
        python = std::path::absolute(&python).unwrap_or(python);
    }
    match has_packages(&python) {
        Ok(()) => Some(python),
        Err(error) => {
            eprintln!("SUBAPERTURE_PYTHON lacks a package: {error}");
            None
        }
    }
}

fn has_packages(python: &Path) -> Result<(), String> {
    const MODULES: &str = "sarkit, rio_cogeo, xarray, zarr, stanag4607, pytest, mypy, distributed, matplotlib, nbclient, ipykernel";
    run(Command::new(python).args(["-c", &format!("import {MODULES}")]))
}

/// Make the environment of the tests unless a complete one exists; returns its interpreter.
pub(crate) fn ensure_venv() -> Result<PathBuf, String> {
    let venv = target_folder().join("venv");
    let python = venv.join("bin/python");
    if is_complete(&venv, REQUIREMENTS) && has_packages(&python).is_ok() {
        return Ok(python);
    }
    make(&venv, "tests/requirements.txt", REQUIREMENTS)
}

/// Make the environment that builds wheels unless a complete one exists; returns its interpreter.
pub(crate) fn ensure_builder() -> Result<PathBuf, String> {
    let venv = target_folder().join("venv-wheel");
    match is_complete(&venv, OF_WHEELS) {
        true => Ok(venv.join("bin/python")),
        false => make(&venv, "tests/requirements-wheel.txt", OF_WHEELS),
    }
}

fn is_complete(venv: &Path, requirements: &str) -> bool {
    fs::read_to_string(venv.join(MARK)).is_ok_and(|text| text == requirements)
}

/// Make an environment from a file of requirements, whose text marks it as complete.
fn make(venv: &Path, file: &str, requirements: &str) -> Result<PathBuf, String> {
    println!("making {} ({file})", venv.display());
    let base = interpreter().ok_or("no Python of at least 3.11 with venv was found")?;
    let python = empty(Path::new(base), venv)?;
    install(&python, &[Path::new("--requirement"), &root().join(file)])?;
    let mark = venv.join(MARK);
    fs::write(&mark, requirements).map_err(|e| format!("cannot write {}: {e}", mark.display()))?;
    Ok(python)
}

/// Make an empty environment; returns its interpreter.
pub(crate) fn empty(base: &Path, venv: &Path) -> Result<PathBuf, String> {
    let target = target_folder();
    fs::create_dir_all(&target).map_err(|e| format!("cannot make {}: {e}", target.display()))?;
    run(Command::new(base).args(["-m", "venv", "--clear"]).arg(venv))?;
    Ok(venv.join("bin/python"))
}

/// Install packages by pip.
pub(crate) fn install(python: &Path, packages: &[&Path]) -> Result<(), String> {
    let pip = [
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
    ];
    run(Command::new(python).args(pip).args(packages))
}

pub(crate) fn run(command: &mut Command) -> Result<(), String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let output = command
        .output()
        .map_err(|e| format!("cannot start {program}: {e}"))?;
    if output.status.success() {
        Ok(())
    } else {
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        Err(format!("{program} failed:\n{}", errors.trim_end()))
    }
}
