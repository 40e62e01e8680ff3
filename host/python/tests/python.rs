//! Tests of the Python package on its sources and the module that cargo has built: `tests/*.py` and the docstrings by pytest, types by mypy
//! and stubtest.
//!
//! The interpreter is that of `SUBAPERTURE_PYTHON`, which `cargo xtask test` sets. Without it the tests are skipped.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const OWN: &str = env!("CARGO_MANIFEST_DIR");

/// Copy the package to a folder `name`, as Python imports it.
fn package(name: &str) -> PathBuf {
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let folder = place.join("subaperture");
    let _ = fs::remove_dir_all(&place);
    fs::create_dir_all(&folder).unwrap();
    for entry in fs::read_dir(Path::new(OWN).join("python/subaperture")).unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            fs::copy(&path, folder.join(path.file_name().unwrap())).unwrap();
        }
    }
    // Cargo writes the module into the folder of the test executables.
    let executable = std::env::current_exe().unwrap();
    let prefix = std::env::consts::DLL_PREFIX;
    let suffix = std::env::consts::DLL_SUFFIX;
    let module = executable.with_file_name(format!("{prefix}_native{suffix}"));
    assert!(module.is_file(), "{} is missing", module.display());
    fs::copy(module, folder.join("_native.abi3.so")).unwrap();
    place
}

/// Python command that imports the package from `place`; `None` without an interpreter.
fn python(place: &Path) -> Option<Command> {
    let Some(python) = std::env::var_os("SUBAPERTURE_PYTHON") else {
        println!("skipped: SUBAPERTURE_PYTHON names no interpreter");
        return None;
    };
    let mut command = Command::new(python);
    command
        .current_dir(place)
        .env("PYTHONPATH", place)
        .env("MYPYPATH", place)
        .env("MPLBACKEND", "agg")
        .env("PYTHONDONTWRITEBYTECODE", "1");
    Some(command)
}

fn succeeds(command: &mut Command) {
    let output = command.output().unwrap();
    let [said, errors] =
        [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    println!("{said}{errors}");
    assert!(output.status.success(), "{command:?}: {}", output.status);
}

/// Run pytest with `arguments` on a copy of the package in the folder `name`.
fn pytest(name: &str, arguments: &[&OsStr]) {
    let place = package(name);
    let Some(mut python) = python(&place) else {
        return;
    };
    python.args(["-m", "pytest", "-q", "-p", "no:cacheprovider"]);
    succeeds(python.args(arguments));
}

/// Run pytest on a file of `tests`.
fn pytest_file(file: &str) {
    let path = Path::new(OWN).join("tests").join(file);
    pytest(file, &["--durations=5".as_ref(), path.as_ref()]);
}

#[test]
fn images_of_python() {
    pytest_file("test_images.py");
}

#[test]
fn estimates_of_python() {
    pytest_file("test_estimates.py");
}

#[test]
fn files_of_other_programs() {
    pytest_file("test_files.py");
}

#[test]
fn images_on_dask_workers() {
    pytest_file("test_distributed.py");
}

#[test]
fn recordings_at_urls() {
    pytest_file("test_urls.py");
}

#[test]
fn notebooks_run() {
    pytest_file("test_notebooks.py");
}

#[test]
fn docstrings_are_true() {
    let arguments = ["--doctest-modules", "subaperture"];
    pytest("docstrings", &arguments.map(OsStr::new));
}

#[test]
fn types_are_those_of_the_stubs() {
    let place = package("types");
    let examples = Path::new(OWN).join("examples");
    if let Some(mut python) = python(&place) {
        python.args(["-m", "mypy", "--strict", "--cache-dir", "cache"]);
        // Dask has few types.
        python.args(["--untyped-calls-exclude", "distributed", "subaperture"]);
        succeeds(python.arg(examples));
    }
    if let Some(mut python) = python(&place) {
        succeeds(python.args(["-m", "mypy.stubtest", "subaperture._native"]));
    }
}
