//! `subap navigation`.

use std::path::PathBuf;

use clap::{Args as Group, ValueEnum, ValueHint};
use glam::DVec3;
use subaperture::navigation::Kind;
use subaperture::units::Dimension;

use super::Writing;
use super::values::{output, vector};

/// `subap navigation`.
#[derive(Debug, Group)]
pub(crate) struct Navigation {
    /// Log: NovAtel ASCII or binary, NMEA 0183, SBET, or CSV with units in its header
    #[arg(value_name = "LOG", value_hint = ValueHint::FilePath)]
    pub(crate) file: PathBuf,

    /// CSV file for the track; its picture is written as PNG with the same name
    #[arg(short, long, value_name = "TRACK.csv", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: Option<PathBuf>,

    /// Records that form the track [default: those with the most positions and attitudes]
    #[arg(long, value_enum, requires = "out")]
    pub(crate) record: Option<RecordKind>,

    /// Origin of the track's axes (east, north, up): latitude and longitude, degrees; height above the ellipsoid, metres [default: the
    /// first position]
    #[arg(long, value_name = "LAT,LON,HEIGHT", allow_hyphen_values = true, requires = "out", value_parser = vector(Dimension::Ratio))]
    pub(crate) origin: Option<DVec3>,

    /// GPS week of an SBET file, which does not contain it
    #[arg(long, value_name = "WEEK")]
    pub(crate) week: Option<u32>,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// Kinds of records with a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RecordKind {
    /// Inertial solution
    Inspva,
    /// Inertial solution with standard deviations
    Inspvax,
    /// Best position of the receiver
    Bestpos,
    /// Position at an event mark
    Markpos,
    /// NMEA sentences of one epoch
    Nmea,
    /// Smoothed best estimate of trajectory
    Sbet,
    /// Row of comma-separated values
    Csv,
}

impl RecordKind {
    /// The same in the library.
    pub(crate) fn kind(self) -> Kind {
        match self {
            Self::Inspva => Kind::Inspva,
            Self::Inspvax => Kind::Inspvax,
            Self::Bestpos => Kind::Bestpos,
            Self::Markpos => Kind::Markpos,
            Self::Nmea => Kind::Nmea,
            Self::Sbet => Kind::Sbet,
            Self::Csv => Kind::Csv,
        }
    }
}
