//! Waveforms of the radar: of the keys, and of the files that contain their frequencies.

use num_complex::Complex32;

use super::arrays::Source;
use super::keys::{RadarKeys, WaveformKeys, WaveformKeysPulsed};
use super::samples::Samples;
use crate::npy::Values;
use subaperture_describe::declare::Located;
use subaperture_describe::error::Fault;
use subaperture_describe::radar::{IntraPulse, ShapeKeys, ShapeKeysRecorded, check_sampled};
use subaperture_model::phase_history::Band;
use subaperture_model::radar::{PulseShape, Waveform};
use subaperture_signal::phase::widen;

/// Waveform of these keys, and motion during a sweep. Profiles have none.
pub(super) fn of(
    radar: &RadarKeys,
    kind: &WaveformKeys,
    source: &Source,
    samples: &Samples,
) -> Result<(Waveform, IntraPulse), Fault> {
    let waveform = match kind {
        WaveformKeys::Fmcw(fmcw) => Waveform::Fmcw {
            start_hz: required(
                radar.start_hz.as_ref(),
                radar,
                "start",
                "the frequency of the first sample",
                "77 GHz",
            )?,
            chirp_hz_s: fmcw.slope_hz_s,
            sample_rate_hz: fmcw.sample_rate_hz,
            num_samples: samples.num_samples,
            mixer_delay_s: fmcw.mixer_delay_s,
        },
        WaveformKeys::Pulsed(keys) => {
            let waveform = pulsed(radar, keys, source, samples.num_samples)?;
            return Ok((waveform, IntraPulse::StopAndGo));
        }
        WaveformKeys::Stepped => stepped(radar, samples)?,
        WaveformKeys::Profiles(_) => {
            return Err(radar.kind.fault("range profiles have no waveform"));
        }
    };
    Ok((waveform, stated(&radar.motion)))
}

/// Stated motion during a sweep; stop-and-go by default.
fn stated(motion: &Option<Located<IntraPulse>>) -> IntraPulse {
    motion.as_deref().copied().unwrap_or(IntraPulse::StopAndGo)
}

fn pulsed(
    radar: &RadarKeys,
    keys: &WaveformKeysPulsed,
    source: &Source,
    count: usize,
) -> Result<Waveform, Fault> {
    let shape = match &keys.pulse.kind {
        ShapeKeys::Recorded(recorded) => replica(recorded, source, keys.sample_rate_hz)?,
        _ => keys.pulse.shape(keys.sample_rate_hz)?,
    };
    // No echo of a longer pulse is recorded completely, and the computation would take as long as the pulse.
    let recorded_s = count as f64 / keys.sample_rate_hz;
    if shape.duration_s() > recorded_s * (1.0 + 1e-9) {
        let key = match &keys.pulse.kind {
            ShapeKeys::Lfm(lfm) => &lfm.duration_s,
            ShapeKeys::Code(code) => &code.chip_s,
            ShapeKeys::Recorded(recorded) => &recorded.bandwidth_hz,
        };
        return Err(key.fault(format!(
            "the pulse lasts {:.6} us and the {count} samples recorded of each last {:.6} us: shorten it, or check [radar] sample_rate",
            shape.duration_s() * 1e6,
            recorded_s * 1e6
        )));
    }
    let centre = radar.centre_hz.as_ref().ok_or_else(|| {
        radar
            .kind
            .fault("the echoes are complex: give 'centre', the frequency that 0 Hz corresponds to")
    })?;
    Ok(Waveform::Pulsed {
        centre_hz: **centre,
        sample_rate_hz: keys.sample_rate_hz,
        num_samples: count,
        window_start_s: keys.window_start_s,
        shape,
    })
}

/// Recorded pulse from its array.
fn replica(
    recorded: &ShapeKeysRecorded,
    source: &Source,
    rate_hz: f64,
) -> Result<PulseShape, Fault> {
    check_sampled(&recorded.bandwidth_hz, rate_hz)?;
    let array = source.array(&recorded.samples)?;
    let fault = |message: String| Err(recorded.samples.fault(message));
    let Values::Complex(values) = &array.values else {
        return fault("expected the complex samples of the pulse, found real numbers".to_owned());
    };
    if array.shape.iter().filter(|&&size| size > 1).count() > 1 || values.is_empty() {
        return fault(format!(
            "expected a row of complex samples of the pulse, found shape {:?}",
            array.shape
        ));
    }
    if let Some(i) = values
        .iter()
        .position(|z| !(z.re.is_finite() && z.im.is_finite()))
    {
        return fault(format!("sample {i} of the pulse is not a finite number"));
    }
    if values.iter().all(|z| *z == Complex32::ZERO) {
        return fault("expected a pulse, found only zeros".to_owned());
    }
    Ok(PulseShape::Recorded {
        samples: values.iter().map(|&z| widen(z)).collect(),
        rate_hz,
        bandwidth_hz: *recorded.bandwidth_hz,
    })
}

/// Value of a key of `[radar]` that this recording needs. `meaning` and `example` are those of the error.
fn required(
    key: Option<&Located<f64>>,
    radar: &RadarKeys,
    name: &str,
    meaning: &str,
    example: &str,
) -> Result<f64, Fault> {
    key.map(|value| **value).ok_or_else(|| {
        let message =
            format!("[radar] needs '{name}', {meaning}: write for example {name} = \"{example}\"");
        Fault::new(&radar.header, message)
    })
}

/// First frequency and step of a stepped radar: those of its files, or else those stated.
fn band_hz(radar: &RadarKeys, samples: &Samples) -> Result<[f64; 2], Fault> {
    let stated = [radar.start_hz.as_ref(), radar.step_hz.as_ref()];
    let Some(of_files) = samples.band_hz else {
        return Ok([
            required(
                stated[0],
                radar,
                "start",
                "the frequency of the first sample",
                "77 GHz",
            )?,
            required(stated[1], radar, "step", "the frequency step", "4 MHz")?,
        ]);
    };
    let step_hz = of_files[1];
    // A step that is off by a hundredth over the whole band, and a start by a hundredth of a step.
    let most_hz = [0.01 * step_hz, 0.01 * step_hz / samples.num_samples as f64];
    for ((key, of_files_hz), most_hz) in stated.into_iter().zip(of_files).zip(most_hz) {
        if let Some(key) = key
            && (**key - of_files_hz).abs() > most_hz
        {
            return Err(key.fault(format!(
                "expected {of_files_hz} Hz, the frequency in the Touchstone files, found {} Hz: leave the key out",
                **key
            )));
        }
    }
    Ok(of_files)
}

fn stepped(radar: &RadarKeys, samples: &Samples) -> Result<Waveform, Fault> {
    let [start_hz, step_hz] = band_hz(radar, samples)?;
    let band = Band {
        start_hz,
        step_hz,
        count: samples.num_samples,
    };
    match (radar.step_time_s, stated(&radar.motion)) {
        (Some(step_s), _) => Ok(Waveform::Stepped {
            band,
            step_s,
            dwell_s: step_s,
        }),
        (None, IntraPulse::True) => {
            let text =
                "with motion = \"true\", give 'step_time' too: when a frequency's sample was taken";
            Err(match &radar.motion {
                Some(motion) => motion.fault(text),
                None => Fault::new(&radar.header, text),
            })
        }
        (None, IntraPulse::StopAndGo) => Ok(Waveform::Ideal { band }),
    }
}
