//! Scatterers and obstacles of a scene.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use num_complex::Complex64;
use subaperture_model::track::Trajectory;

use crate::Scatterer;

/// Invalid part of a scene. The message contains the fault and the expected values.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("scene: {0}")]
pub struct SceneError(pub String);

/// Triangular trihedral corner reflector.
///
/// Its cross section on boresight is `4 pi a^4 / (3 lambda^2)` for edges of length `a`; [`Corner::amplitude`] gives its
/// decrease with the angle from boresight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Position of the apex, metres in the scene frame.
    pub position_m: DVec3,
    /// Boresight, a unit vector in scene axes.
    pub boresight: DVec3,
    /// Length of an inner edge, metres.
    pub edge_m: f64,
}

/// Isotropic point of constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingPoint {
    /// Position at time 0, and amplitude.
    pub start: Scatterer,
    /// Velocity, metres per second.
    pub velocity_m_s: DVec3,
}

impl MovingPoint {
    /// Position at a time, metres.
    pub fn position_m(&self, time_s: f64) -> DVec3 {
        self.start.position_m + self.velocity_m_s * time_s
    }
}

/// Isotropic point target that moves along a track.
#[derive(Clone, Debug)]
pub struct Mover {
    /// Track; only its position is used.
    pub motion: Arc<dyn Trajectory>,
    /// Complex amplitude, as of a [`Scatterer`].
    pub amplitude: Complex64,
}

/// Opaque box that occludes scatterers behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Centre, metres in the scene frame.
    pub centre_m: DVec3,
    /// Half lengths along the box's own axes, metres.
    pub half_m: DVec3,
    /// Rotation from the box's axes to the scene's.
    pub attitude: DQuat,
}

/// Opaque box of constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingBlock {
    /// Box at time 0.
    pub start: Block,
    /// Velocity, metres per second.
    pub velocity_m_s: DVec3,
}

impl MovingBlock {
    /// Box at a time, seconds.
    pub fn at(&self, time_s: f64) -> Block {
        Block {
            centre_m: self.start.centre_m + self.velocity_m_s * time_s,
            ..self.start
        }
    }
}
