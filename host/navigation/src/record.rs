//! One moment of a log: where, how fast, how turned, each as well as it is known.

use glam::{DMat3, DQuat, DVec3};

use subaperture_model::geometry::{Geodetic, SceneFrame};
use subaperture_model::track::{Fix, turned};

use crate::GpsTime;

/// What a record was made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// NovAtel `INSPVA`, `INSPVAS`: inertial solution.
    Inspva,
    /// NovAtel `INSPVAX`: inertial solution with standard deviations.
    Inspvax,
    /// NovAtel `BESTPOS`: best position of the receiver.
    Bestpos,
    /// NovAtel `BESTVEL`: best velocity of the receiver, at the moment of which it is.
    Bestvel,
    /// NovAtel `MARKPOS`: position at an event's mark.
    Markpos,
    /// NovAtel `MARKTIME`: time of an event's mark, and nothing else.
    Marktime,
    /// All NMEA sentences of one moment.
    Nmea,
    /// A record of a smoothed best estimate of trajectory.
    Sbet,
    /// A row of comma-separated values.
    Csv,
}

impl Kind {
    /// All there are.
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

    /// Its name.
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

/// Where something is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// On the Earth (WGS 84), with the height above the ellipsoid.
    Earth(Geodetic),
    /// In axes of the log's own, metres: x, y, z.
    Local(DVec3),
}

impl Place {
    /// In a scene's frame, metres; none where one is on the Earth and the other in axes of its own.
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

/// How a vehicle is turned against north, east and the vertical, degrees.
///
/// Turns are azimuth, then pitch, then roll. In axes of a log's own, x is taken for east and y for north.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attitude {
    /// Right-handed about forward: right side down positive. `None` where only the heading is known.
    pub roll_deg: Option<f64>,
    /// Right-handed about right: nose up positive.
    pub pitch_deg: Option<f64>,
    /// Clockwise from true north.
    pub azimuth_deg: f64,
}

impl Attitude {
    /// Turns body axes (x forward, y left, z up) into east, north and up; level where only the heading is known.
    pub fn to_east_north_up(&self) -> DQuat {
        let level = |angle_deg: Option<f64>| angle_deg.unwrap_or(0.0).to_radians();
        let yaw = (90.0 - self.azimuth_deg).to_radians();
        turned(level(self.roll_deg), -level(self.pitch_deg), yaw)
    }
}

/// One moment of a log.
///
/// Velocities and standard deviations are those along east, north and up, or x, y and z of a log's own axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Where it begins in the file, in bytes.
    pub byte: u64,
    /// What it was made of.
    pub kind: Kind,
    /// When.
    pub time: GpsTime,
    /// Where; none of an event's time or a heading alone.
    pub place: Option<Place>,
    /// Standard deviation of the place, metres.
    pub place_sigma_m: Option<DVec3>,
    /// Velocity, metres a second. NMEA has none upwards, which is 0 here.
    pub velocity_m_s: Option<DVec3>,
    /// Standard deviation of the velocity, metres a second.
    pub velocity_sigma_m_s: Option<DVec3>,
    /// Attitude.
    pub attitude: Option<Attitude>,
    /// Standard deviations of roll, pitch and azimuth, degrees.
    pub attitude_sigma_deg: Option<[f64; 3]>,
}

impl Record {
    /// One that says nothing but when.
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

    /// What turns its east, north and up into a scene's axes; none where one of them is on the Earth and the other is not.
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

    /// The record in a scene's frame, at a time counted from `start`; none without a place there.
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
    fn attitudes_point_where_the_compass_says() {
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
    fn a_fix_lies_in_the_scenes_frame() {
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
