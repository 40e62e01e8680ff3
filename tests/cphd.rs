//! CPHD files: written and read back, read from bytes made by hand, damaged, and checked by sarkit.

mod cphd_by_hand;
mod cphd_damage;
mod cphd_reading;
mod cphd_round_trip;
mod cphd_sarkit;
mod cphd_scene;
