//! Arguments of the process, which records contain.

use std::ffi::OsString;
use std::sync::OnceLock;

static ARGUMENTS: OnceLock<Vec<OsString>> = OnceLock::new();

/// Set the arguments, the name of the program first. Later calls have no effect.
pub(crate) fn set(arguments: impl IntoIterator<Item = OsString>) {
    ARGUMENTS.get_or_init(|| arguments.into_iter().collect());
}

/// Arguments, the name of the program first; empty before [`set`].
pub(crate) fn arguments() -> &'static [OsString] {
    ARGUMENTS.get().map_or(&[], Vec::as_slice)
}
