//! Conversion of samples and pulses to phase history by the adapter of `[radar] kind`.

use num_complex::Complex32;

use super::analytic;
use super::arrays::Source;
use super::keys::{Background, RadarKeys, RecordingDescription, RecordingKeys, WaveformKeys};
use super::moving::InMotion;
use super::pulses::{Chosen, Pulses};
use super::samples::Samples;
use super::waveform;
use crate::receive::{
    Compressed, Deskewed, EchoCollection, EchoPulse, Echoes, Filter, ProfileAxis, Profiles,
    ReceiveError, Referenced, Skew, StoredEchoes, remove_background,
};
use subaperture_describe::declare::Located;
use subaperture_describe::error::Fault;
use subaperture_describe::place;
use subaperture_describe::radar::IntraPulse;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::Extent;
use subaperture_model::phase_history::{Collection, InMemory, PhaseHistory, Pulse, Sweep};
use subaperture_model::radar::{Reference, Waveform};

use glam::DVec3;

/// The recording as phase history in memory.
pub(super) fn adapt(
    top: &RecordingDescription,
    source: &Source,
    samples: Samples,
    pulses: &Pulses,
) -> Result<InMemory, Fault> {
    let (recording, scene) = (&top.recording, &top.scene);
    let header = Header {
        name: name(top, source),
        pulses,
        extent: place::extent(&scene.x_m, &scene.y_m)?,
        bias_path_m: 2.0 * recording.range_bias_m,
        given: match &pulses.in_flight {
            Some(in_flight) => Some(Reference::Point(in_flight.reference_m)),
            None => place::reference(scene.reference_m, &scene.reference_range_m)?,
        },
    };
    let mut raw = rows_of(recording, pulses, &samples);
    check_finite(recording, pulses, samples.num_samples, &raw)?;
    if samples.real
        && let WaveformKeys::Fmcw(fmcw) = &*top.radar.kind
    {
        analytic::beats(&mut raw, samples.num_samples, fmcw.slope_hz_s > 0.0);
    }
    remove(recording, pulses, samples.num_samples, &mut raw)?;
    let radar = &top.radar;
    let (waveform, motion) = match &*radar.kind {
        WaveformKeys::Profiles(profiles) => {
            let built = from_profiles(radar, &profiles.band_hz, source, &samples, &header, raw)?;
            return built.map_err(|fault| recording.file.fault(fault));
        }
        kind => waveform::of(radar, kind, source, &samples)?,
    };
    let moves = motion == IntraPulse::True;
    from_echoes(radar, waveform, moves, &samples, &header, raw)?
        .map_err(|fault| recording.file.fault(fault))
}

/// Check that memory suffices for the samples as read, in the adapter, and as phase history.
pub(super) fn check_memory(
    source: &Source,
    num_pulses: usize,
    num_samples: usize,
) -> Result<(), Fault> {
    let needed = 24 * (num_pulses as u64).saturating_mul(num_samples as u64);
    let left = source.left_bytes();
    if needed <= left {
        return Ok(());
    }
    Err(source.recording.file.fault(
        format!(
            "{num_pulses} pulses of {num_samples} samples need {needed} bytes of memory, but {left} are left: allow \
             more, or choose fewer pulses"
        ),
    ))
}

/// Check that the samples are finite. The error names the pulse by its number in the recording.
fn check_finite(
    recording: &RecordingKeys,
    pulses: &Pulses,
    num_samples: usize,
    raw: &[Complex32],
) -> Result<(), Fault> {
    match raw.iter().position(|z| !(z.re.is_finite() && z.im.is_finite())) {
        None => Ok(()),
        Some(i) => Err(recording.values_fault(format!(
            "sample {} of pulse {} is not a finite number: repair it, or leave the pulse out by [recording] first and count",
            i % num_samples,
            pulses.chosen[i / num_samples].index
        ))),
    }
}

/// Samples of the chosen pulses, with the sweeps of a pulse averaged.
fn rows_of(recording: &RecordingKeys, pulses: &Pulses, samples: &Samples) -> Vec<Complex32> {
    let rows = pulses.chosen.iter();
    samples.of(rows.map(|pulse| pulses.rows(recording, pulse.index, pulse.channel)))
}

