//! Record of a log: position, velocity and attitude at one time, with standard deviations.

use glam::{DMat3, DQuat, DVec3};

use subaperture_model::geometry::{Geodetic, SceneFrame};
use subaperture_model::track::{Fix, turned};

use crate::GpsTime;

/// Message from which a record was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// NovAtel `INSPVA`, `INSPVAS`: inertial solution.
    Inspva,
    /// NovAtel `INSPVAX`: inertial solution with standard deviations.
    Inspvax,
    /// NovAtel `BESTPOS`: best position of the receiver.
    Bestpos,
    /// NovAtel `BESTVEL`: best velocity of the receiver, at its time minus its latency.
    Bestvel,
    /// NovAtel `MARKPOS`: position at an event mark.
    Markpos,
    /// NovAtel `MARKTIME`: time of an event mark only.
    Marktime,
    /// NMEA sentences of one time together.
    Nmea,
    /// Record of an SBET.
    Sbet,
    /// Row of comma-separated values.
    Csv,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 9] = [
        Self::Inspva,
        Self::Inspvax,
        Self::Bestpos,
        Self::Bestvel,
        Self::Markpos,
        Self::Marktime,
        Self::Nmea,
        Self::Sbet,
        Self::Csv,
    ];

    /// Name of the kind.
    pub fn name(self) -> &'static str {
        match self {
            Self::Inspva => "INSPVA",
            Self::Inspvax => "INSPVAX",
            Self::Bestpos => "BESTPOS",
            Self::Bestvel => "BESTVEL",
            Self::Markpos => "MARKPOS",
            Self::Marktime => "MARKTIME",
            Self::Nmea => "NMEA",
            Self::Sbet => "SBET",
            Self::Csv => "CSV",
        }
    }
}

/// Position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// On the Earth (WGS 84), with ellipsoidal height.
    Earth(Geodetic),
    /// In local axes of the log, metres: x, y, z.
    Local(DVec3),
}

impl Place {
    /// Position in a scene's frame, metres; `None` if only one of both is on the Earth.
    pub fn in_frame(&self, frame: &SceneFrame) -> Option<DVec3> {
        match (self, frame) {
            (Self::Earth(place), SceneFrame::Earth { .. }) => {
                Some(frame.from_ecf_m(place.to_ecf_m()))
            }
            (Self::Local(place_m), SceneFrame::Local) => Some(*place_m),
            _ => None,
        }
    }
}

/// Attitude of a vehicle against north, east and the vertical, degrees.
///
/// The rotations are azimuth, then pitch, then roll. In local axes, x stands for east and y for north.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attitude {
    /// Roll, right-handed about forward: right side down positive. `None` if only the heading is known.
    pub roll_deg: Option<f64>,
    /// Pitch, right-handed about right: nose up positive.
    pub pitch_deg: Option<f64>,
    /// Azimuth, clockwise from true north.
    pub azimuth_deg: f64,
}

impl Attitude {
    /// Rotation from body axes (x forward, y left, z up) to east, north and up; level if only the heading is known.
    pub fn to_east_north_up(&self) -> DQuat {
        let level = |angle_deg: Option<f64>| angle_deg.unwrap_or(0.0).to_radians();
        let yaw = (90.0 - self.azimuth_deg).to_radians();
        turned(level(self.roll_deg), -level(self.pitch_deg), yaw)
    }
}

/// Record of a log at one time.
///
/// Velocities and standard deviations are along east, north and up, or along x, y and z of local axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Offset of the message in the file, bytes.
    pub byte: u64,
    /// Message from which the record was made.
    pub kind: Kind,
    /// Time of the record.
    pub time: GpsTime,
    /// Position; `None` for an event's time or a heading alone.
    pub place: Option<Place>,
    /// Standard deviation of the position, metres.
    pub place_sigma_m: Option<DVec3>,
    /// Velocity, m/s. NMEA has no vertical velocity: it is 0.
    pub velocity_m_s: Option<DVec3>,
    /// Standard deviation of the velocity, m/s.
    pub velocity_sigma_m_s: Option<DVec3>,
    /// Attitude of the vehicle, if recorded.
    pub attitude: Option<Attitude>,
    /// Standard deviations of roll, pitch and azimuth, degrees.
    pub attitude_sigma_deg: Option<[f64; 3]>,
}

