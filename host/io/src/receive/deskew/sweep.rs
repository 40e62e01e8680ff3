//! Parameters of an FMCW sweep, and the delays in its scene.

use glam::DVec3;

use crate::receive::{EchoCollection, EchoPulse};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::Extent;
use subaperture_model::quantity::{hertz, seconds};
use subaperture_model::radar::Waveform;

/// Parameters of an FMCW sweep.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweep {
    pub(super) start_hz: f64,
    pub(super) chirp_hz_s: f64,
    pub(super) sample_rate_hz: f64,
    pub(super) mixer_delay_s: f64,
}

/// Sweep parameters of a collection, and its number of samples.
pub(super) fn sweep_of(collection: &EchoCollection) -> Result<(Sweep, usize), String> {
    let Waveform::Fmcw {
        start_hz,
        chirp_hz_s,
        sample_rate_hz,
        num_samples,
        mixer_delay_s,
    } = collection.waveform
    else {
        return Err("expected an FMCW waveform".to_owned());
    };
    let sweeps = chirp_hz_s.is_finite() && chirp_hz_s != 0.0;
    if !(sweeps && sample_rate_hz > 0.0 && num_samples > 0 && !collection.pulses.is_empty()) {
        return Err("expected a non-zero chirp rate, a positive sample rate, and at least one sample and pulse".to_owned());
    }
    let sweep = Sweep {
        start_hz,
        chirp_hz_s,
        sample_rate_hz,
        mixer_delay_s,
    };
    Ok((sweep, num_samples))
}

/// Largest delay in the scene relative to the reference's, given or from the extent, seconds; checked against the
/// sample rate.
pub(super) fn seen_half_delay_s(
    collection: &EchoCollection,
    given_s: Option<f64>,
    sweep: &Sweep,
) -> Result<f64, String> {
    let (chirp_hz_s, sample_rate_hz) = (sweep.chirp_hz_s, sweep.sample_rate_hz);
    let Some(half_delay_s) = given_s.or_else(|| half_delay(collection)) else {
        return Err("unknown size of the scene: give the extent or the half delay".to_owned());
    };
    if !(half_delay_s >= 0.0 && half_delay_s.is_finite()) {
        return Err(format!(
            "scene delays of up to {half_delay_s} s from the reference: expected a finite number, 0 or more"
        ));
    }
    // The whole unambiguous range is allowed, whatever the rounding.
    if half_delay_s * chirp_hz_s.abs() > sample_rate_hz / 2.0 * (1.0 + 1e-9) {
        return Err(format!(
            "delays of up to {} from the reference have beat frequencies of up to {}, more than half the sample rate of {}: \
                        raise the sample rate, lower the chirp rate, or reduce the extent",
            seconds(half_delay_s),
            hertz(half_delay_s * chirp_hz_s.abs()),
            hertz(sample_rate_hz)
        ));
    }
    Ok(half_delay_s)
}

/// Smallest and largest delay of the pulses' reference relative to the mixer's, seconds.
pub(super) fn ends_of_delays_s(collection: &EchoCollection, mixer_delay_s: f64) -> (f64, f64) {
    let delays = collection
        .pulses
        .iter()
        .map(|p| p.reference_path_m / SPEED_OF_LIGHT_M_S - mixer_delay_s);
    delays.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), d| {
        (a.min(d), b.max(d))
    })
}

/// Largest difference between a delay within the extent, at height 0, and the reference's, seconds.
fn half_delay(collection: &EchoCollection) -> Option<f64> {
    let Extent { x_m, y_m } = collection.extent?;
    let of_pulse = |pulse: &EchoPulse| {
        // Delays are convex: the largest is at a corner; the smallest is near the point below the antennas, or the
        // nearest point.
        let middle_m = 0.5 * (pulse.transmitter_m + pulse.receiver_m);
        let nearest = (
            middle_m.x.clamp(x_m.0, x_m.1),
            middle_m.y.clamp(y_m.0, y_m.1),
        );
        let corners = [
            (x_m.0, y_m.0),
            (x_m.0, y_m.1),
            (x_m.1, y_m.0),
            (x_m.1, y_m.1),
        ];
        corners
            .into_iter()
            .chain([nearest])
            .map(|(x, y)| pulse.relative_delay_s(DVec3::new(x, y, 0.0)).abs())
            .fold(0.0, f64::max)
    };
    Some(collection.pulses.iter().map(of_pulse).fold(0.0, f64::max))
}