/// Phase history from range profiles. The inner error concerns the file.
fn from_profiles(
    radar: &RadarKeys,
    band_hz: &Located<(f64, f64)>,
    source: &Source,
    samples: &Samples,
    header: &Header<'_>,
    raw: Vec<Complex32>,
) -> Result<Result<InMemory, String>, Fault> {
    let axis = profile_axis(radar, source, samples)?;
    let middle_m = axis.first_range_m + axis.range_step_m * samples.num_samples as f64 / 2.0;
    let collection = header.collection(middle_m);
    let profiles = Profiles::new(collection, axis, **band_hz, raw);
    let profiles = profiles.map_err(|error| band_hz.fault(error.to_string()))?;
    Ok(whole(&profiles, header))
}

/// Phase history from the echoes of a waveform. The inner error concerns the file.
fn from_echoes(
    radar: &RadarKeys,
    waveform: Waveform,
    moves: bool,
    samples: &Samples,
    header: &Header<'_>,
    raw: Vec<Complex32>,
) -> Result<Result<InMemory, String>, Fault> {
    let received = |error: ReceiveError| Fault::new(&radar.header, error.what);
    // Real samples contain beats up to half the sampling rate, complex ones up to the whole rate.
    let held = if samples.real { 0.5 } else { 1.0 };
    let middle_m = middle_of_window_m(&waveform, held);
    let half_delay_s = match (&waveform, header.extent) {
        (
            Waveform::Fmcw {
                chirp_hz_s,
                sample_rate_hz,
                ..
            },
            None,
        ) => {
            // Extent that the samples can represent.
            Some(0.5 * held * sample_rate_hz / chirp_hz_s.abs())
        }
        _ => None,
    };
    let echoes = header.echoes(waveform, middle_m);
    let held = InMotion {
        held: StoredEchoes::new(echoes, raw).map_err(received)?,
        moves,
        point: header.point(),
        pulses: header.pulses,
        bias_path_m: header.bias_path_m,
    };
    Ok(match held.collection().waveform {
        Waveform::Fmcw { .. } => whole(
            &Deskewed::new(held, half_delay_s, Skew::Removed).map_err(received)?,
            header,
        ),
        Waveform::Pulsed { .. } => {
            let compressed = Compressed::new(held, Filter::Inverse).map_err(received)?;
            match &header.pulses.in_flight {
                None => whole(&compressed, header),
                Some(in_flight) => {
                    let Pulses {
                        chosen, antennas, ..
                    } = header.pulses;
                    let velocities = |n: usize| {
                        let Chosen {
                            channel, time_s, ..
                        } = chosen[n];
                        in_flight.velocities_m_s(time_s, |time_s| antennas.at_m(channel, time_s))
                    };
                    whole(&compressed.moving(velocities), header)
                }
            }
        }
        _ => whole(&Referenced::new(held).map_err(received)?, header),
    })
}

/// Parameters common to all kinds.
struct Header<'a> {
    name: String,
    pulses: &'a Pulses,
    extent: Option<Extent>,
    bias_path_m: f64,
    given: Option<Reference>,
}

