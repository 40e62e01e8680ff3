//! Writer of NMEA 0183 sentences.

use std::io::{self, Write};

use super::state::VehicleState;

/// Speed of one metre per second, knots.
const KNOTS: f64 = 3600.0 / 1852.0;

/// Write a sentence with its checksum; `text` is that between `$` and `*`.
pub(super) fn sentence(out: &mut dyn Write, text: &str) -> io::Result<()> {
    let sum = text.bytes().fold(0, |sum, byte| sum ^ byte);
    write!(out, "${text}*{sum:02X}\r\n")
}

/// Write the sentences `GGA`, `RMC`, `GST` and `HDT` of a state.
pub(super) fn record(
    out: &mut dyn Write,
    state: &VehicleState,
    undulation_m: f64,
) -> io::Result<()> {
    let deviations = &state.deviations;
    let ([year, month, day], ms) = state.time.utc_date_ms();
    let time = format!(
        "{:02}{:02}{:02}.{:03}",
        ms / 3_600_000,
        ms / 60_000 % 60,
        ms / 1000 % 60,
        ms % 1000
    );
    let place = format!(
        "{},{}",
        degrees(state.place.latitude_deg, 2, ["N", "S"]),
        degrees(state.place.longitude_deg, 3, ["E", "W"])
    );
    let quality = if deviations.are_fixed() { 4 } else { 1 };
    let above_sea_m = state.place.height_m - undulation_m;
    sentence(
        out,
        &format!("GPGGA,{time},{place},{quality},12,0.7,{above_sea_m:.4},M,{undulation_m:.4},M,,"),
    )?;
    let (speed, direction_deg) = state.over_ground();
    sentence(
        out,
        &format!(
            "GPRMC,{time},A,{place},{:.4},{direction_deg:.4},{day:02}{month:02}{:02},,,A",
            speed * KNOTS,
            year.rem_euclid(100)
        ),
    )?;
    let [level, height] = [deviations.horizontal_m, deviations.vertical_m];
    sentence(
        out,
        &format!("GPGST,{time},{level:.4},,,,{level:.4},{level:.4},{height:.4}"),
    )?;
    let [_, _, azimuth] = state.attitude_deg;
    sentence(out, &format!("GPHDT,{:.4},T", azimuth.rem_euclid(360.0)))
}

/// Degrees and minutes with a letter; `width` is the number of digits of the degrees.
fn degrees(angle: f64, width: usize, letters: [&str; 2]) -> String {
    // Minutes in steps of 1e-7, 0.19 mm on the ground.
    let steps = (angle.abs() * 60e7).round() as i64;
    let (whole, steps) = (steps / 600_000_000, steps % 600_000_000);
    let letter = letters[usize::from(angle < 0.0)];
    format!(
        "{whole:0width$}{:02}.{:07},{letter}",
        steps / 10_000_000,
        steps % 10_000_000
    )
}
