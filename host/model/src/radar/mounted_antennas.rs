//! Beam of the antennas of a channel.

use glam::DVec3;

use crate::antenna::{Antenna, MountedAntennas};
use crate::phase_history::{Beam, NoBeam, headings};

impl MountedAntennas {
    /// Beam of both antennas along a track with these positions (midpoints of transmitter and receiver) at `times_s`,
    /// one per pulse, by [`Beam::of_lobes`]. The squint of an antenna is the angle of its boresight forward of
    /// broadside. The elevation of the beam is neglected: azimuth angles about the boresight are taken as angles
    /// about the track. A table is taken as centred on its boresight. `None` if neither antenna has a main lobe.
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
            let [boresight, ..] = self.antennas[i].axes(self.attitudes[n][i], middles_m[n]);
            (boresight.normalize_or_zero(), 0.0)
        })
    }
}
