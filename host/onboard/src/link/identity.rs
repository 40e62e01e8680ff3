//! Who a module is, and its words.

use subaperture_core::link::Arithmetic;
use subaperture_core::stream::Capacity;

/// Who a module is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// The arithmetic of its maps.
    pub arithmetic: Arithmetic,
    /// The sizes its buffers were built for.
    pub capacity: Capacity,
    /// Name and version of its program, without control characters.
    pub version: String,
}

/// A module's words as they are shown: what would reach a terminal as a command is replaced.
pub(super) fn shown(text: &str) -> String {
    let replaced = |c: char| match c.is_control() {
        true => char::REPLACEMENT_CHARACTER,
        false => c,
    };
    text.chars().map(replaced).collect()
}
