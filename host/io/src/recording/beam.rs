//! Beam of a described recording: azimuth widths and boresights of its antennas, with the attitudes of the track.

use glam::DVec3;

use super::pulses::{Antennas, Chosen};
use subaperture_model::phase_history::Beam;
use subaperture_model::radar::Carried;

/// The beam of these pulses, if they are of one channel whose antennas have a pattern and keep their angle to the track: [`Carried::beam`].
pub(super) fn stated(antennas: &Antennas, chosen: &[Chosen]) -> Option<Beam> {
    let channel = chosen.first()?.channel;
    if chosen.iter().any(|pulse| pulse.channel != channel) {
        return None;
    }
    let carried = Carried {
        antennas: antennas.channels[channel].antennas.clone(),
        attitudes: chosen
            .iter()
            .map(|pulse| antennas.attitudes(pulse.time_s))
            .collect(),
    };
    let middles_m: Vec<DVec3> = chosen
        .iter()
        .map(|pulse| 0.5 * (pulse.antennas_m[0] + pulse.antennas_m[1]))
        .collect();
    carried.beam(&middles_m)
}
