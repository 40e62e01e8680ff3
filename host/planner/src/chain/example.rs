//! Example of a chain, as printed by `subap plan radar --example`.

/// Text of the example: the L-band radar of Chim 2018.
pub const TEXT: &str = include_str!("l-band.toml");
