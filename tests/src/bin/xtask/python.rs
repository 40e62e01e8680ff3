//! The Python environment of the tests: `target/venv` with sarkit in it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What is installed, one requirement a line; also the mark of a finished environment.
const REQUIREMENTS: &str = include_str!("../../../requirements.txt");

/// The repository's root.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the tests package lies in the workspace")
}

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

/// Makes the environment unless a finished one is there; returns its interpreter.
pub(crate) fn ensure_venv() -> Result<PathBuf, String> {
    let target = std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| root().join("target"), |dir| root().join(dir));
    let venv = target.join("venv");
    let python = venv.join("bin/python");
    let mark = venv.join("requirements.txt");
    let works = |program: &Path| run(Command::new(program).args(["-c", "import sarkit"])).is_ok();
    if fs::read_to_string(&mark).is_ok_and(|text| text == REQUIREMENTS) && works(&python) {
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
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        Err(format!("{program} failed:\n{}", told.trim_end()))
    }
}
