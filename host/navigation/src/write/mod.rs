//! Writers of logs: NMEA 0183, NovAtel ASCII and SBET, from the motion of a vehicle.

mod nmea;
mod novatel;
mod sbet;
mod state;

use std::io::{self, Write};

pub use state::{Deviations, VehicleState};

/// Formats of written logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogFormat {
    /// NMEA 0183: `GGA`, `RMC`, `GST` and `HDT` for each record. Positions are rounded to 0.1 mm, headings to 0.0001 degrees.
    Nmea,
    /// NovAtel ASCII `INSPVAX`: position, velocity and attitude with their standard deviations.
    Inspvax,
    /// NovAtel ASCII `BESTPOS` and `BESTVEL`: position with its standard deviations, and velocity.
    Bestpos,
    /// SBET: position, velocity and attitude in float64, without deviations and without the GPS week. Acceleration and rates of the body
    /// are written as 0.
    Sbet,
}

impl LogFormat {
    /// Largest size of a record, bytes.
    pub fn max_record_bytes(self) -> u64 {
        match self {
            Self::Nmea => 400,
            Self::Inspvax => 450,
            Self::Bestpos => 600,
            Self::Sbet => 136,
        }
    }

    /// Write a log of states that ascend in time; their times are rounded to milliseconds in text formats.
    ///
    /// `remark`, without commas, asterisks and control characters, becomes the proprietary sentence `PSBAP` on the first line; an SBET has
    /// no place for it. Each state is written with its own standard deviations. `undulation_m` is the stated height of the geoid above the ellipsoid, metres; heights above mean sea level are
    /// ellipsoidal heights minus it.
    ///
    /// # Errors
    /// Those of the stream.
    pub fn write(
        self,
        out: &mut dyn Write,
        remark: &str,
        undulation_m: f64,
        states: impl Iterator<Item = VehicleState>,
    ) -> io::Result<()> {
        if self != Self::Sbet {
            nmea::sentence(out, &format!("PSBAP,{remark}"))?;
        }
        for state in states {
            match self {
                Self::Nmea => nmea::record(out, &state, undulation_m)?,
                Self::Inspvax => novatel::inspvax(out, &state, undulation_m)?,
                Self::Bestpos => novatel::bestpos(out, &state, undulation_m)?,
                Self::Sbet => sbet::record(out, &state)?,
            }
        }
        Ok(())
    }
}
