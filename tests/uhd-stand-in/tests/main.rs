//! The binding to UHD, and the command built with it, on the stand-in library backed by the simulated radio, and on UHD itself without a
//! device.

mod binding_sources;
mod loading;
#[path = "../src/scene.rs"]
mod scene;
mod uhd_binding;
mod uhd_command;

/// Paths in the binding's sources.
mod error {
    pub(crate) use subaperture_radio::RadioError;
}
mod transceiver {
    pub(crate) use subaperture_radio::{Burst, Event, EventKind, Range, Received, Sample};
}
