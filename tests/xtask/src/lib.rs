//! Shared by `cargo xtask` and the tests: paths, cargo, and builds of the firmware.
#![forbid(unsafe_code)]

pub mod firmware;
pub mod processor;

use std::path::{Path, PathBuf};
use std::process::Command;

/// The repository's root.
///
/// # Panics
/// If this package has moved.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(2)
        .expect("the package lies in the folder of tests")
}

/// Folder of builds: `target`, or `CARGO_TARGET_DIR`.
pub fn target_folder() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| root().join("target"), |folder| root().join(folder))
}

/// The running cargo, in the repository's root.
pub fn cargo() -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root());
    command
}

/// Whether the compiler in use has the standard library of `target`, with or without rustup.
pub fn target_installed(target: &str) -> bool {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc)
        .args(["--print", "target-libdir", "--target", target])
        .output();
    output.is_ok_and(|output| {
        let folder = String::from_utf8_lossy(&output.stdout);
        output.status.success() && Path::new(folder.trim()).is_dir()
    })
}

/// Link a build for a musl target with Rust's own linker and C library, without a toolchain of the target.
pub fn link_alone(command: &mut Command, target: &str) {
    if target.ends_with("-musl") {
        let name = format!("CARGO_TARGET_{}", target.to_uppercase().replace('-', "_"));
        command
            .env(format!("{name}_LINKER"), "rust-lld")
            .env(format!("{name}_RUSTFLAGS"), "-C link-self-contained=yes");
    }
}
