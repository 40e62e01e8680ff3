//! Logs of navigation beside a recording.

use std::path::PathBuf;

use clap::{Args as Group, ValueHint};
use glam::DVec3;
use subaperture::navigation::GpsTime;
use subaperture::units::Dimension;

use super::values::{finite, vector};

/// What is known of where the radar was, beside its recording.
#[derive(Debug, Group)]
pub(crate) struct Logs {
    /// Navigation of the recording's time, as subap navigation reads it, for one track with the echoes: a log of positions, of an
    /// inertial solution, or one of each
    #[arg(long, value_name = "LOG", value_hint = ValueHint::FilePath, help_heading = "Navigation")]
    pub(crate) navigation: Vec<PathBuf>,

    /// When the recording's time 0 was by the log's clock: GPS week and seconds of it, or seconds of a clock that has no weeks
    /// [default: what the recording says; 0 of a log with seconds of its own]
    #[arg(long, value_name = "[WEEK:]SECONDS", allow_hyphen_values = true, requires = "navigation", value_parser = start,
        help_heading = "Navigation")]
    pub(crate) navigation_start: Option<GpsTime>,

    /// From the middle of the radar's antennas to where the log's places are, along the radar's axes (x along the receivers, y where it
    /// looks, z up), metres
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, requires = "navigation", value_parser = vector(Dimension::Length),
        help_heading = "Navigation")]
    pub(crate) lever_arm: Option<DVec3>,
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
