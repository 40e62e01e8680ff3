//! Limit of the memory of a recording and its image.

/// Maximum memory of recording, image and scratch, bytes: half of the address space, which also holds copies for JavaScript.
pub const MEMORY_BYTES: u64 = 2 << 30;
