//! Meaning of the points of a grid: positions or velocities.

use glam::DVec3;
use subaperture_model::phase_history::Pulse;

/// Meaning of grid points.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Meaning {
    /// Positions of stationary points.
    Places,
    /// Velocities of a target at a given position and time; the grid has metres per second in place of metres.
    Velocities { position_m: DVec3, epoch_s: f64 },
}

impl Meaning {
    /// Position and velocity at the time of a pulse, metres and metres per second, for a grid point.
    pub(super) fn target(&self, pulse: &Pulse, point: DVec3) -> (DVec3, DVec3) {
        match *self {
            Self::Places => (point, DVec3::ZERO),
            Self::Velocities {
                position_m,
                epoch_s,
            } => (position_m + point * (pulse.time_s - epoch_s), point),
        }
    }
}
