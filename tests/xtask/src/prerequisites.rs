//! Tools that this machine lacks, and their installation or the advice how to install them.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Once;

use subaperture_xtask::{firmware, root, target_installed};

use crate::python;

/// A tool or library that a command needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Need {
    Rustfmt,
    Clippy,
    /// The standard library of a target.
    Target(&'static str),
    Qemu,
    QemuUser,
    QemuRiscv,
    Python,
    Chromium,
    /// The driver of USRPs to link with: without it the binding is not checked.
    Uhd,
    /// A Vulkan driver: without any, no image is formed by a GPU.
    Vulkan,
    CargoDeny,
    Mdbook,
    /// The tool of the version in Cargo.lock: it refuses modules of another.
    WasmBindgen,
    /// Compiler and library of [`OLDEST_RUST`].
    OldestRust,
}

/// The workspace's `rust-version`.
pub(crate) const OLDEST_RUST: &str = "1.89.0";

/// Target of the web page.
pub(crate) const WASM_TARGET: &str = "wasm32-unknown-unknown";

/// Targets and emulators on which the bits of the streaming core and of the kernels are compared; without them those tests are skipped.
pub(crate) const OTHER_TARGETS: [Need; 3] = [
    Need::Target("thumbv6m-none-eabi"),
    Need::Target("aarch64-unknown-linux-musl"),
    Need::Target("riscv32imafc-unknown-none-elf"),
];
/// Targets for which library and command are checked but not run.
pub(crate) const OTHER_PLATFORMS: [Need; 2] = [
    Need::Target("x86_64-pc-windows-gnu"),
    Need::Target("aarch64-apple-darwin"),
];
pub(crate) const OTHER_EMULATORS: [Need; 2] = [Need::QemuUser, Need::QemuRiscv];

/// Amount of shown output of started programs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Talk {
    /// All output, while they run.
    Shown,
    /// Only that of failed programs, because another program's output is being shown.
    OfFailure,
}

