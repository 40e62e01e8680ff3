//! Tests that run QEMU or build the firmware, including those of the commands that do so.

mod budgets;
mod cli_link;
mod cli_link_image;
mod cli_products;
mod detections;
mod emulated;
mod ethernet;
mod events;
mod front_end;
mod golden;
mod gotcha;
mod increments;
mod module_selftest;
mod profiles;
mod selftest;
mod serial_line;
mod sessions;
mod stripmap;
mod unsafe_reasons;
