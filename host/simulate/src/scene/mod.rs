//! Reflecting and occluding objects of a scene.
//!
//! The amplitude of a scatterer is the square root of its radar cross section in square metres, with the phase of its
//! reflection: an amplitude of 1 is 1 m². The pixel of a point in a focused image has this amplitude, times the mean
//! over pulses (weighted by the slow-time window) of antenna gain, spreading and visibility ([`super::engine`]); the
//! mean is 1 for isotropic antennas without spreading loss.
//!
//! [`Clutter`], [`Picture`] and [`Building`] represent extended objects by points. [`InternalMotion`] gives the points of
//! clutter velocities.

mod building;
mod clutter;
mod corner;
mod internal_motion;
mod picture;
pub mod shadow;

use std::sync::Arc;

use glam::{DQuat, DVec3};
use num_complex::Complex64;

pub use building::Building;
pub(crate) use clutter::MAX_POINTS;
pub use clutter::{Area, Clutter, Density};
pub use internal_motion::InternalMotion;
pub(crate) use internal_motion::MAX_SPREAD_M_S;
pub use picture::{Picture, Placement};

use super::Scatterer;
use subaperture_model::track::Trajectory;

/// Invalid part of a scene. The message contains the fault and the expected values.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("scene: {0}")]
pub struct SceneError(pub String);

/// Reflecting and occluding objects.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Static isotropic points: point targets, clutter, pixels of a picture, walls.
    pub points: Vec<Scatterer>,
    /// Isotropic points of constant velocity: clutter with internal motion.
    pub moving_points: Vec<MovingPoint>,
    /// Triangular trihedral corner reflectors.
    pub corners: Vec<Corner>,
    /// Moving isotropic point targets.
    pub movers: Vec<Mover>,
    /// Opaque boxes, which occlude objects behind them.
    pub blocks: Vec<Block>,
}

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
