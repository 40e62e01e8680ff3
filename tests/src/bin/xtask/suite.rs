//! The tests proper, all through `cargo test`.

use std::path::Path;

use crate::checks::cargo;
use crate::runner::Runner;

/// Every test of core, host and tests, doc tests included. `python` is an interpreter with sarkit.
pub(crate) fn all(runner: &mut Runner, python: Option<&Path>) {
    let mut command = cargo(&["test", "--workspace", "--exclude", "subaperture-firmware"]);
    command.args(["--no-fail-fast", "--locked"]);
    if let Some(python) = python {
        command.env("SUBAPERTURE_PYTHON", python);
    }
    runner.tests("tests", &mut command);
}

/// Only the firmware under QEMU.
pub(crate) fn firmware(runner: &mut Runner) {
    let mut command = cargo(&["test", "--package", "subaperture-tests"]);
    command.args(["--test", "firmware", "--locked"]);
    runner.tests("firmware", &mut command);
}
