//! Beam of a described recording: azimuth widths and boresights of its antennas, with the attitudes of the track.

use glam::DVec3;

use super::pulses::{Antennas, Chosen};
use subaperture_model::phase_history::{Beam, NoBeam};
use subaperture_model::radar::{MountedAntennas, is_directive};

/// Antennas of these pulses with their attitudes, if they have a pattern and belong to one channel.
pub(super) fn mounted(antennas: &Antennas, chosen: &[Chosen]) -> Option<MountedAntennas> {
    let channel = chosen.first()?.channel;
    let own = &antennas.channels[channel].antennas;
    let is_one = chosen.iter().all(|pulse| pulse.channel == channel);
    (is_one && is_directive(own)).then(|| MountedAntennas {
        antennas: own.clone(),
        attitudes: chosen
            .iter()
            .map(|pulse| antennas.attitudes(pulse.time_s))
            .collect(),
    })
}

/// The beam of these pulses, if their antennas have a pattern: [`MountedAntennas::beam`].
///
/// # Errors
/// [`NoBeam`]; [`NoBeam::Several`] for pulses of several channels.
pub(super) fn stated(antennas: &Antennas, chosen: &[Chosen]) -> Result<Option<Beam>, NoBeam> {
    let is_directive = |pulse: &Chosen| is_directive(&antennas.channels[pulse.channel].antennas);
    if !chosen.iter().any(is_directive) {
        return Ok(None);
    }
    if chosen
        .iter()
        .any(|pulse| pulse.channel != chosen[0].channel)
    {
        return Err(NoBeam::Several);
    }
    let Some(mounted) = mounted(antennas, chosen) else {
        return Ok(None);
    };
    let middles_m: Vec<DVec3> = chosen
        .iter()
        .map(|pulse| 0.5 * (pulse.antennas_m[0] + pulse.antennas_m[1]))
        .collect();
    let times_s: Vec<f64> = chosen.iter().map(|pulse| pulse.time_s).collect();
    mounted.beam(&times_s, &middles_m)
}
