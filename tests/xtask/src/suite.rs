//! The tests proper, built by `cargo test`.

use std::path::Path;

use crate::checks::cargo;
use crate::runner::Runner;

/// Without it a test that passes cannot say what it skipped.
const SHOW_OUTPUT: &str = "--show-output";

/// Every test of core, host and tests, doc tests included. `python` is an interpreter with sarkit.
pub(crate) fn all(runner: &mut Runner, python: Option<&Path>) {
    const PACKAGES: [&str; 4] = ["test", "--workspace", "--exclude", "subaperture-firmware"];
    let mut build = cargo(&PACKAGES);
    build.args(["--no-run", "--locked"]);
    build.arg("--message-format=json-render-diagnostics");
    runner.executables("tests", &mut build, |command| {
        match python {
            Some(python) => command.env("SUBAPERTURE_PYTHON", python),
            // One that was set and does not do.
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

/// Only what runs under QEMU.
pub(crate) fn firmware(runner: &mut Runner) {
    let mut build = cargo(&["test", "--package", "subaperture-tests"]);
    build.args(["--test", "firmware", "--no-run", "--locked"]);
    build.arg("--message-format=json-render-diagnostics");
    runner.executables("firmware", &mut build, |_| {});
}
