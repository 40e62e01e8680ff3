//! Points of a grid: positions or velocities.

use glam::DVec3;
use subaperture_model::phase_history::Pulse;

/// Quantity whose values are the points of a grid.
#[derive(Clone, Copy, Debug)]
pub enum GridPoints {
    /// Positions of stationary points, metres.
    Positions,
    /// Velocities of a target at a given position and time; metres per second replace metres.
    Velocities {
        /// Position of the target at the epoch, metres in the scene frame.
        position_m: DVec3,
        /// Epoch, seconds from the collection's start.
        epoch_s: f64,
    },
}

impl GridPoints {
    /// Position and velocity at the time of a pulse, metres and metres per second, for a grid point.
    pub(crate) fn target(&self, pulse: &Pulse, point: DVec3) -> (DVec3, DVec3) {
        match *self {
            Self::Positions => (point, DVec3::ZERO),
            Self::Velocities {
                position_m,
                epoch_s,
            } => (position_m + point * (pulse.time_s - epoch_s), point),
        }
    }
}
