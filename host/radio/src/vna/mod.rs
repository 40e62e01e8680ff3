//! Capture with a vector network analyser over TCP, one Touchstone file per sweep.
//!
//! ```text
//! experiment (TOML, kind = "vna") ──> capture ── stop, trigger, data, frequencies, errors ──> Instrument ── SCPI ──> analyser
//!                                       └──> folder: sweepNNNNN.sKp, recording.toml, capture.json, timesNNNNN.npy
//! ```
//!
//! # Rules
//!
//! - The state of the analyser is kept (no preset), so that its calibration remains in effect. Frequencies, IF bandwidth, power and the measured
//!   parameter are set, then read back. Values that differ are refused.
//! - A sweep is the data block, the frequency list and an empty error queue. After any fault ([`FaultKind`]) the sweep is repeated. After a fault of
//!   the connection or of an answer, the connection is opened again and the analyser configured again: a late answer is never taken for another one.
//! - A sweep that fails after all retries ends the capture. Sweeps before it are complete files.
//! - Files are written atomically and never replaced. A folder is continued only with the same settings.
//! - Every fault is in the record `capture.json`, with counts by kind.
//!
//! Memory: one sweep, and the times of all.
//!
//! Sources of the commands: IEEE 488.2 and SCPI 1999.0; command references of Keysight's PNA, ENA E5080 and ENA E5071C, of Rohde & Schwarz' ZNB and
//! ZVA, and of Copper Mountain's S2VNA. Tested with a simulated analyser only.

pub mod answer;
mod capture;
mod connection;
mod description;
mod dialect;
mod error;
mod fault;
mod folder;
mod instrument;
mod keys;
mod settings;
mod touchstone;

pub use capture::{Ended, Summary, capture};
pub use error::VnaError;
pub use fault::{Fault, FaultKind};
pub use folder::Record;
pub(crate) use keys::SCHEMA;
pub use keys::reference;
pub use settings::{Analyser, ByteOrder, Dialect, Mode, Scan, Trigger, VnaExperiment};
