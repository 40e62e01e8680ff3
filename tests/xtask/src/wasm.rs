//! The web page that forms images: `cargo xtask wasm` writes `target/wasm`.
//!
//! The package `subaperture-wasm` is built for WebAssembly in a target folder shared with checks for other platforms, wasm-bindgen's tool
//! writes each module with its JavaScript, and the page's files are copied next to them. The page loads one of the modules.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use subaperture_xtask::{root, target_folder};

use crate::checks::{cargo, other_platforms};
use crate::prerequisites::{WASM_TARGET, wasm_bindgen};
use crate::runner::Runner;

/// Modules of the page, and the compiler's flags for them in place of those in `.cargo/config.toml`: a browser without relaxed
/// instructions refuses a module that has them.
const MODULES: [(&str, &str); 2] = [
    ("simd128", "-C target-feature=+simd128"),
    ("relaxed", "-C target-feature=+simd128,+relaxed-simd"),
];

/// Variable with the compiler's flags for WebAssembly.
const FLAGS: &str = "CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS";

const PACKAGE: [&str; 4] = ["--package", "subaperture-wasm", "--target", WASM_TARGET];

/// Folder of the kernels' tests, which run in a browser.
fn tests() -> PathBuf {
    target_folder().join("wasm-tests")
}

/// Build the tests of the kernels' lanes with relaxed instructions, which include the others: `host/wasm/tests/page.rs` runs them.
///
/// # Errors
/// A command that failed, or a file that cannot be copied.
pub(crate) fn build_tests() -> Result<(), String> {
    let at = |error| format!("{}: {error}", tests().display());
    fs::create_dir_all(tests()).map_err(at)?;
    let (name, flags) = MODULES[1];
    let mut command = cargo(&["test", "--no-run", "--locked", "--lib"]);
    command.args(["--package", "subaperture-kernels", "--target", WASM_TARGET]);
    command.args(["--target-dir"]);
    command.arg(other_platforms());
    command.args(["--message-format", "json-render-diagnostics"]);
    // These tests do not run the transforms, so dependencies are not optimised.
    for package in ["\"*\"", "subaperture-fft", "subaperture-signal"] {
        let setting = format!("profile.dev.package.{package}.opt-level=0");
        command.args(["--config", &setting]);
    }
    let output = command.env(FLAGS, flags).stderr(Stdio::inherit()).output();
    let output = output.map_err(|error| format!("cargo does not start: {error}"))?;
    let lines = String::from_utf8_lossy(&output.stdout);
    let messages = lines
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok());
    let module = messages
        .filter_map(|message: serde_json::Value| message["executable"].as_str().map(PathBuf::from))
        .next_back()
        .ok_or("the kernels' tests do not build for WebAssembly")?;
    fs::copy(module, tests().join(format!("{name}.wasm"))).map_err(at)?;
    Ok(())
}

/// Folder of the complete page.
pub(crate) fn page() -> PathBuf {
    target_folder().join("wasm")
}

/// Build the page.
///
/// # Errors
/// A command that failed, or a file that cannot be copied.
pub(crate) fn build() -> Result<(), String> {
    let program = wasm_bindgen().ok_or("wasm-bindgen of the version in Cargo.lock is missing")?;
    if page().exists() {
        fs::remove_dir_all(page()).map_err(|error| format!("{}: {error}", page().display()))?;
    }
    // Cargo keeps libraries with other flags apart, and links the module again; macros and build scripts are compiled once for all.
    let folder = other_platforms();
    for (name, flags) in MODULES {
        let mut command = cargo(&["build", "--quiet", "--locked", "--profile", "wasm"]);
        command.args(PACKAGE).arg("--target-dir").arg(&folder);
        succeed(command.env(FLAGS, flags))?;
        let module = folder.join(WASM_TARGET).join("wasm/subaperture_wasm.wasm");
        let mut command = Command::new(&program);
        command.args([
            "--target",
            "web",
            "--no-typescript",
            "--remove-name-section",
        ]);
        command.args(["--out-name", name, "--out-dir"]);
        succeed(command.arg(page()).arg(module))?;
    }
    let files = root().join("host/wasm/page");
    let at = |error| format!("{}: {error}", files.display());
    for entry in fs::read_dir(&files).map_err(at)? {
        let entry = entry.map_err(at)?;
        fs::copy(entry.path(), page().join(entry.file_name())).map_err(at)?;
    }
    println!("{}", page().join("index.html").display());
    Ok(())
}

fn succeed(command: &mut Command) -> Result<(), String> {
    let line = format!("{command:?}");
    let output = (command.output()).map_err(|error| format!("cannot start {line}: {error}"))?;
    match output.status.success() {
        true => Ok(()),
        false => Err(format!(
            "failed: {line}\n{}",
            String::from_utf8_lossy(&output.stderr)
        )),
    }
}

/// Lints of the package and of its dependencies' code for WebAssembly.
pub(crate) fn clippy(runner: &mut Runner) {
    let mut command = cargo(&["clippy", "--locked"]);
    command.args(PACKAGE).arg("--target-dir");
    command.arg(other_platforms());
    command.env(FLAGS, MODULES[1].1);
    command.args(["--package", "subaperture-kernels"]);
    runner.check(
        "clippy, WebAssembly",
        command.args(["--", "-D", "warnings"]),
    );
}
