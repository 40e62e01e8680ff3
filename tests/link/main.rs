//! A module as its host sees it, without an emulator: messages, sessions, the station, files of maps and their images.

mod assembly;
mod frames;
mod golden;
mod increments;
mod maps_file;
mod maps_image;
mod messages;
mod profiles;
mod session;
mod station;
