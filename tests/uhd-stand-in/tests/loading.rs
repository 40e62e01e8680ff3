//! Start programs with the stand-in in place of UHD.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::scene;

/// File name under which this executable, and any of the same build, looks for UHD.
fn library() -> String {
    let output = Command::new("ldd")
        .arg(std::env::current_exe().unwrap())
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let words = text.split_whitespace();
    words
        .into_iter()
        .find(|word| word.starts_with("libuhd.so"))
        .expect("the binding is linked with UHD")
        .to_owned()
}

/// A run of `program` that loads the stand-in from the folder `libraries`, which is made if necessary, with these faults of its radio.
pub(crate) fn with_stand_in_loaded(program: &Path, libraries: &Path, faults: &str) -> Command {
    let name = format!(
        "{}uhd_stand_in{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    );
    let here = std::env::current_exe().unwrap();
    let built: PathBuf = here.parent().unwrap().join(name);
    let copy = libraries.join(library());
    if !copy.exists() {
        fs::create_dir(libraries).unwrap();
        fs::copy(&built, copy).unwrap();
    }
    let mut command = Command::new(program);
    command
        .env("LD_LIBRARY_PATH", libraries)
        .env(scene::FAULTS, faults);
    command
}
