//! The beam that a description states: its antennas' azimuth widths and boresights, as the track carries them.

use glam::DVec3;

use super::pulses::{Antennas, Chosen};
use subaperture_model::phase_history::{Beam, BeamSource};
use subaperture_model::radar::{Antenna, Pattern};

/// Most that the boresight's angle to the track may change over the pulses, as a part of the beam's width: more is an antenna that is steered.
const MAX_TURN: f64 = 0.25;

/// The beam of these pulses, if they are of one channel whose antennas have a pattern and keep their angle to the track.
///
/// With half-power widths `w_t` and `w_r` of the two antennas the width is `sqrt(2 / (1 / w_t^2 + 1 / w_r^2))`: at its edges the two-way power of Gaussian patterns is a quarter of
/// its middle's, and of two antennas alike it is their own. An isotropic antenna has no share in it. The squint is the angle of the boresights forward of broadside, each
/// weighted by `1 / w^2`. The beam's elevation is neglected: azimuth angles about the boresight are taken as angles about the track.
pub(super) fn stated(antennas: &Antennas, chosen: &[Chosen]) -> Option<Beam> {
    let channel = chosen.first()?.channel;
    if chosen.iter().any(|pulse| pulse.channel != channel) {
        return None;
    }
    let pair = &antennas.channels[channel].antennas;
    let inverse_squares = pair.each_ref().map(|antenna| match azimuth_rad(antenna) {
        Some(width_rad) => 1.0 / (width_rad * width_rad),
        None => 0.0,
    });
    let together: f64 = inverse_squares.iter().sum();
    if together == 0.0 {
        return None;
    }
    let width_rad = (2.0 / together).sqrt();
    let middles_m: Vec<DVec3> = chosen
        .iter()
        .map(|pulse| 0.5 * (pulse.antennas_m[0] + pulse.antennas_m[1]))
        .collect();
    let last = chosen.len() - 1;
    let (mut least, mut most, mut sum) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
    for (n, pulse) in chosen.iter().enumerate() {
        let moved_m = middles_m[(n + 1).min(last)] - middles_m[n.saturating_sub(1)];
        let heading = moved_m.try_normalize()?;
        let attitudes = antennas.attitudes(pulse.time_s);
        let angles = [0, 1].map(|i| {
            let along = heading.dot(attitudes[i] * pair[i].boresight.normalize_or_zero());
            inverse_squares[i] / together * libm::asin(along.clamp(-1.0, 1.0))
        });
        let squint_rad: f64 = angles.iter().sum();
        (least, most, sum) = (
            least.min(squint_rad),
            most.max(squint_rad),
            sum + squint_rad,
        );
    }
    let beam = Beam::new(width_rad, sum / chosen.len() as f64, BeamSource::Stated);
    (most - least <= MAX_TURN * width_rad && beam.is_sound()).then_some(beam)
}

fn azimuth_rad(antenna: &Antenna) -> Option<f64> {
    match antenna.pattern {
        Pattern::Isotropic => None,
        Pattern::Gaussian { azimuth_rad, .. } | Pattern::Aperture { azimuth_rad, .. } => {
            Some(azimuth_rad)
        }
    }
}
