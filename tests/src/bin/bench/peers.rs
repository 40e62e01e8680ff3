//! Other programs on the same files in the same run: torchbp, by a script that calls its public functions.
//!
//! torchbp is not on PyPI: pip builds it from its repository, or from the copy that `SUBAPERTURE_TORCHBP` names (a folder, or any source
//! that pip accepts), for torch from PyPI, in a separate environment.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use crate::case::{Case, Track};
use crate::child::{self, Failure};
use crate::measure::Measured;
use crate::options::Peers;
use crate::recording::place;

/// Measured methods: backprojection on both grids, and the factorised forms.
pub(crate) const METHODS: [&str; 5] = ["cartesian", "polar", "ffbp", "cfbp", "afbp"];

/// Source of torchbp.
const SOURCE: &str = "git+https://github.com/Ttl/torchbp@3fcafa6";
/// Packages needed to build and run it.
const NEEDED: [&str; 6] = ["torch", "numpy", "scipy", "setuptools", "wheel", "ninja"];

/// A Python with torchbp.
pub(crate) struct Peer {
    python: PathBuf,
}

/// Find it.
///
/// # Errors
/// The reason why it is not available.
pub(crate) fn find(asked: Peers) -> Result<Peer, String> {
    let venv = place().join("torchbp");
    let peer = Peer {
        python: venv.join("bin/python"),
    };
    match asked {
        Peers::No => Err("not asked for".to_owned()),
        _ if peer.works().is_ok() => Ok(peer),
        Peers::IfThere => Err("not installed: --peers installs it".to_owned()),
        Peers::Installed => {
            install(&venv, &peer.python).map_err(|reason| format!("not installed: {reason}"))?;
            peer.works()
                .map_err(|reason| format!("it was installed and does not start: {reason}"))?;
            Ok(peer)
        }
    }
}

fn install(venv: &Path, python: &Path) -> Result<(), String> {
    let source = std::env::var("SUBAPERTURE_TORCHBP").unwrap_or_else(|_| SOURCE.to_owned());
    eprintln!("installing torchbp from {source} into {}", venv.display());
    fs::create_dir_all(place()).map_err(|error| error.to_string())?;
    run(Command::new("python3")
        .args(["-m", "venv", "--clear"])
        .arg(venv))?;
    let pip = || {
        let mut command = Command::new(python);
        command.args([
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
        ]);
        command
    };
    run(pip().args(NEEDED))?;
    // Built against the torch that it will use; for processors only, as our formers are measured on processors.
    run(pip()
        .args(["--no-build-isolation", &source])
        .env("USE_CUDA", "0"))
}

/// Run a command; an error is the last line of its output.
fn run(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|error| error.to_string())?;
    let errors = String::from_utf8_lossy(&output.stderr);
    match output.status.success() {
        true => Ok(()),
        false => Err(errors
            .trim_end()
            .lines()
            .next_back()
            .unwrap_or("pip failed")
            .to_owned()),
    }
}

impl Peer {
    fn works(&self) -> Result<(), String> {
        run(Command::new(&self.python).args(["-c", "import torchbp, scipy"]))
    }

    /// Whether it can form a case's image: it supports one side, polar grids of the scene's middle only, and keeps all profiles in memory.
    pub(crate) fn takes(case: &Case) -> bool {
        let image_m = case.side as f64 * case.pixel_m;
        matches!(case.track, Track::Along { .. }) && image_m >= case.scene_m && case.side <= 2048
    }

    /// Measure a method in a separate process.
    ///
    /// # Errors
    /// [`Failure`].
    pub(crate) fn measure(
        &self,
        case: &Case,
        folder: &Path,
        method: &str,
        threads: usize,
        limit: Duration,
    ) -> Result<Measured, Failure> {
        let own = std::env::current_exe().map_err(|error| Failure::Said(error.to_string()))?;
        let script = subaperture_xtask::root().join("tests/benches/peers/run_torchbp.py");
        let mut command = child::command(&self.python, threads);
        command
            .arg(script)
            .arg(folder)
            .args([method, &case.name])
            .arg(own);
        child::run(command, limit)
    }
}
