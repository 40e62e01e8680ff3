//! Python of the tests: that of `SUBAPERTURE_PYTHON`, otherwise `target/venv` with sarkit, rio-cogeo, xarray, zarr and
//! stanag4607.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use subaperture_xtask::{root, target_folder};

/// Requirements, one per line; also the mark of a complete environment.
const REQUIREMENTS: &str = include_str!("../../requirements.txt");

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
    run(Command::new(python).args(["-c", "import sarkit, rio_cogeo, xarray, zarr, stanag4607"]))
}

/// Make the environment unless a complete one exists; returns its interpreter.
pub(crate) fn ensure_venv() -> Result<PathBuf, String> {
    let target = target_folder();
    let venv = target.join("venv");
    let python = venv.join("bin/python");
    let mark = venv.join("requirements.txt");
    if fs::read_to_string(&mark).is_ok_and(|text| text == REQUIREMENTS)
        && has_packages(&python).is_ok()
    {
        return Ok(python);
    }
    println!(
        "making {} ({})",
        venv.display(),
        REQUIREMENTS.lines().last().unwrap_or("")
    );
    let base = interpreter().ok_or("no Python of at least 3.11 with venv was found")?;
    fs::create_dir_all(&target).map_err(|e| format!("cannot make {}: {e}", target.display()))?;
    run(Command::new(base)
        .args(["-m", "venv", "--clear"])
        .arg(&venv))?;
    let pip = [
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
    ];
    run(Command::new(&python)
        .args(pip)
        .arg("--requirement")
        .arg(root().join("tests/requirements.txt")))?;
    fs::write(&mark, REQUIREMENTS).map_err(|e| format!("cannot write {}: {e}", mark.display()))?;
    Ok(python)
}

fn run(command: &mut Command) -> Result<(), String> {
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
