//! Planning a collection: what a radar will show, what that takes, and what it costs.

pub mod grating;
pub mod link;
