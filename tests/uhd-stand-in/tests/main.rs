//! The binding to UHD, and the command that is built with it, against a library that answers from the simulated radio, and against
//! UHD itself without a device.

mod loading;
#[path = "../src/scene.rs"]
mod scene;
mod uhd_binding;
mod uhd_command;
