//! The host's end of the link: pulses to a module, maps back.
//!
//! **What it does.** A [`Place`] says where a module is, a [`Transport`] carries bytes there and back, and
//! a [`Session`] leads the conversation of [`subaperture_core::link`]: it greets the module, sends a
//! [`Job`]'s settings, streams its pulses as far as the module has room, and hands each map that came
//! whole to a [`MapSink`], once.
//!
//! ```text
//! Place -> Transport -> Session <- Job (Setup, patches, PulseSource <- PhaseHistory)
//!                          └-> MapSink (a file of maps; Verified compares with the core run here)
//! ```
//!
//! A module that finds the radar's own motion is sent an [`Odometry`] instead, by [`Session::increments`]; one beside a radio that steps its carrier a [`Ranging`], by
//! [`Session::profiles`].
//!
//! **Neglected**: nothing. Frames that the line damages are lost and counted ([`Counts`]); the maps that
//! they cost are fetched by further runs. What is taken has passed the checksums of its frames and of
//! the whole map, and is of the sub-CPI, patch, times and number of pulses that were asked for.
//!
//! **Cost**: memory of one map, 64 pulses and two frames; one thread, which waits for the line.
//! **Accuracy, errors**: `tests/link/session.rs`, lines with faults of every kind;
//! `tests/firmware/sessions.rs`, the same with the firmware under emulation, resets and lost power;
//! [`LinkError`].

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
pub use ending::{Ending, LinkError, Mismatch, Outcome, SinkError, UnnamedFirmware};
pub use identity::Identity;
pub use increments::{Odometer, Odometry};
pub use intake::MapSink;
pub use job::{Job, PulseSource};
pub use open::open;
pub use place::{Firmware, Place, PlaceError};
pub use profiles::{Profile, Profiles, Ranging, SweepBurst, SweepSource};
pub use rehearsal::rehearse;
pub use running_image::{MOST_WAITING, RunningImage};
pub use session::{Buffers, Session, Watch};
pub use settings::Settings;
pub use subaperture_core::link::Increment;
pub use transport::Transport;
pub use verify::{HostCore, Verified};
