//! Navigation logs of the true track.
//!
//! A log has records at multiples of its interval, from one second before the first pulse to one second after the last, without those in
//! outages. A record is the true position, velocity and attitude at its time, which is rounded to milliseconds, plus independent Gaussian
//! errors of the stated standard deviations. The position is that of the navigation antenna, at the lever arm from the middle of
//! transmitters and receivers. The velocity is its central difference over 1 ms.
//!
//! **Inertial sensors in outages.** With [`NavigationLog::drift_m_s2`] `b` the log continues through outages. At the time `t` after the start of
//! an outage the error also has the part of a constant acceleration error `a`, Gaussian of standard deviation `b` along each axis and independent
//! in each outage:
//!
//! ```text
//! position  a t^2 / 2      velocity  a t
//! ```
//!
//! The stated deviations are those of the sum: `sqrt(sigma^2 + (b t^2 / 2)^2)` of positions and `sqrt(sigma^2 + (b t)^2)` of velocities.

use glam::DVec3;

use subaperture_model::radar::Radar;
use subaperture_navigation::GpsTime;
use subaperture_navigation::write::{Deviations, LogFormat};

/// Time before the first pulse and after the last, seconds.
const MARGIN_S: f64 = 1.0;

/// Navigation log of the true track.
#[derive(Clone, Debug, PartialEq)]
pub struct NavigationLog {
    /// File name, without folders.
    pub file: String,
    /// Format of the file.
    pub format: LogFormat,
    /// GPS time of time 0 of the collection.
    pub start: GpsTime,
    /// Records per second; at most 1000, since times are whole milliseconds.
    pub rate_hz: f64,
    /// Standard deviations of the errors, which are those stated by the log.
    pub deviations: Deviations,
    /// Lever arm from the middle of transmitters and receivers to the navigation antenna in body axes (x forward, y left, z up), metres.
    pub lever_arm_m: DVec3,
    /// Stated height of the geoid above the ellipsoid, metres.
    pub undulation_m: f64,
    /// Starts and ends of outages, seconds from time 0 of the collection.
    pub outages_s: Vec<(f64, f64)>,
    /// Standard deviation of each component of the acceleration error in outages, m/s^2; `None` for a log without records there.
    pub drift_m_s2: Option<f64>,
}

impl NavigationLog {
    /// Nominal times of all records, those in outages too, seconds from time 0 of the collection.
    pub fn times_s(&self, radar: &Radar) -> impl ExactSizeIterator<Item = f64> {
        let last_s = radar.start_s + (radar.num_pulses as f64 - 1.0) * radar.pri_s;
        let first = ((radar.start_s - MARGIN_S) * self.rate_hz).floor();
        let end = ((last_s + MARGIN_S) * self.rate_hz).ceil();
        let rate_hz = self.rate_hz;
        let count = (end - first).clamp(0.0, f64::from(u32::MAX)) as u32 as usize + 1;
        (0..count).map(move |n| (first + n as f64) / rate_hz)
    }

    /// Largest size of the file, bytes.
    pub fn max_bytes(&self, radar: &Radar) -> u64 {
        (self.times_s(radar).len() as u64 + 1) * self.format.max_record_bytes()
    }
}
