//! Writer of NovAtel ASCII records.

use std::io::{self, Write};

use subaperture_model::geometry::Geodetic;

use super::state::{Deviations, VehicleState};
use crate::GpsTime;
use crate::messages::crc;

/// Write a record with its header and CRC.
fn record(out: &mut dyn Write, name: &str, time: GpsTime, body: &str) -> io::Result<()> {
    let GpsTime { week, seconds } = time;
    let text =
        format!("{name},COM1,0,50.0,FINESTEERING,{week},{seconds:.3},02000000,0000,16809;{body}");
    write!(out, "#{text}*{:08x}\r\n", crc(text.as_bytes()))
}

/// Latitude, longitude, height above mean sea level and undulation.
fn place(place: &Geodetic, undulation_m: f64) -> String {
    format!(
        "{:.11},{:.11},{:.4},{undulation_m:.4}",
        place.latitude_deg,
        place.longitude_deg,
        place.height_m - undulation_m
    )
}

/// Standard deviations of latitude, longitude and height.
fn place_deviations(deviations: &Deviations) -> String {
    let [level, height] = [deviations.horizontal_m, deviations.vertical_m];
    format!("{level:.4},{level:.4},{height:.4}")
}

/// Write a record `INSPVAX` with its standard deviations.
pub(super) fn inspvax(
    out: &mut dyn Write,
    state: &VehicleState,
    undulation_m: f64,
) -> io::Result<()> {
    let deviations = &state.deviations;
    let kind = match deviations.are_fixed() {
        true => "INS_RTKFIXED",
        false => "INS_PSRSP",
    };
    let [east, north, up] = state.velocity_m_s.to_array();
    let [roll, pitch, azimuth] = state.attitude_deg;
    let (velocity, attitude) = (deviations.velocity_m_s, deviations.attitude_deg);
    let body = format!(
        "INS_SOLUTION_GOOD,{kind},{},{north:.5},{east:.5},{up:.5},{roll:.9},{pitch:.9},{azimuth:.9},{},\
         {velocity:.4},{velocity:.4},{velocity:.4},{attitude:.4},{attitude:.4},{attitude:.4},00000003,0",
        place(&state.place, undulation_m),
        place_deviations(deviations)
    );
    record(out, "INSPVAXA", state.time, &body)
}

/// Write the records `BESTPOS` and `BESTVEL` of a state.
pub(super) fn bestpos(
    out: &mut dyn Write,
    state: &VehicleState,
    undulation_m: f64,
) -> io::Result<()> {
    let deviations = &state.deviations;
    let kind = match deviations.are_fixed() {
        true => "NARROW_INT",
        false => "SINGLE",
    };
    let body = format!(
        "SOL_COMPUTED,{kind},{},WGS84,{},\"\",0.000,0.000,12,12,12,12,00,00,00,33",
        place(&state.place, undulation_m),
        place_deviations(deviations)
    );
    record(out, "BESTPOSA", state.time, &body)?;
    let (speed, direction_deg) = state.over_ground();
    let up = state.velocity_m_s.z;
    let body = format!("SOL_COMPUTED,{kind},0.000,0.000,{speed:.5},{direction_deg:.6},{up:.5},0.0");
    record(out, "BESTVELA", state.time, &body)
}
