//! The firmware's endpoint, byte by byte as seen by a host.

mod bench;
mod events;
mod increments;
mod products;
mod profiles;
mod refusals;
