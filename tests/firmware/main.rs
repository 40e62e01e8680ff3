//! Everything that runs under QEMU or builds the firmware, the commands that do so among it.

mod budgets;
mod cli_link;
mod cli_link_image;
mod emulated;
mod golden;
mod gotcha;
mod increments;
mod profiles;
mod selftest;
mod serial_line;
mod sessions;
mod unsafe_reasons;
