//! Validation of an experiment before computation.

use crate::experiment::Experiment;
use subaperture_model::radar::Waveform;

/// Check the timing and waveform parameters. The error is a message.
pub(super) fn check(experiment: &Experiment) -> Result<(), String> {
    let radar = &experiment.radar;
    let positive = |x: f64| x.is_finite() && x > 0.0;
    if !positive(radar.pri_s) || !radar.start_s.is_finite() {
        return Err(format!(
            "pulse repetition interval of {} s, start at {} s: expected a positive interval and a finite start",
            radar.pri_s, radar.start_s
        ));
    }
    let sound = match radar.waveform {
        Waveform::Ideal { band } => positive(band.start_hz) && positive(band.step_hz),
        Waveform::Stepped {
            band,
            step_s,
            dwell_s,
        } => {
            positive(band.start_hz)
                && positive(band.step_hz)
                && positive(dwell_s)
                && step_s.is_finite()
                && step_s >= 0.0
        }
        Waveform::Pulsed {
            centre_hz,
            sample_rate_hz,
            window_start_s,
            ref shape,
            ..
        } => {
            positive(centre_hz)
                && positive(sample_rate_hz)
                && window_start_s.is_finite()
                && positive(shape.duration_s())
                && positive(shape.bandwidth_hz())
        }
        Waveform::Fmcw {
            start_hz,
            chirp_hz_s,
            sample_rate_hz,
            mixer_delay_s,
            ..
        } => {
            positive(start_hz)
                && positive(sample_rate_hz)
                && mixer_delay_s.is_finite()
                && positive(chirp_hz_s.abs())
        }
    };
    if !sound || radar.waveform.num_samples() == 0 {
        return Err(format!(
            "{:?}: expected positive frequencies, rates and durations, and at least one sample",
            radar.waveform
        ));
    }
    Ok(())
}
