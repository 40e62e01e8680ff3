//! A moment of a track.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec2, DVec3};

/// A moment of the track.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// The pulse's number in the recording.
    pub pulse: usize,
    /// When, seconds from the collection's start.
    pub time_s: f64,
    /// The body's origin, metres in the scene frame.
    pub position_m: DVec3,
    /// From the body's axes to the scene's.
    pub attitude: DQuat,
    /// Covariance of x and y, metres, and of the heading, radians: along the scene's axes where the plane of motion is level, else along the body's of the first pulse; relative to
    /// the first pose's place and the direction to the first target.
    pub covariance: DMat3,
    /// Targets seen.
    pub targets: usize,
    /// RMS of what ranges and phases are off, in standard deviations.
    pub residual: f64,
    /// Where the recording has the middle of the antennas, metres in the scene frame.
    pub recorded_m: DVec3,
}

impl Moment {
    /// Standard deviation of the place along the worst direction, metres.
    pub fn spread_m(&self) -> f64 {
        self.axes()[0].length()
    }

    /// A closed ring about the place, at so many standard deviations, metres in the scene's x and y where the plane of motion is level.
    pub fn ellipse_m(&self, sigmas: f64) -> Vec<DVec2> {
        const CORNERS: usize = 36;
        let [major, minor] = self.axes();
        let corner = |i: usize| {
            let (sin, cos) = libm::sincos(TAU * i as f64 / CORNERS as f64);
            self.position_m.truncate() + sigmas * (cos * major + sin * minor)
        };
        (0..=CORNERS).map(corner).collect()
    }

    /// Half axes of the ellipse of one standard deviation.
    fn axes(&self) -> [DVec2; 2] {
        let c = &self.covariance;
        let (a, b, both) = (c.x_axis.x, c.y_axis.y, c.x_axis.y);
        let (middle, half) = (0.5 * (a + b), libm::hypot(0.5 * (a - b), both));
        let towards = DVec2::from_angle(0.5 * libm::atan2(2.0 * both, a - b));
        let size = |variance: f64| variance.max(0.0).sqrt();
        [
            size(middle + half) * towards,
            size(middle - half) * towards.perp(),
        ]
    }
}
