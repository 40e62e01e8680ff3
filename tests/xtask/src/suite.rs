//! Tests built by `cargo test`.

use std::path::Path;
use std::process::Command;

use subaperture_xtask::{link_alone, target_installed};

use crate::checks::{GPU, UHD, cargo, clippy_uhd};
use crate::prerequisites::Need;
use crate::runner::Runner;

/// Without it a passing test cannot report that it skipped something.
const SHOW_OUTPUT: &str = "--show-output";

/// All tests of core, host and tests, including doc tests. `python` is an interpreter with sarkit; `built` is called before the tests start.
pub(crate) fn all(runner: &mut Runner, python: Option<&Path>, built: impl FnOnce(&mut Runner)) {
    const PACKAGES: [&str; 4] = ["test", "--workspace", "--exclude", "subaperture-firmware"];
    let mut build = cargo(&PACKAGES);
    build.args(["--no-run", "--locked"]);
    build.arg("--message-format=json-render-diagnostics");
    runner.executables("tests", &mut build, built, |command| {
        match python {
            Some(python) => command.env("SUBAPERTURE_PYTHON", python),
            // The variable is set, but its Python lacks packages.
            None => command.env_remove("SUBAPERTURE_PYTHON"),
        };
    });
    let mut examples = cargo(&PACKAGES);
    examples.args(["--doc", "--no-fail-fast", "--locked", "--", SHOW_OUTPUT]);
    runner.tests("documentation's examples", &mut examples);
    let mut keystone = cargo(&["test", "--package", "subaperture-core", "--doc"]);
    keystone.args(["--no-default-features", "--locked", "--", SHOW_OUTPUT]);
    runner.tests(
        "documentation's examples, the Keystone alone",
        &mut keystone,
    );
}

/// The guide's blocks, whose pictures the book contains.
pub(crate) fn guide_pages(runner: &mut Runner) {
    let mut command = cargo(&["test", "--workspace", "--exclude", "subaperture-firmware"]);
    command.args(["--test", "cli", "--locked", "--", "guide::", SHOW_OUTPUT]);
    runner.tests("pages of the guide", &mut command);
}

/// The radio's binding to UHD, linked with the installed UHD, and the command with it.
pub(crate) fn uhd(runner: &mut Runner) {
    if binding(runner) {
        runner.tests("command by UHD", &mut of_command(&[UHD_TEST]));
    }
}

/// The radio's binding to UHD, and the command with it and with a GPU. One build of the command has both.
pub(crate) fn hardware(runner: &mut Runner) {
    match (binding(runner), Need::Vulkan.is_met()) {
        (true, true) => runner.tests(
            "command by UHD and by GPU",
            &mut of_command(&[UHD_TEST, GPU_TEST]),
        ),
        (true, false) => {
            runner.tests("command by UHD", &mut of_command(&[UHD_TEST]));
            command_on_gpu(runner);
        }
        (false, _) => command_on_gpu(runner),
    }
}

/// Lints and documentation of the radio's binding to UHD; false without UHD.
fn binding(runner: &mut Runner) -> bool {
    const NAME: &str = "radio by UHD";
    if !Need::Uhd.is_met() {
        runner.skip(NAME, "libuhd-dev is not installed");
        return false;
    }
    clippy_uhd(runner);
    true
}

/// Features of the command, and the executable that tests it with them.
type CommandTest = (&'static str, &'static str);

const UHD_TEST: CommandTest = (UHD, "uhd");
const GPU_TEST: CommandTest = (GPU, "gpu_command");

/// Tests of the command, built with the features of all.
fn of_command(tests: &[CommandTest]) -> Command {
    // With all tested packages: the command depends on most of them, and another selection would enable other features of dependencies, and
    // build all of them again.
    let mut command = cargo(&["test", "--workspace", "--exclude", "subaperture-firmware"]);
    for (features, test) in tests {
        command.args(["--features", features, "--test", test]);
    }
    command.args(["--no-fail-fast", "--locked", "--", SHOW_OUTPUT]);
    command
}

/// The command with a GPU.
pub(crate) fn command_on_gpu(runner: &mut Runner) {
    const NAME: &str = "command by GPU";
    match Need::Vulkan.is_met() {
        true => runner.tests(NAME, &mut of_command(&[GPU_TEST])),
        false => runner.skip(NAME, "no Vulkan driver is installed"),
    }
}

/// Library and command with a GPU.
pub(crate) fn gpu(runner: &mut Runner) {
    let mut command = cargo(&["test", "--package", "subaperture-gpu"]);
    command.args(["--no-fail-fast", "--locked", "--", SHOW_OUTPUT]);
    runner.tests("library by GPU", &mut command);
    command_on_gpu(runner);
}

/// Tests marked as ignored: each takes minutes.
pub(crate) fn long(runner: &mut Runner) {
    let mut command = cargo(&["test", "--workspace", "--exclude", "subaperture-firmware"]);
    command.args(["--tests", "--no-fail-fast", "--locked"]);
    command.args(["--", "--ignored", SHOW_OUTPUT]);
    runner.tests("tests that take minutes each", &mut command);
}

/// Tests under QEMU only.
pub(crate) fn firmware(runner: &mut Runner) {
    let mut build = cargo(&["test", "--package", "subaperture-tests"]);
    build.args(["--test", "firmware", "--no-run", "--locked"]);
    build.arg("--message-format=json-render-diagnostics");
    runner.executables("firmware", &mut build, |_| {}, |_| {});
}

/// The kernels' tests in NEON, on an emulated processor.
pub(crate) fn kernels_elsewhere(runner: &mut Runner) {
    const NAME: &str = "kernels on AArch64";
    const TARGET: &str = "aarch64-unknown-linux-musl";
    if !target_installed(TARGET) {
        return runner.skip(NAME, &format!("{TARGET} is not installed"));
    }
    if !Need::QemuUser.is_met() {
        return runner.skip(NAME, "qemu-aarch64 is not installed");
    }
    let mut command = cargo(&["test", "--package", "subaperture-kernels"]);
    // Dependencies of the kernels need the transforms, but these tests do not run them, so they are not optimised.
    let transforms = "profile.dev.package.subaperture-fft.opt-level=0";
    command
        .args(["--lib", "--test", "kernels", "--target", TARGET])
        .args(["--config", transforms, "--no-fail-fast", "--locked"])
        .args(["--", SHOW_OUTPUT])
        .env(
            "CARGO_TARGET_AARCH64_UNKNOWN_LINUX_MUSL_RUNNER",
            "qemu-aarch64",
        );
    link_alone(&mut command, TARGET);
    runner.tests(NAME, &mut command);
}
