//! Moving rigid body: carrier of the antennas or moving target.

use std::fmt::Debug;

use glam::{DQuat, DVec3};

/// Position and attitude of a body.
///
/// Body axes: x forward, y left, z up. An attitude of identity lays them along the scene's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position of the body's origin, metres in the scene frame.
    pub position_m: DVec3,
    /// Turns body directions into scene directions; of unit length.
    pub attitude: DQuat,
}

impl Pose {
    /// The scene position of a point of the body (body axes, metres).
    #[inline]
    pub fn point_m(&self, body_m: DVec3) -> DVec3 {
        self.position_m + self.attitude * body_m
    }
}

/// Motion of a body as a function of time.
pub trait Trajectory: Debug + Send + Sync {
    /// The pose at a time, seconds from the collection's start. Defined for every finite time:
    /// recorded tracks go on at their ends with the speed they had.
    fn pose(&self, time_s: f64) -> Pose;
}
