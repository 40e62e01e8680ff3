//! States of the vehicle that an experiment's navigation logs record.

use std::io::{self, Write};

use glam::{DMat3, DQuat, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::experiment::Experiment;
use super::navigation_log::NavigationLog;
use super::random::normal;
use subaperture_model::geometry::Geodetic;
use subaperture_model::radar::{Antenna, Radar};
use subaperture_navigation::write::{Deviations, VehicleState};
use subaperture_navigation::{Attitude, GpsTime};

/// Random stream of the first log; each log uses one stream from here on.
const LOG: u64 = u64::from_be_bytes(*b"navlog\0\0");

/// Half of the interval of the difference for velocities, seconds.
const HALF_STEP_S: f64 = 0.5e-3;

impl Experiment {
    /// Write the log with this index in [`Self::logs`]. `remark` is its first line ([`subaperture_navigation::write::LogFormat::write`]).
    ///
    /// # Errors
    /// Those of the stream; [`io::ErrorKind::InvalidInput`] if the log does not exist or the scene has no place on the Earth.
    pub fn write_log(&self, index: usize, remark: &str, out: &mut dyn Write) -> io::Result<()> {
        let invalid = |text: &str| io::Error::new(io::ErrorKind::InvalidInput, text.to_owned());
        let log = self.logs.get(index);
        let log = log.ok_or_else(|| invalid("the experiment has no such navigation log"))?;
        if self.frame.geodetic(DVec3::ZERO).is_none() {
            return Err(invalid(
                "a navigation log needs the place of the scene on the Earth",
            ));
        }
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(LOG.wrapping_add(index as u64));
        let arm_m = middle_m(&self.radar) + log.lever_arm_m;
        let states = log.times_s(&self.radar).filter_map(|nominal_s| {
            let time = log.start.later(nominal_s);
            let time_s = time.since(log.start);
            // Errors are drawn in outages too, so that those of other records do not depend on them.
            let errors: [f64; 9] = std::array::from_fn(|_| normal(&mut random));
            let lost = |&(from_s, to_s): &(f64, f64)| (from_s..=to_s).contains(&time_s);
            match log.outages_s.iter().any(lost) {
                true => None,
                false => self.state(log, time, arm_m, &errors),
            }
        });
        log.format
            .write(out, remark, &log.deviations, log.undulation_m, states)
    }

    /// State of the navigation antenna at a time, with errors in units of the standard deviations.
    fn state(
        &self,
        log: &NavigationLog,
        time: GpsTime,
        arm_m: DVec3,
        errors: &[f64; 9],
    ) -> Option<VehicleState> {
        let time_s = time.since(log.start);
        let antenna_m = |time_s: f64| self.track.pose(time_s).point_m(arm_m);
        let moved_m = antenna_m(time_s + HALF_STEP_S) - antenna_m(time_s - HALF_STEP_S);
        let place_ecf_m = self.frame.to_ecf_m(antenna_m(time_s));
        let axes = Geodetic::from_ecf_m(place_ecf_m).east_north_up();
        let east_north_up = |direction: DVec3| {
            let direction = self.frame.direction_to_ecf(direction);
            DVec3::from(axes.map(|axis| axis.dot(direction)))
        };
        let body = self.track.pose(time_s).attitude;
        let columns = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| east_north_up(body * axis));
        let turn = DQuat::from_mat3(&DMat3::from_cols(columns[0], columns[1], columns[2]));
        let attitude = Attitude::of_east_north_up(turn.normalize());
        let Deviations {
            horizontal_m,
            vertical_m,
            velocity_m_s,
            attitude_deg,
        } = log.deviations;
        let [e, n, u, v @ .., roll, pitch, azimuth] = *errors;
        let [east, north, up] = axes;
        let error_m = (east * e + north * n) * horizontal_m + up * (u * vertical_m);
        let pitch_deg = attitude.pitch_deg? + attitude_deg * pitch;
        Some(VehicleState {
            time,
            place: Geodetic::from_ecf_m(place_ecf_m + error_m),
            velocity_m_s: east_north_up(moved_m / (2.0 * HALF_STEP_S))
                + DVec3::from(v) * velocity_m_s,
            attitude_deg: [
                turned_deg(attitude.roll_deg? + attitude_deg * roll),
                pitch_deg.clamp(-90.0, 90.0),
                (attitude.azimuth_deg + attitude_deg * azimuth).rem_euclid(360.0),
            ],
        })
    }
}

/// Angle from -180 to 180 degrees.
fn turned_deg(angle_deg: f64) -> f64 {
    (angle_deg + 180.0).rem_euclid(360.0) - 180.0
}

/// Middle of transmitters and receivers in body axes, metres.
fn middle_m(radar: &Radar) -> DVec3 {
    let mean_m = |antennas: &[Antenna]| {
        let sum: DVec3 = antennas.iter().map(|antenna| antenna.offset_m).sum();
        sum / antennas.len().max(1) as f64
    };
    0.5 * (mean_m(&radar.transmitters) + mean_m(&radar.receivers))
}
