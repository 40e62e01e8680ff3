//! The firmware's station, byte for byte as a host would see it.

mod bench;
mod increments;
mod products;
mod profiles;
mod refusals;
