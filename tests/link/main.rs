//! The module link without an emulator: messages, sessions, the firmware's endpoint, maps files and their images.

mod assembly;
mod endpoint;
mod frames;
mod front_end;
mod golden;
mod image;
mod increments;
mod maps_file;
mod maps_image;
mod messages;
mod profiles;
mod selftest;
mod session;
