//! The firmware's station, byte for byte as a host would see it.

mod station_bench;
mod station_products;
mod station_refusals;
