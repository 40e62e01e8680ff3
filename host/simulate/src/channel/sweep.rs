//! Conversion of a waveform to the engine's sweep.

use crate::engine::Sweep;
use subaperture_model::radar::Waveform;

/// Engine sweep of a waveform sampled with a delay of `late_s`, and the delay that counts as zero; `delay_s` is the
/// delay of the reference. All in seconds.
pub(super) fn sweep(waveform: &Waveform, delay_s: f64, late_s: f64) -> (Sweep, f64) {
    let count = waveform.num_samples();
    let at_once = |start_hz, step_hz, start_s| Sweep {
        start_hz,
        step_hz,
        count,
        start_s,
        step_s: 0.0,
        residual_hz_s: 0.0,
    };
    match *waveform {
        Waveform::Ideal { band } => (at_once(band.start_hz, band.step_hz, 0.0), delay_s),
        Waveform::Stepped { band, step_s, .. } => {
            let sweep = Sweep {
                step_s,
                ..at_once(band.start_hz, band.step_hz, 0.0)
            };
            (sweep, delay_s)
        }
        Waveform::Pulsed {
            centre_hz,
            sample_rate_hz,
            window_start_s,
            ..
        } => {
            let step_hz = sample_rate_hz / count as f64;
            let start_hz = centre_hz - (count / 2) as f64 * step_hz;
            let sweep = at_once(start_hz, step_hz, waveform.middle_s());
            (sweep, window_start_s + late_s)
        }
        Waveform::Fmcw {
            start_hz,
            chirp_hz_s,
            sample_rate_hz,
            mixer_delay_s,
            ..
        } => {
            let sweep = Sweep {
                start_hz: start_hz + chirp_hz_s * (late_s - mixer_delay_s),
                step_hz: chirp_hz_s / sample_rate_hz,
                count,
                start_s: late_s,
                step_s: 1.0 / sample_rate_hz,
                residual_hz_s: chirp_hz_s,
            };
            (sweep, mixer_delay_s)
        }
    }
}
