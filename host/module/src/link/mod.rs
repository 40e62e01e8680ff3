//! Host end of the link: sends pulses to a module and receives its maps.
//!
//! A [`ModuleAddress`] addresses a module, a [`Transport`] carries bytes in both directions, and a [`Session`] conducts the
//! conversation of [`subaperture_core::link`]: it greets the module, sends the settings of a [`Job`], streams its pulses as
//! far as the module has room, and passes each complete map once to a [`MapSink`].
//!
//! ```text
//! Place -> Transport -> Session <- Job (Setup, patches, PulseSource <- PhaseHistory)
//!                          └-> MapSink (a file of maps; Verified compares with the core run here)
//!                              DetectionSink, AccumulatedImage
//! ```
//!
//! [`Session::transfer`] receives maps, [`Session::detect`] detections on the maps, and [`Session::accumulate`] an image that the
//! module sums over all sub-CPIs, which is sent once.
//!
//! For motion increments, [`Session::increments`] sends an [`MotionRun`] instead. For range profiles of a stepped-frequency
//! radar, [`Session::profiles`] sends a [`ProfileRun`].
//!
//! **Losses**: frames damaged on the line are lost and counted ([`Counts`]). Maps lost with them are repeated in further runs.
//! An accepted map has passed the checksums of its frames and of the whole map, and has the requested sub-CPI, patch, times
//! and number of pulses.
//!
//! **Cost**: memory for one map, 64 pulses and two frames; one thread that waits for the line.
//! **Tests**: `tests/link/session.rs`, over lines with all kinds of faults; `tests/firmware/sessions.rs`, the same with
//! emulated firmware, resets and power loss. **Errors**: [`LinkError`].

mod asking;
mod conversation;
mod counts;
#[cfg(unix)]
mod emulator;
mod ending;
mod identity;
mod increments;
mod intake;
mod job;
mod keep;
mod line;
mod open;
mod place;
mod products;
mod profiles;
mod rehearsal;
mod running_image;
mod session;
mod settings;
mod transport;
#[cfg(unix)]
mod trust;
mod verify;

pub use counts::Counts;
#[cfg(unix)]
pub use emulator::Emulator;
pub use ending::{LinkError, Mismatch, Outcome, SinkError, TransferEnd, UnnamedFirmware};
pub use identity::Identity;
pub use increments::{MotionRun, Odometer};
pub use job::{Job, PulseSource};
pub use open::open;
pub use place::{Firmware, ModuleAddress, ModuleAddressError};
pub use products::{
    AccumulatedImage, ChannelDetection, DetectionSink, Detector, ImageRequest, ImageSum, MapSink,
    Request,
};
pub use profiles::{Profile, ProfileRun, Profiles, SweepBurst, SweepSource};
pub use rehearsal::rehearse;
pub use running_image::{MAX_WAITING, RunningImage};
pub use session::{Buffers, Session, SessionObserver};
pub use settings::Settings;
pub use subaperture_core::link::Increment;
pub use transport::Transport;
pub use verify::{HostCore, Verified};
