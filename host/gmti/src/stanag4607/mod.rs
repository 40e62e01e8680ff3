//! Write GMTI detections as STANAG 4607 packets (NATO Ground Moving Target Indicator Format, GMTIF).
//!
//! [`encode`] returns one packet of version `30`, STANAG 4607 edition 3: packet header, Mission Segment, Job Definition Segment, and a Dwell
//! Segment with target reports for each [`Dwell`]. A file is a sequence of packets. Field numbers are those of the tables of AEDP-4607 edition A
//! version 1 (version `41`); the fields written here have the same numbers, types and units in both editions. Version `30` is accepted by more
//! readers: Wireshark accepts `21` and `30` only. AEDP-7 is the implementation guide.
//!
//! # Units, signs and rounding
//! - **Input**: SI units, degrees, and nanoseconds since 1970 (UTC).
//! - **Velocity** of a target along the line of sight (D32.7): positive **away from the sensor**, corrected for the motion of the sensor.
//!   [`Target::radial_velocity_m_s`](crate::Target::radial_velocity_m_s) is positive when approaching: change its sign.
//! - **Wrap velocity** (D32.8): half of the interval of ambiguity.
//! - **Vertical velocity** of the sensor (D17): positive upwards. The standard does not state its sign.
//! - **Longitudes and the sensor track**: -180 to 360 degrees, written as 0 to 360. A latitude of exactly 90 degrees cannot be written.
//! - **Rounding**: to the nearest count. Standard deviations and the minimum detectable velocity are rounded up: only 0 is written as 0.
//! - **Ranges**: a value outside the range of its field is an error, never wrapped or clamped. NaN is outside of every range.
//!
//! | field | resolution |
//! |---|---|
//! | latitude (SA32), longitude (BA32) | `4.2e-8`, `8.4e-8` degrees |
//! | D6 dwell time | 1 ms |
//! | D9 sensor altitude | 1 cm |
//! | D15 sensor track, D27 angle half extent (BA16) | `0.0055` degrees |
//! | D16, D17 sensor speed, vertical velocity | 1 mm/s, 1 dm/s |
//! | D26 range half extent (B16, km) | 7.8125 m |
//! | D32.6 height | 1 m |
//! | D32.7, D32.8, D32.15 velocity, wrap velocity, uncertainty | 1 cm/s |
//! | D32.9 SNR | 1 dB |
//! | D32.12, D32.13, D32.14 slant range, cross range, height uncertainty | 1 cm, 1 dm, 1 m |
//!
//! # Mandatory fields
//!
//! | field | value |
//! |---|---|
//! | P1 version | `30` |
//! | P4, P5, P6 security | 5 (UNCLASSIFIED), spaces (no system), 0 (no code) |
//! | P7 exercise indicator | given: [`Exercise`] |
//! | P9 mission ID | default 0 |
//! | P10 job ID | [`Job::id`], or 0 in a packet without dwells |
//! | M1, M2, M4 plans, configuration | default spaces |
//! | M3 platform type | default 255 (other) |
//! | M5 to M7 date | UTC day of [`Mission::start_utc_ns`] |
//! | J2, J3 sensor | default 255 (no statement), spaces |
//! | J4 target filtering | default 0 (no filtering) |
//! | J5 priority | default 99 (lowest) |
//! | J14 radar mode | default 1 (MTI) |
//! | J15 revisit interval | default 0 (no revisit) |
//! | J16 to J26 nominal values | default "no statement" |
//! | J27, J28 terrain, geoid | default 0 (not specified) |
//! | D1 existence mask | D2 to D9, D24 to D27, and the given fields |
//!
//! # Not written
//! - Segments: HRR, Free Text, Test and Status, Processing History, Platform Location, Job Request, Job Acknowledge.
//! - Dwell: D10, D11 (scale factors, because target positions have high resolution), D18 to D20 (uncertainty of the sensor velocity), D21 to D23 and
//!   D28 to D30 (orientation), D31 (minimum detectable velocity; J24 contains the nominal one).
//! - Target: D32.4, D32.5 (delta positions), D32.16, D32.17 (truth tag), D32.18 (radar cross section).
//!
//! # Example
//! ```
//! use subaperture_gmti::stanag4607::{Dwell, Exercise, Job, LineOfSightVelocity, Mission, TargetReport, encode};
//! use subaperture_model::geometry::Geodetic;
//!
//! let noon_ns = 1_709_294_400_000_000_000;
//! let mission = Mission::new("XN", "UAV 7", Exercise::OperationSimulated, noon_ns);
//! let job = Job::new(1, [[48.1, 11.4], [48.1, 11.6], [48.0, 11.6], [48.0, 11.4]]);
//! let mut target = TargetReport::new(48.05, 11.5);
//! target.velocity = Some(LineOfSightVelocity { away_m_s: -7.5, wrap_m_s: 15.0, deviation_m_s: None });
//! let dwell = Dwell {
//!     revisit_index: 0,
//!     dwell_index: 0,
//!     is_last: true,
//!     centre_utc_ns: noon_ns + 2_500_000_000,
//!     sensor: Geodetic { latitude_deg: 47.9, longitude_deg: 11.5, height_m: 3000.0 },
//!     sensor_deviation: None,
//!     sensor_velocity: None,
//!     area_centre_deg: [48.05, 11.5],
//!     range_half_extent_m: 5000.0,
//!     angle_half_extent_deg: 20.0,
//!     targets: vec![target],
//! };
//! let packet = encode(&mission, &job, &[dwell])?;
//! assert_eq!(packet.len(), 32 + (5 + 39) + (5 + 68) + (5 + 43 + 12));
//! # Ok::<(), subaperture_gmti::stanag4607::StanagError>(())
//! ```

