//! Planning a collection: what a radar will show, what that takes, and what it costs.

pub mod ambiguity;
pub mod cost;
pub mod grating;
pub mod link;
pub mod parameters;
pub mod sampling;
