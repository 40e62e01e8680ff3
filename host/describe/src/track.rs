//! Tracks from the keys of platforms and moving targets.

use std::sync::Arc;

use glam::DVec3;

use subaperture_model::track::{Circular, Linear, Spline, Trajectory, Waypoints};

use crate::declare::{Choice, Located, section};
use crate::error::Fault;

/// Time at which a position on the track is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum At {
    /// Time 0 of the platform's clock.
    Start,
    /// Middle of the collection.
    Middle,
}

impl At {
    /// The time, seconds, of a collection whose middle is `middle_s`.
    pub fn time_s(self, middle_s: f64) -> f64 {
        match self {
            Self::Start => 0.0,
            Self::Middle => middle_s,
        }
    }
}

/// Direction of rotation on a circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Turn {
    /// Counterclockwise seen from above.
    Left,
    /// Clockwise seen from above.
    Right,
}

/// Start and direction of the motion on a circle.
#[section]
#[derive(Clone, Copy, Debug)]
pub struct TurnKeys {
    /// Angle on the circle at the time given by 'at', from x towards y.
    #[key(default = "-90 deg")]
    pub bearing_rad: f64,
    /// Direction of rotation: left is counterclockwise seen from above.
    #[key(default = "left")]
    pub turn: Turn,
}

impl TurnKeys {
    /// Circle on which the bearing is that at `at_s`, seconds.
    pub fn circle(
        &self,
        centre_m: DVec3,
        radius_m: f64,
        speed_m_s: f64,
        at_s: f64,
    ) -> Arc<dyn Trajectory> {
        let turn = match self.turn {
            Turn::Left => 1.0,
            Turn::Right => -1.0,
        };
        let rate_rad_s = turn * speed_m_s / radius_m;
        Arc::new(Circular {
            centre_m,
            radius_m,
            start_rad: self.bearing_rad - rate_rad_s * at_s,
            rate_rad_s,
        })
    }
}

/// Records of a navigation log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Record {
    /// Position and attitude, with their standard deviations.
    Inspvax,
    /// Position and attitude, without deviations.
    Inspva,
    /// Position without an attitude.
    Bestpos,
}

/// Reading of a NovAtel log.
#[section]
#[derive(Clone, Copy, Debug)]
pub struct LogKeys {
    /// Records of the log used for the track; bestpos has no attitude.
    #[key(default = "inspvax")]
    pub record: Record,
    /// Skip damaged lines of the log.
    #[key(default = false)]
    pub skip_damaged: bool,
}

/// Straight line through a position at a time.
pub fn line(position_m: DVec3, velocity_m_s: DVec3, at_s: f64) -> Arc<dyn Trajectory> {
    Arc::new(Linear {
        position_m,
        velocity_m_s,
        at_s,
    })
}

/// Straight segments through rows of time and position.
///
/// # Errors
/// Fewer than two points, or times that do not ascend.
pub fn segments(points: &Located<Vec<[f64; 4]>>) -> Result<Arc<dyn Trajectory>, Fault> {
    let (times, positions) = timed(points);
    let track =
        Waypoints::new(times, positions).map_err(|error| points.fault(error.to_string()))?;
    Ok(Arc::new(track))
}

/// Smooth curve through rows of time and position.
///
/// # Errors
/// As [`segments`].
pub fn curve(points: &Located<Vec<[f64; 4]>>) -> Result<Arc<dyn Trajectory>, Fault> {
    let (times, positions) = timed(points);
    let track = Spline::new(times, &positions).map_err(|error| points.fault(error.to_string()))?;
    Ok(Arc::new(track))
}

fn timed(points: &[[f64; 4]]) -> (Vec<f64>, Vec<DVec3>) {
    let rows = points.iter();
    rows.map(|&[time_s, x, y, z]| (time_s, DVec3::new(x, y, z)))
        .unzip()
}
