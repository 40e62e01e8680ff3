//! Other programs on the same files in the same run, by scripts that call their public functions.
//!
//! Each has a Python environment of its own in `target/bench`. torchbp is not on PyPI: pip builds it from its repository, or from the copy
//! that `SUBAPERTURE_TORCHBP` names (a folder, or any source that pip accepts), for torch from PyPI. `SUBAPERTURE_FASTSAR` names a copy of
//! FastSAR in place of that on PyPI.

use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

use crate::case::{Case, Track};
use crate::child::{self, Failure};
use crate::growth::Series;
use crate::measure::Measured;
use crate::options::Peers;
use crate::recording::{self, place};

/// Image former of another project, in Python.
#[derive(Debug)]
pub(crate) struct Program {
    /// Name in the table.
    name: &'static str,
    /// Name of its Python module, environment and script.
    module: &'static str,
    /// Source for pip, and the variable that replaces it.
    source: &'static str,
    variable: &'static str,
    /// Packages needed to build and run it.
    needed: &'static [&'static str],
    /// Measured methods with their settings, as its script takes them.
    methods: &'static [&'static str],
}

/// Settings are the fastest for their error on cases a, b and c.
const PROGRAMS: [Program; 2] = [
    Program {
        name: "torchbp",
        module: "torchbp",
        source: "git+https://github.com/Ttl/torchbp@3fcafa6",
        variable: "SUBAPERTURE_TORCHBP",
        needed: &["torch", "numpy", "scipy", "setuptools", "wheel", "ninja"],
        methods: &[
            "cartesian",
            "ffbp stages=5 alias_fmod=0 guard_max_ratio=0.5",
            "cfbp stages=4",
            "afbp nsub=32",
            "afbp nsub=64",
            "afbp nsub=32 oversampling=4",
        ],
    },
    Program {
        name: "FastSAR",
        module: "fastsar",
        source: "fastsar==0.1.8",
        variable: "SUBAPERTURE_FASTSAR",
        needed: &["setuptools", "wheel"],
        methods: &[
            "ffbp T=32 levels=4 pmax=0.5",
            "ffbp T=16 levels=2 pmax=0.5",
            "ffbp T=16 levels=3 pmax=0.5",
            "exact",
        ],
    },
];

/// Program and the Python environment in which it is installed.
#[derive(Debug)]
pub(crate) struct Peer {
    program: &'static Program,
    /// Folder of its Python environment.
    folder: PathBuf,
}

/// Each program by name, or the reason why it is not available.
pub(crate) fn find(asked: Peers) -> Vec<(&'static str, Result<Peer, String>)> {
    let found = |program: &'static Program| {
        let peer = Peer {
            program,
            folder: place().join(program.module),
        };
        let result = match asked {
            Peers::No => Err("not asked for".to_owned()),
            _ if peer.works().is_ok() => Ok(peer),
            Peers::IfThere => Err("not installed: --peers installs it".to_owned()),
            Peers::Installed => peer.installed(),
        };
        (program.name, result)
    };
    PROGRAMS.iter().map(found).collect()
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
    pub(crate) fn name(&self) -> &'static str {
        self.program.name
    }

    pub(crate) fn methods(&self) -> &'static [&'static str] {
        self.program.methods
    }

    fn python(&self) -> PathBuf {
        self.folder.join("bin/python")
    }

    fn works(&self) -> Result<(), String> {
        let import = format!("import scipy, {}", self.program.module);
        run(Command::new(self.python()).args(["-c", &import]))
    }

    fn installed(self) -> Result<Self, String> {
        self.install()
            .map_err(|reason| format!("not installed: {reason}"))?;
        self.works()
            .map_err(|reason| format!("it was installed and does not start: {reason}"))?;
        Ok(self)
    }

    fn install(&self) -> Result<(), String> {
        let Program {
            name,
            source,
            variable,
            needed,
            ..
        } = *self.program;
        let source = std::env::var(variable).unwrap_or_else(|_| source.to_owned());
        let folder = &self.folder;
        eprintln!("installing {name} from {source} into {}", folder.display());
        fs::create_dir_all(place()).map_err(|error| error.to_string())?;
        run(Command::new("python3")
            .args(["-m", "venv", "--clear"])
            .arg(folder))?;
        let pip = || {
            let mut command = Command::new(self.python());
            command.args([
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
            ]);
            command
        };
        run(pip().args(needed))?;
        // Built against the torch that it will use; for processors only, as our formers are measured on processors.
        run(pip()
            .args(["--no-build-isolation", &source])
            .env("USE_CUDA", "0"))
    }

    /// Whether it can form the images of a series. torchbp supports one side, and polar grids of the scene's middle only.
    pub(crate) fn takes(&self, series: &Series) -> bool {
        let whole = |case: &Case| case.side as f64 * case.pixel_m >= case.scene_m;
        let along = |case: &Case| matches!(case.track, Track::Along { .. });
        let mut cases = series.cases.iter();
        self.program.module != "torchbp" || cases.all(|case| whole(case) && along(case))
    }

    /// Measure a method in a separate process.
    ///
    /// # Errors
    /// [`Failure`].
    pub(crate) fn measure(
        &self,
        case: &Case,
        method: &str,
        threads: usize,
        limit: Duration,
    ) -> Result<Measured, Failure> {
        let Program { name, module, .. } = self.program;
        eprintln!("case {}, {name} {method} on {threads}", case.name);
        let own = std::env::current_exe().map_err(|error| Failure::Said(error.to_string()))?;
        let folder = recording::ready(case).map_err(Failure::Said)?;
        let script = format!("tests/benches/peers/run_{module}.py");
        let script = subaperture_xtask::root().join(script);
        let mut command = child::command(&self.python(), threads);
        command
            .arg(script)
            .arg(folder)
            .args([method, &case.name])
            .arg(own)
            // FastSAR compiles its kernels on first use.
            .env("FASTSAR_CACHE_DIR", self.folder.join("cache"));
        child::run(command, limit)
    }
}
