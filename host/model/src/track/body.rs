//! Moving rigid body: carrier of the antennas or moving target.

use std::fmt::Debug;

use glam::{DQuat, DVec3};

/// Position and attitude of a body.
///
/// Body axes: x forward, y left, z up. The identity attitude aligns them with the scene's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position of the body's origin, metres in the scene frame.
    pub position_m: DVec3,
    /// Rotation from body axes to scene axes; of unit length.
    pub attitude: DQuat,
}

impl Pose {
    /// Scene position of a point of the body (body axes, metres).
    #[inline]
    pub fn point_m(&self, body_m: DVec3) -> DVec3 {
        self.position_m + self.attitude * body_m
    }
}

/// Motion of a body as a function of time.
pub trait Trajectory: Debug + Send + Sync {
    /// Pose at a time, seconds from the collection's start. Defined for every finite time: recorded tracks are
    /// extrapolated at constant velocity.
    fn pose(&self, time_s: f64) -> Pose;
}
