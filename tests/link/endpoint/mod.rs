//! The firmware's endpoint, byte by byte as seen by a host.

mod bench;
mod increments;
mod products;
mod profiles;
mod refusals;
