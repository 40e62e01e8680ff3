//! What reflects.
//!
//! A scatterer's amplitude is the square root of its radar cross section in square metres, with the phase
//! of its reflection: 1 is 1 m². A point reads that in a focused image, times the mean over pulses, weighted by the
//! slow-time window, of what antennas, spreading and shadows leave of it ([`super::engine`]): 1 for a radar without a
//! beam and without spreading.
//!
//! [`Clutter`], [`Picture`] and [`Building`] make points of what is more than a point.

mod building;
mod clutter;
mod corner;
mod picture;
pub mod shadow;

use std::sync::Arc;

use glam::{DQuat, DVec3};
use num_complex::Complex64;

pub use building::Building;
pub(crate) use clutter::MOST_POINTS;
pub use clutter::{Area, Clutter, Density};
pub use picture::{Picture, Placement};

use super::Scatterer;
use subaperture_model::track::Trajectory;

/// What is wrong with a part of a scene, and what to give instead.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("scene: {0}")]
pub struct SceneError(pub String);

/// Everything that reflects or hides.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Still points, alike in all directions: point targets, clutter, pixels of a picture, walls.
    pub points: Vec<Scatterer>,
    /// Corner reflectors.
    pub corners: Vec<Corner>,
    /// Points that move.
    pub movers: Vec<Mover>,
    /// Opaque boxes: what lies behind them is not seen.
    pub blocks: Vec<Block>,
}

/// A triangular trihedral corner reflector.
///
/// Its cross section on boresight is `4 pi a^4 / (3 lambda^2)` for an edge of `a`, falling off with
/// the angle from boresight; [`Corner::amplitude`] says how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Its apex, metres in the scene frame.
    pub position_m: DVec3,
    /// Unit vector to where it looks.
    pub boresight: DVec3,
    /// Length of an inner edge, metres.
    pub edge_m: f64,
}

/// A point in motion.
#[derive(Clone, Debug)]
pub struct Mover {
    /// Where it is; only the position counts.
    pub motion: Arc<dyn Trajectory>,
    /// Its amplitude.
    pub amplitude: Complex64,
}

/// An opaque box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Its centre, metres in the scene frame.
    pub centre_m: DVec3,
    /// Half its lengths along its own axes, metres.
    pub half_m: DVec3,
    /// Turns its axes into the scene's.
    pub attitude: DQuat,
}
