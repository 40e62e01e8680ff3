//! The binding to UHD, and the command built with it, on the stand-in library backed by the simulated radio, and on UHD itself without a
//! device.

mod loading;
#[path = "../src/scene.rs"]
mod scene;
mod uhd_binding;
mod uhd_command;