impl Header<'_> {
    /// Geometry of a pulse; its reference path includes the range bias. Without a stated reference it is that of the middle of the samples'
    /// extent. No range is stored: all are computed in float64 from the description's numbers and the antenna positions, so no rounding
    /// differs from pulse to pulse.
    fn echo(&self, pulse: &Chosen, middle_m: f64) -> EchoPulse {
        let [transmitter_m, receiver_m] = pulse.antennas_m;
        let path_to = |point: DVec3| transmitter_m.distance(point) + receiver_m.distance(point);
        let (reference_m, path_m) = match self.given {
            Some(Reference::Point(point)) => (point, path_to(point) + self.bias_path_m),
            Some(Reference::Range(range_m)) => (DVec3::ZERO, 2.0 * range_m + self.bias_path_m),
            None => (DVec3::ZERO, 2.0 * middle_m),
        };
        EchoPulse {
            time_s: pulse.time_s,
            transmitter_m,
            receiver_m,
            reference_m,
            reference_path_m: path_m,
        }
    }

    /// The reference point of the phases, if it is a point.
    fn point(&self) -> Option<DVec3> {
        match self.given {
            Some(Reference::Point(point)) => Some(point),
            _ => None,
        }
    }

    fn echoes(&self, waveform: Waveform, middle_m: f64) -> EchoCollection {
        let chosen = self.pulses.chosen.iter();
        EchoCollection {
            name: self.name.clone(),
            waveform,
            pulses: chosen.map(|pulse| self.echo(pulse, middle_m)).collect(),
            frame: self.pulses.frame,
            extent: self.extent,
            timed: self.pulses.timed,
        }
    }

    fn collection(&self, middle_m: f64) -> Collection {
        let chosen = self
            .pulses
            .chosen
            .iter()
            .map(|pulse| self.echo(pulse, middle_m));
        Collection {
            name: self.name.clone(),
            num_samples: 0,
            pulses: chosen
                .map(|echo| Pulse {
                    time_s: echo.time_s,
                    transmitter_m: echo.transmitter_m,
                    receiver_m: echo.receiver_m,
                    reference_m: echo.reference_m,
                    reference_path_m: echo.reference_path_m,
                    start_hz: 0.0,
                    step_hz: 0.0,
                    sweep: Sweep::AT_ONCE,
                    recorded_path_m: None,
                })
                .collect(),
            frame: self.pulses.frame,
            extent: self.extent,
            timed: self.pulses.timed,
        }
    }
}

/// Complete phase history in memory, with reference paths that exclude the bias.
fn whole(history: &dyn PhaseHistory, header: &Header) -> Result<InMemory, String> {
    let mut collection = history.collection().clone();
    let count = collection.pulses.len();
    let mut samples = vec![Complex32::ZERO; count * collection.num_samples];
    history
        .read(0..count, &mut samples)
        .map_err(|error| error.to_string())?;
    for pulse in &mut collection.pulses {
        pulse.reference_path_m -= header.bias_path_m;
        let recorded = pulse.recorded_path_m.iter_mut().flatten();
        recorded.for_each(|path_m| *path_m -= header.bias_path_m);
    }
    let num_samples = collection.num_samples;
    let fault = |(n, pulse): (usize, &Pulse)| pulse.fault(num_samples).map(|what| (n, what));
    if let Some((n, what)) = collection.pulses.iter().enumerate().find_map(fault) {
        return Err(format!("pulse {n}: {what}"));
    }
    let channels = &header.pulses.antennas.channels;
    if channels
        .iter()
        .any(|channel| channel.calibration != Complex32::ONE)
    {
        let rows = samples.chunks_exact_mut(collection.num_samples);
        for (row, pulse) in rows.zip(&header.pulses.chosen) {
            let calibration = channels[pulse.channel].calibration;
            row.iter_mut().for_each(|z| *z *= calibration);
        }
    }
    InMemory::new(collection, samples).map_err(|error| error.to_string())
}

/// Name of the recording: the given one, or that of its first file.
pub(super) fn name(top: &RecordingDescription, source: &Source) -> String {
    top.name.clone().unwrap_or_else(|| {
        let file = source.file();
        let stem = file.file_stem().unwrap_or(file.as_os_str());
        stem.to_string_lossy().into_owned()
    })
}

