//! Identity of a module and its log texts.

use subaperture_core::link::{Arithmetic, ImageCapacity};
use subaperture_core::stream::Capacity;

/// Identity of a module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Arithmetic of its maps.
    pub arithmetic: Arithmetic,
    /// Maximum sizes of its buffers.
    pub capacity: Capacity,
    /// Maximum sizes of an image that it accumulates.
    pub image: ImageCapacity,
    /// Name and version of its program, without control characters.
    pub version: String,
}

/// Text of a module for display: control characters that a terminal would interpret are replaced.
pub(super) fn printable(text: &str) -> String {
    let replaced = |c: char| match c.is_control() {
        true => char::REPLACEMENT_CHARACTER,
        false => c,
    };
    text.chars().map(replaced).collect()
}
