//! Where a radar was: logs of navigation receivers, and one track of them and of the radar's own motion.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `navigation`.
//!
//! # Logs
//! [`Log::read`] takes any of these, told by what they hold, and [`each`] hands on their records one by one, in memory that does not grow:
//!
//! | format | what is read |
//! |---|---|
//! | NovAtel OEM7, ASCII or binary, long or short headers, CRC checked | `INSPVA(S)`, `INSPVAX`, `BESTPOS`, `BESTVEL`, `MARKPOS`, `MARKTIME` |
//! | NMEA 0183, checksum checked | `GGA`, `RMC`, `ZDA`, `GST`, `VTG`, `HDT`, as one record a moment |
//! | SBET | all records |
//! | comma-separated values, units in their header | time, place, velocity, attitude, standard deviations |
//!
//! The first two may come side by side in one file. **Damage** is counted and told ([`Account`]), never fatal as long as a record is left;
//! [`Log::coverage`] says which times are lost with it.
//!
//! **Conventions.** Places are on the Earth (WGS 84, heights above the ellipsoid) or in axes of the log's own ([`Place`]); velocities are
//! along east, north and up; attitudes are those of navigators ([`Attitude`]), and what tracks here have for them is [`Record::fix`]. Times are GPS weeks
//! and seconds ([`GpsTime`]), made of UTC by the leap seconds that the [`Account`] states.
//!
//! # Fusion
//! [`fuse`](fusion::fuse) makes one track of a log's positions, velocities and attitudes and of increments that the radar measured itself, by least
//! squares over all of it.
#![forbid(unsafe_code)]

mod account;
mod csv;
pub mod fusion;
mod log;
mod messages;
mod options;
mod read;
mod record;
mod sbet;
mod time;

pub use account::{Account, Clock, Fault, Wrong};
pub use log::{Coverage, Gap, Log};
pub use options::Options;
pub use read::{Format, NavigationError, each, each_from};
pub use record::{Attitude, Kind, Place, Record};
pub use time::GpsTime;