impl Record {
    /// Record with a time only.
    pub(crate) fn at(byte: u64, kind: Kind, time: GpsTime) -> Self {
        Self {
            byte,
            kind,
            time,
            place: None,
            place_sigma_m: None,
            velocity_m_s: None,
            velocity_sigma_m_s: None,
            attitude: None,
            attitude_sigma_deg: None,
        }
    }

    /// Rotation from east, north and up to a scene's axes; `None` if only one of both is on the Earth.
    pub fn to_scene(&self, frame: &SceneFrame) -> Option<DQuat> {
        match (self.place?, frame) {
            (Place::Earth(place), SceneFrame::Earth { .. }) => {
                let axes = place
                    .east_north_up()
                    .map(|axis| frame.direction_from_ecf(axis));
                let turn = DMat3::from_cols(axes[0], axes[1], axes[2]);
                Some(DQuat::from_mat3(&turn).normalize())
            }
            (Place::Local(_), SceneFrame::Local) => Some(DQuat::IDENTITY),
            _ => None,
        }
    }

    /// Fix of a track in a scene's frame, with time counted from `start`; `None` without a position there.
    pub fn fix(&self, frame: &SceneFrame, start: GpsTime) -> Option<Fix> {
        let to_scene = self.to_scene(frame)?;
        Some(Fix {
            time_s: self.time.since(start),
            position_m: self.place?.in_frame(frame)?,
            attitude: self
                .attitude
                .map(|a| (to_scene * a.to_east_north_up()).normalize()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attitude_converts_azimuth_pitch_and_roll() {
        let body = |roll_deg, pitch_deg, azimuth_deg| {
            Attitude {
                roll_deg: Some(roll_deg),
                pitch_deg: Some(pitch_deg),
                azimuth_deg,
            }
            .to_east_north_up()
        };
        // East, north, up.
        assert!((body(0.0, 0.0, 0.0) * DVec3::X).distance(DVec3::Y) < 1e-15);
        assert!((body(0.0, 0.0, 90.0) * DVec3::X).distance(DVec3::X) < 1e-15);
        assert!(((body(0.0, 30.0, 200.0) * DVec3::X).z - 0.5).abs() < 1e-15);
        // Rolled by 30 degrees to the right: the left side is up.
        assert!(((body(30.0, 0.0, 45.0) * DVec3::Y).z - 0.5).abs() < 1e-15);
    }

    #[test]
    fn fix_is_converted_to_scene_frame() {
        // On the equator at 90 deg east, axes turned: x north, y west.
        let origin = Geodetic {
            latitude_deg: 0.0,
            longitude_deg: 90.0,
            height_m: 10.0,
        };
        let frame = SceneFrame::Earth {
            origin_ecf_m: origin.to_ecf_m(),
            x_axis_ecf: DVec3::Z,
            y_axis_ecf: DVec3::X,
        };
        let at = |week, seconds| GpsTime { week, seconds };
        let record = Record {
            place: Some(Place::Earth(Geodetic {
                height_m: 35.0,
                ..origin
            })),
            attitude: Some(Attitude {
                roll_deg: None,
                pitch_deg: None,
                azimuth_deg: 270.0,
            }),
            ..Record::at(0, Kind::Inspva, at(101, 1.0))
        };
        let fix = record.fix(&frame, at(100, 604_799.5)).unwrap();
        assert_eq!(fix.time_s, 1.5);
        assert!(fix.position_m.distance(DVec3::new(0.0, 0.0, 25.0)) < 1e-8);
        // It heads west, which is y.
        assert!((fix.attitude.unwrap() * DVec3::X).distance(DVec3::Y) < 1e-9);
        assert!((fix.attitude.unwrap() * DVec3::Z).distance(DVec3::Z) < 1e-9);
        assert_eq!(record.fix(&SceneFrame::Local, at(100, 0.0)), None);
        let mark = Record::at(0, Kind::Marktime, at(101, 1.0));
        assert_eq!(mark.fix(&frame, at(100, 0.0)), None);
    }
}