fn remove(
    recording: &RecordingKeys,
    pulses: &Pulses,
    width: usize,
    samples: &mut [Complex32],
) -> Result<(), Fault> {
    let (from, to) = (recording.background_first, recording.background_count);
    let stretch = from..to.map_or(u64::MAX, |count| from.saturating_add(count));
    let kind = *recording.background;
    if kind == Background::Keep {
        return Ok(());
    }
    for channel in 0..pulses.antennas.channels.len() {
        // A constant offset differs between antennas.
        let own: Vec<usize> = (0..pulses.chosen.len())
            .filter(|&n| pulses.chosen[n].channel == channel)
            .collect();
        let over: Vec<bool> = own
            .iter()
            .map(|&n| &pulses.chosen[n])
            .map(|pulse| {
                stretch.contains(&(pulse.index as u64))
                    && (kind == Background::Mean || pulse.moving)
            })
            .collect();
        if over.iter().filter(|&&over| over).count() < 2 {
            return Err(recording.background.fault(
                "fewer than two pulses to average: check background_first, background_count \
                 and moving_above",
            ));
        }
        let mut rows: Vec<Complex32> = Vec::with_capacity(own.len() * width);
        for &n in &own {
            rows.extend_from_slice(&samples[n * width..(n + 1) * width]);
        }
        remove_background(&mut rows, width, &over);
        for (row, &n) in rows.chunks_exact(width).zip(&own) {
            samples[n * width..(n + 1) * width].copy_from_slice(row);
        }
    }
    Ok(())
}

/// Range at the middle of the samples' unambiguous extent, bias included, metres.
fn middle_of_window_m(waveform: &Waveform, held: f64) -> f64 {
    let delay_s = match waveform {
        Waveform::Fmcw {
            chirp_hz_s,
            sample_rate_hz,
            mixer_delay_s,
            ..
        } => mixer_delay_s + 0.5 * held * sample_rate_hz / chirp_hz_s.abs(),
        Waveform::Pulsed {
            sample_rate_hz,
            num_samples,
            window_start_s,
            shape,
            ..
        } => window_start_s + 0.5 * (*num_samples as f64 / sample_rate_hz - shape.duration_s()),
        Waveform::Ideal { band } | Waveform::Stepped { band, .. } => 0.5 / band.step_hz,
    };
    0.5 * SPEED_OF_LIGHT_M_S * delay_s
}

/// Ranges of the bins of profiles.
fn profile_axis(
    radar: &RadarKeys,
    source: &Source,
    samples: &Samples,
) -> Result<ProfileAxis, Fault> {
    match (samples.real, &radar.centre_hz) {
        (true, Some(centre)) => {
            return Err(centre.fault("the profiles are real waveforms: remove this key"));
        }
        (false, None) => {
            return Err(radar.kind.fault(
                "the profiles are complex: give 'centre', the frequency that 0 Hz corresponds to",
            ));
        }
        _ => {}
    }
    let steps = (radar.first_range_m, radar.range_step_m);
    let (first_range_m, range_step_m) = match (&radar.ranges, steps) {
        (None, (Some(first), Some(step))) => (first, step),
        (Some(ranges), (None, None)) => even_ranges(ranges, source, samples.num_samples)?,
        (ranges, _) => {
            return Err(Fault::new(
                ranges.as_ref().map_or(&radar.header, Located::at),
                "give either 'ranges', an array, or both 'first_range' and 'range_step'",
            ));
        }
    };
    Ok(ProfileAxis {
        first_range_m,
        range_step_m,
        num_bins: samples.num_samples,
        centre_hz: radar.centre_hz.as_deref().copied(),
    })
}

/// First range and step of an array of ranges, which must be equally spaced within a thousandth of the step.
fn even_ranges(key: &Located<String>, source: &Source, count: usize) -> Result<(f64, f64), Fault> {
    let ranges = source.vector(key)?;
    if ranges.len() != count || count < 2 {
        let what = format!(
            "holds {} ranges for {count} bins: check the array, and [recording] layout, which says what rows and \
             columns of the samples are",
            ranges.len()
        );
        return Err(key.fault(what));
    }
    let step = (ranges[count - 1] - ranges[0]) / (count - 1) as f64;
    let uneven = ranges
        .iter()
        .enumerate()
        .find(|(i, range)| (*range - ranges[0] - *i as f64 * step).abs() > 1e-3 * step.abs());
    match uneven {
        Some((i, range)) => Err(key.fault(format!(
            "bin {i} at {range} m is not equally spaced: resample the profiles"
        ))),
        None if step > 0.0 => Ok((ranges[0], step)),
        None => Err(key.fault("expected ascending ranges")),
    }
}
