//! From a log to a track in a scene's frame.

use glam::{DMat3, DQuat, DVec3};

use super::{GpsTime, Log, Record, Source};
use subaperture_model::geometry::SceneFrame;
use subaperture_model::track::{Fix, TrackError, turned};

/// How a vehicle is turned against north, east and the vertical, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attitude {
    /// Right-handed about forward: right side down positive.
    pub roll_deg: f64,
    /// Right-handed about right: nose up positive.
    pub pitch_deg: f64,
    /// Clockwise from true north.
    pub azimuth_deg: f64,
}

impl Attitude {
    /// Turns body axes (x forward, y left, z up) into east, north and up.
    pub fn to_east_north_up(&self) -> DQuat {
        let yaw = (90.0 - self.azimuth_deg).to_radians();
        turned(
            self.roll_deg.to_radians(),
            -self.pitch_deg.to_radians(),
            yaw,
        )
    }
}

impl Record {
    /// The record in a scene's frame, at a time counted from `start`.
    fn fix(&self, frame: &SceneFrame, start: GpsTime) -> Fix {
        // The frame's own directions: a scene direction is a difference of two positions.
        let origin = frame.from_ecf_m(DVec3::ZERO);
        let axes = self
            .place
            .east_north_up()
            .map(|v| frame.from_ecf_m(v) - origin);
        let to_scene = DQuat::from_mat3(&DMat3::from_cols(axes[0], axes[1], axes[2]));
        Fix {
            time_s: self.time.since(start),
            position_m: frame.from_ecf_m(self.place.to_ecf_m()),
            attitude: self
                .attitude
                .map(|a| (to_scene * a.to_east_north_up()).normalize()),
        }
    }
}

impl Log {
    /// The records of one kind as fixes in an Earth-bound frame, times counted from `start`.
    ///
    /// # Errors
    /// [`TrackError`] if there is no record of this kind, or the frame is a local one.
    pub fn fixes(
        &self,
        source: Source,
        frame: &SceneFrame,
        start: GpsTime,
    ) -> Result<Vec<Fix>, TrackError> {
        if *frame == SceneFrame::Local {
            return Err(TrackError(
                "a NovAtel log has places on the Earth, but the scene's frame is a local one; give the \
                 scene's origin by latitude, longitude and height"
                    .to_owned(),
            ));
        }
        let of_kind = self.records.iter().filter(|r| r.source == source);
        let fixes: Vec<Fix> = of_kind.map(|r| r.fix(frame, start)).collect();
        if fixes.is_empty() {
            return Err(TrackError(format!(
                "the NovAtel log has no {source:?} record with a solution among {}",
                self.records.len()
            )));
        }
        Ok(fixes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::geometry::Geodetic;

    #[test]
    fn attitudes_point_where_the_compass_says() {
        let body = |roll_deg, pitch_deg, azimuth_deg| {
            Attitude {
                roll_deg,
                pitch_deg,
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
        let start = GpsTime {
            week: 100,
            seconds: 604_799.5,
        };
        let record = Record {
            line: 1,
            source: Source::Inspva,
            time: GpsTime {
                week: 101,
                seconds: 1.0,
            },
            place: Geodetic {
                height_m: 35.0,
                ..origin
            },
            velocity_m_s: None,
            attitude: Some(Attitude {
                roll_deg: 0.0,
                pitch_deg: 0.0,
                azimuth_deg: 270.0,
            }),
        };
        let log = Log {
            records: vec![record],
            ..Log::default()
        };
        let fix = log.fixes(Source::Inspva, &frame, start).unwrap()[0];
        assert_eq!(fix.time_s, 1.5);
        assert!(fix.position_m.distance(DVec3::new(0.0, 0.0, 25.0)) < 1e-8);
        // It heads west, which is y.
        assert!((fix.attitude.unwrap() * DVec3::X).distance(DVec3::Y) < 1e-9);
        assert!((fix.attitude.unwrap() * DVec3::Z).distance(DVec3::Z) < 1e-9);
        assert!(log.fixes(Source::Bestpos, &frame, start).is_err());
        assert!(
            log.fixes(Source::Inspva, &SceneFrame::Local, start)
                .is_err()
        );
    }
}
