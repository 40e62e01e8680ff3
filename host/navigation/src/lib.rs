//! Logs of navigation receivers, and fusion of navigation with the radar's own motion.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation: module `navigation` of the crate `subaperture`.
//!
//! # Logs
//! [`Log::read`] reads any of these formats, recognised by their content. [`each`] passes on the records one by one, in constant memory:
//!
//! | format | records read |
//! |---|---|
//! | NovAtel OEM7, ASCII, abbreviated ASCII or binary, long or short headers, CRC checked where there is one | `INSPVA(S)`, `INSPVAX`, `BESTPOS`, `BESTVEL`, `MARKPOS`, `MARKTIME` |
//! | NMEA 0183, checksum checked where talkers write one | `GGA`, `RMC`, `ZDA`, `GST`, `VTG`, `HDT`, one record per time |
//! | SBET | all records |
//! | comma-separated values, units in their header | time, place, velocity, attitude, standard deviations |
//!
//! NovAtel and NMEA messages may alternate in one file. **Damage** is counted and reported ([`ReadReport`]); it is an error only if no record is left. [`Log::coverage`] lists the gaps that it causes. [`ReadReport::doubts`] lists
//! assumptions about the records, and positions that no vehicle can have.
//!
//! **Conventions.** Positions are on the Earth (WGS 84, ellipsoidal heights) or in local axes of the log ([`Place`]). Velocities are along east, north and up. Attitudes are roll, pitch and azimuth ([`Attitude`]); [`Record::fix`]
//! converts them to those of tracks. Times are GPS weeks and seconds ([`GpsTime`]), converted from UTC by the leap seconds that the [`ReadReport`] states.
//!
//! [`mod@write`] writes logs of a vehicle's motion, as the simulator does.
//!
//! # Fusion
//! [`fuse`](fusion::fuse) estimates one track from a log's positions, velocities and attitudes and the radar's own increments of motion, by least squares over the whole time.
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
pub mod write;

pub use account::{Clock, Fault, ReadReport, Wrong};
pub use log::{Coverage, Gap, Log};
pub use options::Options;
pub use read::{Format, NavigationError, each, each_from};
pub use record::{Attitude, Kind, Place, Record};
pub use time::GpsTime;
