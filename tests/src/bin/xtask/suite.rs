//! The tests proper, all through `cargo test`.

use std::path::Path;

use crate::checks::cargo;
use crate::runner::Runner;

/// Without it a test that passes cannot say what it skipped.
const SHOW_OUTPUT: &str = "--show-output";

/// Every test of core, host and tests, doc tests included. `python` is an interpreter with sarkit.
pub(crate) fn all(runner: &mut Runner, python: Option<&Path>) {
    let mut command = cargo(&["test", "--workspace", "--exclude", "subaperture-firmware"]);
    command.args(["--no-fail-fast", "--locked", "--", SHOW_OUTPUT]);
    match python {
        Some(python) => command.env("SUBAPERTURE_PYTHON", python),
        // One that was set and does not do.
        None => command.env_remove("SUBAPERTURE_PYTHON"),
    };
    runner.tests("tests", &mut command);
}

/// Only what runs under QEMU.
pub(crate) fn firmware(runner: &mut Runner) {
    let mut command = cargo(&["test", "--package", "subaperture-tests"]);
    for test in [
        "cli_link",
        "cli_link_image",
        "firmware",
        "firmware_link",
        "golden",
        "link_emulated",
        "link_gotcha",
        "module_budgets",
    ] {
        command.args(["--test", test]);
    }
    command.args(["--locked", "--", SHOW_OUTPUT]);
    runner.tests("firmware", &mut command);
}
