//! Building the firmware, for `cargo xtask` and for the tests.
#![forbid(unsafe_code)]

pub mod firmware;

use std::path::Path;

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
