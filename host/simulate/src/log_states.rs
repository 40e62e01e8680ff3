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
/// The same for acceleration errors in outages.
const DRIFT: u64 = u64::from_be_bytes(*b"navdrift");

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
        let mut drifts = ChaCha8Rng::seed_from_u64(self.seed);
        drifts.set_stream(DRIFT.wrapping_add(index as u64));
        let drifts: Vec<DVec3> = log
            .outages_s
            .iter()
            .map(|_| DVec3::from([(); 3].map(|()| normal(&mut drifts))))
            .collect();
        let arm_m = middle_m(&self.radar) + log.lever_arm_m;
        let states = log.times_s(&self.radar).filter_map(|nominal_s| {
            let time = log.start.later(nominal_s);
            let time_s = time.since(log.start);
            // Errors are drawn in outages too, so that those of other records do not depend on them.
            let errors: [f64; 9] = std::array::from_fn(|_| normal(&mut random));
            let lost = |&(from_s, to_s): &(f64, f64)| (from_s..=to_s).contains(&time_s);
            let outage = log.outages_s.iter().position(lost);
            let drift = match (outage, log.drift_m_s2) {
                (None, _) => Drift::default(),
                (Some(_), None) => return None,
                (Some(n), Some(sigma_m_s2)) => Drift {
                    sigma_m_s2,
                    units: drifts[n],
                    age_s: time_s - log.outages_s[n].0,
                },
            };
            self.state(log, time, arm_m, &errors, &drift)
        });
        log.format.write(out, remark, log.undulation_m, states)
    }

    /// State of the navigation antenna at a time, with errors in units of the standard deviations.
    fn state(
        &self,
        log: &NavigationLog,
        time: GpsTime,
        arm_m: DVec3,
        errors: &[f64; 9],
        drift: &Drift,
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
        let along = |v: DVec3| east * v.x + north * v.y + up * v.z;
        let error_m = along(DVec3::new(
            e * horizontal_m,
            n * horizontal_m,
            u * vertical_m,
        )) + along(drift.units) * drift.position_m();
        let pitch_deg = attitude.pitch_deg? + attitude_deg * pitch;
        Some(VehicleState {
            time,
            place: Geodetic::from_ecf_m(place_ecf_m + error_m),
            velocity_m_s: east_north_up(moved_m / (2.0 * HALF_STEP_S))
                + DVec3::from(v) * velocity_m_s
                + drift.units * drift.velocity_m_s(),
            attitude_deg: [
                turned_deg(attitude.roll_deg? + attitude_deg * roll),
                pitch_deg.clamp(-90.0, 90.0),
                (attitude.azimuth_deg + attitude_deg * azimuth).rem_euclid(360.0),
            ],
            deviations: Deviations {
                horizontal_m: libm::hypot(horizontal_m, drift.position_m()),
                vertical_m: libm::hypot(vertical_m, drift.position_m()),
                velocity_m_s: libm::hypot(velocity_m_s, drift.velocity_m_s()),
                attitude_deg,
            },
        })
    }
}

/// Drift of the inertial solution since the start of an outage.
#[derive(Default)]
struct Drift {
    /// Standard deviation of the acceleration error, m/s^2.
    sigma_m_s2: f64,
    /// Acceleration error along east, north and up in standard deviations.
    units: DVec3,
    /// Time since the start of the outage, seconds.
    age_s: f64,
}

impl Drift {
    /// Standard deviation of its position error, metres.
    fn position_m(&self) -> f64 {
        0.5 * self.sigma_m_s2 * self.age_s * self.age_s
    }

    /// Standard deviation of its velocity error, m/s.
    fn velocity_m_s(&self) -> f64 {
        self.sigma_m_s2 * self.age_s
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
