//! Antennas of a channel with the attitudes of their bodies.

use glam::{DQuat, DVec3};

use super::{Antenna, Pattern};
use crate::phase_history::{Beam, NoBeam, headings};

/// Transmitting and receiving antenna of a channel, with the attitude of their bodies at each pulse.
#[derive(Clone, Debug, PartialEq)]
pub struct MountedAntennas {
    /// Transmitting and receiving antenna.
    pub antennas: [Antenna; 2],
    /// Attitudes of both bodies per pulse, in scene axes.
    pub attitudes: Vec<[DQuat; 2]>,
}

impl MountedAntennas {
    /// Whether one of the antennas has a pattern.
    pub fn is_directive(&self) -> bool {
        is_directive(&self.antennas)
    }

    /// Beam of both antennas along a track with these positions (midpoints of transmitter and receiver) at `times_s`,
    /// one per pulse, by [`Beam::of_lobes`]. The squint of an antenna is the angle of its boresight forward of
    /// broadside. The elevation of the beam is neglected: azimuth angles about the boresight are taken as angles
    /// about the track. `None` if neither antenna has a pattern.
    ///
    /// # Errors
    /// [`NoBeam`].
    pub fn beam(&self, times_s: &[f64], middles_m: &[DVec3]) -> Result<Option<Beam>, NoBeam> {
        if !self.is_directive() {
            return Ok(None);
        }
        let headings = headings(middles_m);
        if headings.contains(&DVec3::ZERO) {
            return Err(NoBeam::AtRest);
        }
        if headings.len() != self.attitudes.len() || headings.len() != times_s.len() {
            return Err(NoBeam::NoAttitude);
        }
        let widths_rad = self.antennas.each_ref().map(Antenna::width_rad);
        Beam::of_lobes(widths_rad, times_s, &headings, |n, i| {
            let boresight = self.attitudes[n][i] * self.antennas[i].boresight;
            (boresight.normalize_or_zero(), 0.0)
        })
    }
}

/// Whether one of these antennas has a pattern.
pub fn is_directive(antennas: &[Antenna]) -> bool {
    antennas.iter().any(|antenna| antenna.width_rad().is_some())
}

impl Antenna {
    /// Half-power width in azimuth, radians; `None` for an isotropic antenna.
    pub fn width_rad(&self) -> Option<f64> {
        match self.pattern {
            Pattern::Isotropic => None,
            Pattern::Gaussian { azimuth_rad, .. } | Pattern::Aperture { azimuth_rad, .. } => {
                Some(azimuth_rad)
            }
        }
    }
}
