//! Scripts of `tests/python`, run by the Python of `SUBAPERTURE_PYTHON`, or `python3`.

use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

/// Run a script, print its output, and assert that it succeeds.
///
/// # Panics
/// If Python does not start or the script fails.
#[track_caller]
pub fn script<A: AsRef<OsStr>>(name: &str, arguments: impl IntoIterator<Item = A>) {
    let python = std::env::var_os("SUBAPERTURE_PYTHON").unwrap_or_else(|| "python3".into());
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("python")
        .join(name);
    let output = Command::new(&python).arg(path).args(arguments).output();
    let output = output.unwrap_or_else(|error| {
        panic!("cannot run {python:?} ({error}) with the packages of tests/requirements.txt")
    });
    let text = String::from_utf8_lossy(&output.stdout);
    println!("{text}");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}{errors}");
}
