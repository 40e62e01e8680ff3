//! Motion of a vehicle at one time, and stated deviations.

use glam::{DQuat, DVec3};

use subaperture_model::geometry::Geodetic;

use crate::{Attitude, GpsTime};

/// Standard deviations that a record states.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviations {
    /// Position along east and along north, metres.
    pub horizontal_m: f64,
    /// Height above the ellipsoid, metres.
    pub vertical_m: f64,
    /// Velocity along east, north and up, m/s.
    pub velocity_m_s: f64,
    /// Angles roll, pitch and azimuth, degrees.
    pub attitude_deg: f64,
}

impl Deviations {
    /// Whether positions are as accurate as with resolved carrier phases.
    pub(super) fn are_fixed(&self) -> bool {
        self.horizontal_m <= 0.1
    }
}

/// Motion of a vehicle at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleState {
    /// GPS time of the state.
    pub time: GpsTime,
    /// Position, with ellipsoidal height.
    pub place: Geodetic,
    /// Velocity along east, north and up, m/s.
    pub velocity_m_s: DVec3,
    /// Roll, pitch and azimuth, degrees.
    pub attitude_deg: [f64; 3],
    /// Standard deviations of the state.
    pub deviations: Deviations,
}

impl VehicleState {
    /// Speed over ground, m/s, and direction over ground clockwise from north, degrees from 0 to 360.
    pub(super) fn over_ground(&self) -> (f64, f64) {
        let [east, north, _] = self.velocity_m_s.to_array();
        let direction_deg = libm::atan2(east, north).to_degrees().rem_euclid(360.0);
        (libm::hypot(east, north), direction_deg)
    }
}

impl Attitude {
    /// Attitude of a rotation from body axes (x forward, y left, z up) to east, north and up; inverse of
    /// [`Self::to_east_north_up`].
    pub fn of_east_north_up(turn: DQuat) -> Self {
        let [forward, left, up] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| turn * axis);
        let level = libm::hypot(forward.x, forward.y);
        Self {
            roll_deg: Some(libm::atan2(left.z, up.z).to_degrees()),
            pitch_deg: Some(libm::atan2(forward.z, level).to_degrees()),
            azimuth_deg: libm::atan2(forward.x, forward.y)
                .to_degrees()
                .rem_euclid(360.0),
        }
    }
}
