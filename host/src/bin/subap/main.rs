//! The command `subap`.
fn main() {}