mod dwell;
mod encoded;
mod error;
mod field;
mod from_targets;
mod job;
mod mission;
mod report;
#[cfg(test)]
mod tests;

pub use dwell::{Dwell, SensorDeviation, SensorVelocity};
pub use error::StanagError;
pub use job::Job;
pub use mission::{Exercise, Mission};
pub use report::{Classification, LineOfSightVelocity, TargetClass, TargetReport};

/// Bytes of the packet header.
const HEADER: u64 = 32;

/// Encode one packet: mission, job, and any number of dwells of that job.
///
/// # Errors
/// [`StanagError`] if a value is outside the range of its field, a field lacks another one that the standard requires, the targets of a dwell
/// have different fields, or the packet exceeds 4294967295 bytes.
pub fn encode(mission: &Mission, job: &Job, dwells: &[Dwell]) -> Result<Vec<u8>, StanagError> {
    let mut segments = Vec::new();
    append(&mut segments, 1, &mission.segment()?)?;
    append(&mut segments, 5, &job.segment()?)?;
    let day = mission.start_utc_ns.div_euclid(mission::DAY_NS);
    for (index, dwell) in dwells.iter().enumerate() {
        let body = dwell.segment(day).map_err(|e| e.at("dwell", index))?;
        append(&mut segments, 2, &body)?;
    }
    // The job ID belongs to the dwells of a packet.
    let job_id = if dwells.is_empty() { 0 } else { job.id };
    let mut packet = mission.header(packet_size(segments.len(), 0)?, job_id)?;
    packet.append(&mut segments);
    Ok(packet)
}

/// Append a segment: type (S1), size with this header (S2), body.
fn append(segments: &mut Vec<u8>, kind: u8, body: &[u8]) -> Result<(), StanagError> {
    let size = body.len() + 5;
    packet_size(segments.len(), size)?;
    segments.push(kind);
    segments.extend((size as u32).to_be_bytes());
    segments.extend(body);
    Ok(())
}

/// Size of a packet (P2) with `written` and `added` bytes of segments.
fn packet_size(written: usize, added: usize) -> Result<u32, StanagError> {
    let found = HEADER + written as u64 + added as u64;
    u32::try_from(found).map_err(|_| StanagError::Size { found })
}
