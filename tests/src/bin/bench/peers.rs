//! Other programs on the same files in the same run: torchbp, by a script of ours that calls what it publishes.
//!
//! It is not on PyPI: pip builds it from its repository, or from the copy that `SUBAPERTURE_TORCHBP` names (a folder, or anything that pip
//! takes), for torch as PyPI has it, into an environment of its own.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use crate::case::{Case, Track};
use crate::child::{self, Failure};
use crate::measure::Measured;
use crate::options::Peers;
use crate::recording::place;

/// What is measured of it: backprojection on both its grids, and its factorised forms.
pub(crate) const METHODS: [&str; 5] = ["cartesian", "polar", "ffbp", "cfbp", "afbp"];

/// Where it comes from.
const SOURCE: &str = "git+https://github.com/Ttl/torchbp@3fcafa6";
/// What it is built with, and stands on.
const NEEDED: [&str; 6] = ["torch", "numpy", "scipy", "setuptools", "wheel", "ninja"];

/// A Python that has torchbp.
pub(crate) struct Peer {
    python: PathBuf,
}

/// Finds it, or why there is none.
///
/// # Errors
/// That.
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
            install(&venv, &peer.python).map_err(|what| format!("not installed: {what}"))?;
            peer.works()
                .map_err(|what| format!("it was installed and does not start: {what}"))?;
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
    // It is built against the very torch that it will find; for processors, ours are measured on no other.
    run(pip()
        .args(["--no-build-isolation", &source])
        .env("USE_CUDA", "0"))
}

/// Runs it; the last line of what it said if it fails.
fn run(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|error| error.to_string())?;
    let told = String::from_utf8_lossy(&output.stderr);
    match output.status.success() {
        true => Ok(()),
        false => Err(told
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

    /// Whether it can form a case's image: it sees one side, forms the scene's middle alone by polar grids, and holds all profiles at once.
    pub(crate) fn takes(case: &Case) -> bool {
        let image_m = case.side as f64 * case.pixel_m;
        matches!(case.track, Track::Along { .. }) && image_m >= case.scene_m && case.side <= 2048
    }

    /// Measures a method by a process of its own.
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
