//! Navigation logs of a recording.

use std::path::PathBuf;

use clap::{Args as Group, ValueHint};
use glam::DVec3;
use serde::{Deserialize, Deserializer};
use subaperture::navigation::GpsTime;
use subaperture::units::Dimension;

use super::settings::parsed_by;
use super::values::{finite, vector};

/// Navigation logs of a recording.
#[derive(Clone, Debug, Default, Group, Deserialize)]
#[serde(default)]
pub(crate) struct Logs {
    /// Navigation log of the recording, in a format that subap navigation reads, to be fused with the echoes: positions, an inertial
    /// solution, or one of each
    #[arg(long, value_name = "LOG", value_hint = ValueHint::FilePath, help_heading = "Navigation")]
    pub(crate) navigation: Vec<PathBuf>,

    /// Time 0 of the recording on the clock of the log: GPS week and seconds of week, or seconds of a clock without weeks [default: as
    /// the recording states; 0 for a log with seconds of its own]
    #[arg(long, value_name = "[WEEK:]SECONDS", allow_hyphen_values = true, requires = "navigation", value_parser = start,
        help_heading = "Navigation")]
    #[serde(deserialize_with = "start_of_job")]
    pub(crate) navigation_start: Option<GpsTime>,

    /// Lever arm from the middle of the antennas to the positions of the log, metres, along the radar's axes: x along the receivers, y
    /// along the line of sight, z up [default: 0,0,0]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, requires = "navigation", value_parser = vector(Dimension::Length),
        help_heading = "Navigation")]
    pub(crate) lever_arm: Option<DVec3>,
}

fn start_of_job<'de, D: Deserializer<'de>>(from: D) -> Result<Option<GpsTime>, D::Error> {
    parsed_by(from, start).map(Some)
}

fn start(text: &str) -> Result<GpsTime, String> {
    let wanted = || "give GPS week and seconds, as 2209:502061.25, or seconds".to_owned();
    let (week, seconds) = match text.split_once(':') {
        None => (0, text),
        Some((week, seconds)) => (week.parse().map_err(|_| wanted())?, seconds),
    };
    let seconds = finite(seconds).map_err(|_| wanted())?;
    Ok(GpsTime { week, seconds })
}