/// Method of installation.
enum Source {
    Debian(&'static [&'static str]),
    Rustup(Vec<&'static str>),
    /// Built by cargo into [`tools`], with these additional arguments.
    Tool(&'static str, Vec<String>),
}

impl Need {
    /// Target of the firmware.
    pub(crate) const FIRMWARE_TARGET: Self = Self::Target(firmware::TARGET);

    pub(crate) fn is_met(self) -> bool {
        match self {
            Self::Rustfmt => works("cargo", &["fmt", "--version"]),
            Self::Clippy => works("cargo", &["clippy", "--version"]),
            Self::Target(target) => target_installed(target),
            Self::Qemu => works("qemu-system-arm", &["--version"]),
            Self::QemuUser => works("qemu-aarch64", &["--version"]),
            Self::QemuRiscv => works("qemu-system-riscv32", &["--version"]),
            Self::Python => python::interpreter().is_some(),
            Self::Chromium => {
                works("chromium", &["--version"]) && works("chromedriver", &["--version"])
            }
            Self::Uhd => Path::new("/usr/include/uhd.h").exists(),
            Self::Vulkan => has_vulkan_driver(),
            Self::CargoDeny => cargo_deny().is_some(),
            Self::Mdbook => mdbook().is_some(),
            Self::WasmBindgen => wasm_bindgen().is_some(),
            Self::OldestRust => toolchain_installed(OLDEST_RUST),
        }
    }

    fn source(self) -> Source {
        match self {
            Self::Qemu => Source::Debian(&["qemu-system-arm"]),
            Self::QemuUser => Source::Debian(&["qemu-user"]),
            Self::QemuRiscv => Source::Debian(&["qemu-system-misc"]),
            Self::Python => Source::Debian(&["python3", "python3-venv"]),
            Self::Chromium => Source::Debian(&["chromium", "chromium-driver"]),
            Self::Uhd => Source::Debian(&["libuhd-dev"]),
            // lavapipe, a driver on the processor, and the library that loads drivers.
            Self::Vulkan => Source::Debian(&["mesa-vulkan-drivers", "libvulkan1"]),
            Self::Rustfmt => Source::Rustup(vec!["component", "add", "rustfmt"]),
            Self::Clippy => Source::Rustup(vec!["component", "add", "clippy"]),
            Self::Target(target) => Source::Rustup(vec!["target", "add", target]),
            Self::CargoDeny => Source::Tool("cargo-deny", vec!["--locked".to_owned()]),
            // Without its web server.
            Self::Mdbook => {
                let features = ["--locked", "--no-default-features", "--features", "search"];
                Source::Tool("mdbook", features.map(str::to_owned).to_vec())
            }
            // Its lock file names versions that a mirror of the registry may not have yet.
            Self::WasmBindgen => {
                let version = wasm_bindgen_version().unwrap_or_default();
                Source::Tool("wasm-bindgen-cli", vec!["--version".to_owned(), version])
            }
            Self::OldestRust => {
                let profile = ["--profile", "minimal"];
                let install = ["toolchain", "install", OLDEST_RUST];
                Source::Rustup([&install[..], &profile].concat())
            }
        }
    }
}

/// Install every missing need.
///
/// # Errors
/// The commands that the user has to run, or the tool that could not be installed.
pub(crate) fn ensure(needs: &[Need], talk: Talk) -> Result<(), String> {
    let missing: Vec<Need> = needs
        .iter()
        .copied()
        .filter(|need| !need.is_met())
        .collect();
    let mut packages: Vec<&str> = Vec::new();
    for need in &missing {
        if let Source::Debian(names) = need.source() {
            packages.extend(names);
        }
    }
    if !packages.is_empty() {
        install_packages(&packages, talk)?;
    }
    for need in &missing {
        match need.source() {
            Source::Debian(_) => {}
            Source::Rustup(arguments) => run("rustup", &arguments, talk)?,
            Source::Tool(name, options) => {
                println!("{name} is missing; building it takes some minutes, once");
                let tools = tools();
                let root = tools.to_string_lossy();
                // Tools that run for seconds need no optimised build of minutes.
                let arguments = ["install", "--quiet", "--debug", "--root"];
                let options: Vec<&str> = options.iter().map(String::as_str).collect();
                run(
                    "cargo",
                    &[&arguments[..], &[&root, name], &options].concat(),
                    talk,
                )?;
            }
        }
    }
    match missing.into_iter().find(|need| !need.is_met()) {
        Some(Need::Python) => Err(
            "Python of at least 3.11 with venv is needed: on Ubuntu 22.04 and \
             older run  sudo apt-get install python3.11 python3.11-venv"
                .to_owned(),
        ),
        Some(need) => Err(format!("{need:?} is still missing after its installation")),
        None => Ok(()),
    }
}

/// Install those of `needs` that can be installed, and report the others.
pub(crate) fn ensure_if_possible(needs: &[Need], talk: Talk) {
    // All in one call; if that fails, one by one.
    if ensure(needs, Talk::OfFailure).is_ok() {
        return;
    }
    for need in needs {
        if let Err(remedy) = ensure(&[*need], talk) {
            eprintln!("{remedy}\n{need:?}: going on without it");
        }
    }
}

/// Whether a Vulkan driver and the library that loads it are installed.
fn has_vulkan_driver() -> bool {
    let drivers = std::fs::read_dir("/usr/share/vulkan/icd.d");
    let has_driver = drivers.is_ok_and(|mut files| files.next().is_some());
    let loaders = [
        "/usr/lib/x86_64-linux-gnu",
        "/usr/lib/aarch64-linux-gnu",
        "/usr/lib64",
        "/usr/lib",
    ];
    has_driver
        && loaders
            .iter()
            .any(|folder| Path::new(folder).join("libvulkan.so.1").exists())
}

/// Whether rustup has a toolchain.
pub(crate) fn toolchain_installed(toolchain: &str) -> bool {
    works("rustup", &["run", toolchain, "rustc", "--version"])
}

/// Whether a nightly Rust is installed, with a subcommand of cargo.
pub(crate) fn nightly_has(subcommand: &str) -> bool {
    works(
        "rustup",
        &["run", "nightly", "cargo", subcommand, "--version"],
    )
}

/// Folder of tools built here; the user's installation is not changed.
fn tools() -> PathBuf {
    root().join("target/tools")
}

/// cargo-deny, installed by the user or built here.
pub(crate) fn cargo_deny() -> Option<PathBuf> {
    tool("cargo-deny")
}

/// mdBook, installed by the user or built here.
pub(crate) fn mdbook() -> Option<PathBuf> {
    tool("mdbook")
}

/// wasm-bindgen of the version in Cargo.lock, installed by the user or built here.
pub(crate) fn wasm_bindgen() -> Option<PathBuf> {
    let expected = format!("wasm-bindgen {}", wasm_bindgen_version()?);
    places("wasm-bindgen").into_iter().find(|path| {
        let version = run_quietly(&path.to_string_lossy(), &["--version"]);
        version.is_some_and(|version| version.trim() == expected)
    })
}

/// Version of wasm-bindgen in Cargo.lock.
fn wasm_bindgen_version() -> Option<String> {
    let lock = std::fs::read_to_string(root().join("Cargo.lock")).ok()?;
    let (_, after) = lock.split_once("name = \"wasm-bindgen\"\nversion = \"")?;
    let (version, _) = after.split_once('"')?;
    Some(version.to_owned())
}

fn places(name: &str) -> [PathBuf; 2] {
    [PathBuf::from(name), tools().join("bin").join(name)]
}

fn tool(name: &str) -> Option<PathBuf> {
    (places(name).into_iter()).find(|path| works(&path.to_string_lossy(), &["--version"]))
}

fn install_packages(packages: &[&str], talk: Talk) -> Result<(), String> {
    let by_hand = format!("sudo apt-get install --yes {}", packages.join(" "));
    if !works("apt-get", &["--version"]) {
        return Err(format!(
            "missing: {}. On Debian or Ubuntu run\n    {by_hand}\nelsewhere install what corresponds",
            packages.join(", ")
        ));
    }
    let prefix: &[&str] = if run_quietly("id", &["-u"]).is_some_and(|id| id.trim() == "0") {
        &["env"]
    } else if works("sudo", &["-n", "true"]) {
        &["sudo", "-n", "env"]
    } else {
        return Err(format!(
            "missing: {}. Run\n    {by_hand}",
            packages.join(", ")
        ));
    };
    let apt = |arguments: &[&str]| {
        let noninteractive = ["DEBIAN_FRONTEND=noninteractive", "apt-get", "--quiet"];
        let words = [&prefix[1..], &noninteractive, arguments].concat();
        run(prefix[0], &words, talk)
    };
    // An outdated or incomplete package list may suffice, so only the installation counts.
    static UPDATED: Once = Once::new();
    UPDATED.call_once(|| {
        if let Err(error) = apt(&["update"]) {
            eprintln!("{error}");
        }
    });
    let install = ["install", "--yes", "--no-install-recommends"];
    apt(&[&install, packages].concat()).map_err(|error| format!("{error}; run\n    {by_hand}"))
}

fn works(program: &str, arguments: &[&str]) -> bool {
    run_quietly(program, arguments).is_some()
}

/// Output of `program`, if it succeeds.
fn run_quietly(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program)
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .ok()
        .filter(|output| output.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn run(program: &str, arguments: &[&str], talk: Talk) -> Result<(), String> {
    let line = format!("{program} {}", arguments.join(" "));
    println!("==> {line}");
    match run_shown(Command::new(program).args(arguments), talk) {
        Ok(true) => Ok(()),
        Ok(false) => Err(format!("failed: {line}")),
        Err(error) => Err(format!("cannot start {line}: {error}")),
    }
}

/// Run a command; returns whether it succeeded.
///
/// # Errors
/// If it cannot be started.
pub(crate) fn run_shown(command: &mut Command, talk: Talk) -> std::io::Result<bool> {
    match talk {
        Talk::Shown => Ok(command.status()?.success()),
        Talk::OfFailure => {
            let output = command.stdin(Stdio::null()).output()?;
            if !output.status.success() {
                for stream in [&output.stdout, &output.stderr] {
                    eprint!("{}", String::from_utf8_lossy(stream));
                }
            }
            Ok(output.status.success())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn version_of_wasm_bindgen_is_the_locked_one() {
        let version = wasm_bindgen_version().unwrap();
        assert!(version.starts_with("0.2."), "{version}");
    }

    #[test]
    fn oldest_rust_is_that_of_the_packages() {
        let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
        let (minor, _) = OLDEST_RUST.rsplit_once('.').unwrap();
        let line = format!("\nrust-version = \"{minor}\"\n");
        assert!(manifest.contains(&line), "no {line}");
    }
}
