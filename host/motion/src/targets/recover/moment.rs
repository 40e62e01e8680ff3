//! Pose of a track at a pulse.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec2, DVec3};

/// Pose of the track at a pulse.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// Number of the pulse in the recording.
    pub pulse: usize,
    /// Time, seconds from the collection's start.
    pub time_s: f64,
    /// Position of the body's origin, metres in the scene frame.
    pub position_m: DVec3,
    /// Rotation from the body's axes to the scene's.
    pub attitude: DQuat,
    /// Covariance of x and y (metres) and heading (radians), along the scene's axes if the plane of motion is level, else along the body's axes in the first pulse. It is that of the track's shape: after the turn and shift that
    /// align it best with the true positions (with the first pose if the recorded positions do not move), and enlarged where residuals exceed the stated noise.
    pub covariance: DMat3,
    /// Number of targets in the pulse.
    pub targets: usize,
    /// RMS residual of ranges and phases, in standard deviations.
    pub residual: f64,
    /// Recorded phase centre of the antennas, metres in the scene frame.
    pub recorded_m: DVec3,
}

impl Moment {
    /// Standard deviation of the position along its worst direction, metres.
    pub fn spread_m(&self) -> f64 {
        self.axes()[0].length()
    }

    /// Closed polygon of the error ellipse of so many standard deviations, metres in the scene's x and y if the plane of motion is level.
    pub fn ellipse_m(&self, sigmas: f64) -> Vec<DVec2> {
        const CORNERS: usize = 36;
        let [major, minor] = self.axes();
        let corner = |i: usize| {
            let (sin, cos) = libm::sincos(TAU * i as f64 / CORNERS as f64);
            self.position_m.truncate() + sigmas * (cos * major + sin * minor)
        };
        (0..=CORNERS).map(corner).collect()
    }

    /// Semi-axes of the ellipse of one standard deviation, metres.
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
