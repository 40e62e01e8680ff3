//! One pair of antennas of an experiment as raw samples.
//!
//! A pulse is made when it is read: the engine's sum over the scene at the waveform's frequencies and
//! times, the pulse's own spectrum where there is a pulse, then what the receiver adds. With the true
//! waveform (the nominal one but for the clock's error) and the true track, sample `k` is
//!
//! | waveform | raw sample | from the engine's sum `G` |
//! |---|---|---|
//! | ideal, stepped | `exp(-j 2 pi f_k tau)` | `G` referred to the reference's delay, and back |
//! | pulsed | `exp(-j 2 pi f_c tau) p(t_k - tau)` | `exp(-j 2 pi f_c t_w) IDFT(P G)`, `G` referred to the window's start `t_w` |
//! | FMCW | as [`Waveform::Fmcw`] | `G` referred to the mixer's delay |
//!
//! for a scatterer of 1 m² at the reference point; a pulse has magnitude 1. The window of a pulse is
//! circular, so all echoes must lie within it: checked for the scene's still parts, refused if not. All
//! frequencies of a pulse see the radar at the middle of its window; the change of path over the pulse is
//! neglected ([`crate::receive`] says how much that is).
//!
//! Transmitters take turns: a pair holds every `num_transmitters`-th pulse, at its own time.
//!
//! With [`Motion::True`] what is recorded as a pulse's geometry is that of its middle sample: the receiver
//! then, the transmitter a reference delay sooner, and the sample's time as the pulse's. Between the
//! middle and other samples the measured track says the reference path.
//!
//! Cost beside the engine's: an FFT a pulse. Memory: 200 bytes a pulse, the scene, and a row a thread.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};

use super::body::Trajectory;
use super::engine::{Engine, Scratch, Sweep, View};
use super::experiment::{Experiment, Pair, Reference};
use super::radar::{Antenna, Motion, Waveform};
use super::receiver::clock::jitter_s;
use super::receiver::{Impairments, Moment};
use super::recording::RecordError;
use crate::SPEED_OF_LIGHT_M_S;
use crate::phase_history::ReadError;
use crate::receive::{EchoCollection, EchoPulse, Echoes};
use crate::signal::phase::{narrow, phasor};

/// Raw samples of a pair, made when read.
pub struct Channel<'a> {
    experiment: &'a Experiment,
    pair: Pair,
    engine: Engine,
    /// What is truly transmitted and sampled.
    waveform: Waveform,
    /// The record: the nominal waveform and the measured track.
    collection: EchoCollection,
    true_antennas: Vec<[DVec3; 2]>,
    /// Range at which amplitudes are 1, metres.
    reference_range_m: f64,
    impairments: Impairments,
    pulsed: Option<Pulsed>,
    /// Saturated samples of each pulse as last read.
    saturated: Vec<AtomicU32>,
}

/// What a pulse's echo takes.
struct Pulsed {
    /// Its spectrum, frequencies rising from `-floor(N / 2)` steps, over `N`.
    spectrum: Vec<Complex64>,
    inverse: Arc<dyn Fft<f64>>,
}

/// Where antennas are when a wave is received, and the reference.
struct Sight {
    antennas_m: [DVec3; 2],
    reference_m: DVec3,
    reference_path_m: f64,
}

/// Rounds of the delay between transmission and reception; each shrinks its error by `v / c`.
const DELAY_ROUNDS: usize = 4;

impl<'a> Channel<'a> {
    pub(super) fn new(experiment: &'a Experiment, pair: Pair) -> Result<Self, RecordError> {
        let radar = &experiment.radar;
        let num_transmitters = radar.transmitters.len();
        let (Some(transmitter), Some(receiver)) = (
            radar.transmitters.get(pair.transmitter),
            radar.receivers.get(pair.receiver),
        ) else {
            return Err(RecordError::new(
                experiment,
                format!("the radar has no {pair:?}"),
            ));
        };
        let fault = |what: String| RecordError::new(experiment, what);
        check(experiment).map_err(fault)?;
        let clock = radar.receiver.clock.unwrap_or_default();
        let waveform = radar.waveform.with_clock_offset(clock.offset);
        let measured = experiment.measured.as_ref().unwrap_or(&experiment.track);

        let indices = (pair.transmitter..radar.num_pulses).step_by(num_transmitters);
        let times_s: Vec<f64> = indices
            .map(|n| radar.start_s + n as f64 * radar.pri_s)
            .collect();
        if times_s.is_empty() {
            let what = format!(
                "{} pulses give transmitter {} none",
                radar.num_pulses, pair.transmitter
            );
            return Err(fault(what));
        }
        let sight = |body: &dyn Trajectory, waveform: &Waveform, pulse_s: f64| {
            let after_s = moving(radar.motion).then(|| waveform.middle_s());
            let time_s = pulse_s + after_s.unwrap_or(0.0);
            (
                time_s,
                look(experiment, body, transmitter, receiver, time_s),
            )
        };
        let pulses = times_s.par_iter().map(|&pulse_s| {
            let (time_s, seen) = sight(measured.as_ref(), &radar.waveform, pulse_s);
            EchoPulse {
                time_s,
                transmitter_m: seen.antennas_m[0],
                receiver_m: seen.antennas_m[1],
                reference_m: seen.reference_m,
                reference_path_m: seen.reference_path_m,
            }
        });
        let collection = EchoCollection {
            name: match experiment.pairs().len() {
                1 => experiment.name.clone(),
                _ => format!("{} {}-{}", experiment.name, transmitter.name, receiver.name),
            },
            waveform: radar.waveform.clone(),
            pulses: pulses.collect(),
            frame: experiment.frame,
            extent: experiment.extent,
            timed: true,
        };
        let true_antennas: Vec<[DVec3; 2]> = times_s
            .par_iter()
            .map(|&pulse_s| {
                let pulse_s = pulse_s / (1.0 + clock.offset);
                sight(experiment.track.as_ref(), &waveform, pulse_s)
                    .1
                    .antennas_m
            })
            .collect();
        let origin_m = match experiment.reference {
            Reference::Point(point_m) => point_m,
            Reference::Range(_) => DVec3::ZERO,
        };
        let [transmit_m, receive_m] =
            true_antennas[true_antennas.len() / 2].map(|antenna| antenna.distance(origin_m));
        let reference_range_m = (transmit_m * receive_m).sqrt();
        if reference_range_m < 1e-3 {
            return Err(fault("the radar is at its own reference point".to_owned()));
        }
        Ok(Self {
            engine: Engine::new(&experiment.scene, experiment.method),
            pulsed: Pulsed::new(experiment, &true_antennas).map_err(fault)?,
            impairments: Impairments::new(experiment, reference_range_m).map_err(fault)?,
            saturated: times_s.iter().map(|_| AtomicU32::new(0)).collect(),
            experiment,
            pair,
            waveform,
            collection,
            true_antennas,
            reference_range_m,
        })
    }

    /// Samples of the pulses read so far of which I or Q saturated the converter.
    pub fn saturated_samples(&self) -> u64 {
        let counts = self.saturated.iter();
        counts.map(|c| u64::from(c.load(Ordering::Relaxed))).sum()
    }

    fn antennas(&self) -> (&'a Antenna, &'a Antenna) {
        let radar = &self.experiment.radar;
        (
            &radar.transmitters[self.pair.transmitter],
            &radar.receivers[self.pair.receiver],
        )
    }

    /// Index among the pulses of all transmitters.
    fn index(&self, pulse: usize) -> usize {
        self.pair.transmitter + pulse * self.experiment.radar.transmitters.len()
    }

    fn nominal_s(&self, pulse: usize) -> f64 {
        let radar = &self.experiment.radar;
        radar.start_s + self.index(pulse) as f64 * radar.pri_s
    }

    /// Makes pulse `n` into `samples`; `work` is the transform's.
    fn pulse(
        &self,
        n: usize,
        scratch: &mut Scratch,
        work: &mut Vec<Complex64>,
        samples: &mut [Complex64],
    ) {
        let radar = &self.experiment.radar;
        let clock = radar.receiver.clock.unwrap_or_default();
        let late_s = jitter_s(&clock, self.experiment.seed, self.index(n));
        let time_s = self.nominal_s(n) / (1.0 + clock.offset);
        let delay_s = self.collection.pulses[n].reference_path_m / SPEED_OF_LIGHT_M_S;
        let (sweep, reference_s) = sweep(&self.waveform, delay_s, late_s);
        let (transmitter, receiver) = self.antennas();
        let view = View {
            body: self.experiment.track.as_ref(),
            transmitter,
            receiver,
            time_s,
            sweep,
            reference_s,
            motion: radar.motion,
            spreading_from_m: radar.spreading.then_some(self.reference_range_m),
        };
        self.engine.pulse(&view, scratch, samples);
        match (&self.waveform, &self.pulsed) {
            (Waveform::Ideal { .. } | Waveform::Stepped { .. }, _) => {
                let jitter_s = match self.waveform {
                    Waveform::Ideal { .. } => late_s,
                    _ => 0.0,
                };
                let centre_hz = self.waveform.centre_hz();
                for (k, z) in samples.iter_mut().enumerate() {
                    let frequency_hz = sweep.start_hz + k as f64 * sweep.step_hz;
                    let jitter = (frequency_hz - centre_hz) * jitter_s;
                    *z *= phasor(jitter - frequency_hz * reference_s);
                }
            }
            (Waveform::Pulsed { centre_hz, .. }, Some(pulsed)) => {
                pulsed.transmit(centre_hz * reference_s, work, samples);
            }
            _ => {}
        }
        let moment = Moment {
            waveform: &self.waveform,
            pulse: self.index(n),
            receiver: self.pair.receiver,
            time_s,
            delay_s,
        };
        let saturated = self.impairments.apply(&moment, samples);
        self.saturated[n].store(saturated, Ordering::Relaxed);
    }
}

impl Echoes for Channel<'_> {
    fn collection(&self) -> &EchoCollection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let width = self.waveform.num_samples();
        assert_eq!(
            samples.len(),
            pulses.len() * width,
            "samples must hold {pulses:?} whole"
        );
        let first = pulses.start;
        samples
            .par_chunks_exact_mut(width)
            .zip(pulses)
            .for_each_init(
                || (Scratch::default(), Vec::new(), vec![Complex64::ZERO; width]),
                |(scratch, work, sums), (row, n)| {
                    self.pulse(n, scratch, work, sums);
                    for (out, z) in row.iter_mut().zip(sums) {
                        *out = narrow(*z);
                    }
                },
            );
        // A scatterer on an antenna with spreading, or amplitudes beyond float32.
        match samples.iter().position(|z| !z.is_finite()) {
            None => Ok(()),
            Some(i) => Err(ReadError::NotFinite {
                name: self.collection.name.clone(),
                pulse: first + i / width,
                sample: i % width,
            }),
        }
    }

    fn reference_path_m(&self, pulse: usize, after_s: f64) -> f64 {
        let experiment = self.experiment;
        match (experiment.radar.motion, experiment.reference) {
            (Motion::True, Reference::Point(_)) => {
                let measured = experiment.measured.as_ref().unwrap_or(&experiment.track);
                let (transmitter, receiver) = self.antennas();
                let time_s = self.nominal_s(pulse) + after_s;
                look(experiment, measured.as_ref(), transmitter, receiver, time_s).reference_path_m
            }
            _ => self.collection.pulses[pulse].reference_path_m,
        }
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        Some(&self.true_antennas)
    }

    fn held_bytes(&self) -> u64 {
        let scene = &self.experiment.scene;
        let held = size_of_val(self.collection.pulses.as_slice())
            + size_of_val(self.true_antennas.as_slice())
            + size_of_val(self.saturated.as_slice())
            + size_of_val(scene.points.as_slice());
        held as u64 + self.engine.held_bytes()
    }
}

impl Pulsed {
    /// `None` for waveforms without a pulse. The text of an error says what does not fit.
    fn new(experiment: &Experiment, antennas: &[[DVec3; 2]]) -> Result<Option<Self>, String> {
        let Waveform::Pulsed {
            sample_rate_hz,
            num_samples,
            window_start_s,
            ref shape,
            ..
        } = experiment.radar.waveform
        else {
            return Ok(None);
        };
        if let Some((least_s, most_s)) = delays(experiment, antennas) {
            let end_s = window_start_s + num_samples as f64 / sample_rate_hz;
            if least_s < window_start_s || most_s + shape.duration_s() > end_s {
                return Err(format!(
                    "echoes of the scene come from {least_s:.9} to {:.9} s after a pulse begins, the \
                     last of it included, and the window is open from {window_start_s:.9} to \
                     {end_s:.9} s: open it sooner or keep it open longer (num_samples)",
                    most_s + shape.duration_s()
                ));
            }
        }
        let mut spectrum = shape.spectrum(sample_rate_hz, num_samples);
        spectrum.rotate_right(num_samples / 2);
        for p in &mut spectrum {
            *p /= num_samples as f64;
        }
        Ok(Some(Self {
            spectrum,
            inverse: FftPlanner::new().plan_fft_inverse(num_samples),
        }))
    }

    /// From sums over the scene to an echo, the oscillator's phase at the window's start being
    /// `turns`.
    fn transmit(&self, turns: f64, work: &mut Vec<Complex64>, samples: &mut [Complex64]) {
        let start = phasor(-turns);
        for (z, p) in samples.iter_mut().zip(&self.spectrum) {
            *z *= p * start;
        }
        samples.rotate_left(samples.len() / 2);
        work.resize(self.inverse.get_inplace_scratch_len(), Complex64::ZERO);
        self.inverse.process_with_scratch(samples, work);
    }
}

/// The engine's sweep of a waveform sampled `late_s` late, and the delay that counts as zero; `delay_s` is
/// the reference's.
fn sweep(waveform: &Waveform, delay_s: f64, late_s: f64) -> (Sweep, f64) {
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

fn moving(motion: Motion) -> bool {
    motion == Motion::True
}

/// Antennas and reference of a wave received at `time_s`.
fn look(
    experiment: &Experiment,
    body: &dyn Trajectory,
    transmitter: &Antenna,
    receiver: &Antenna,
    time_s: f64,
) -> Sight {
    let pose = body.pose(time_s);
    let receiver_m = pose.point_m(receiver.offset_m);
    let moves = moving(experiment.radar.motion);
    match experiment.reference {
        Reference::Point(reference_m) => {
            let mut transmitter_m = pose.point_m(transmitter.offset_m);
            let path_m = |transmitter_m: DVec3| {
                transmitter_m.distance(reference_m) + receiver_m.distance(reference_m)
            };
            for _ in 0..if moves { DELAY_ROUNDS } else { 0 } {
                let sent_s = time_s - path_m(transmitter_m) / SPEED_OF_LIGHT_M_S;
                transmitter_m = body.pose(sent_s).point_m(transmitter.offset_m);
            }
            Sight {
                antennas_m: [transmitter_m, receiver_m],
                reference_m,
                reference_path_m: path_m(transmitter_m),
            }
        }
        Reference::Range(range_m) => {
            let sent_s = time_s
                - if moves {
                    2.0 * range_m / SPEED_OF_LIGHT_M_S
                } else {
                    0.0
                };
            let transmitter_m = body.pose(sent_s).point_m(transmitter.offset_m);
            let ahead = pose.attitude * transmitter.boresight;
            Sight {
                antennas_m: [transmitter_m, receiver_m],
                reference_m: 0.5 * (transmitter_m + receiver_m) + ahead * range_m,
                reference_path_m: 2.0 * range_m,
            }
        }
    }
}

/// Smallest and largest delay of the scene's still parts and its reference point, seconds.
fn delays(experiment: &Experiment, antennas: &[[DVec3; 2]]) -> Option<(f64, f64)> {
    let scene = &experiment.scene;
    let points = scene.points.iter().map(|p| p.position_m);
    let corners = scene.corners.iter().map(|c| c.position_m);
    let all = points.chain(corners).map(|p| (p, p));
    let (low, high) = all.reduce(|(low, high), (p, q)| (low.min(p), high.max(q)))?;
    let of_pulse = |&[transmitter_m, receiver_m]: &[DVec3; 2]| {
        let delay_s =
            |p: DVec3| (p.distance(transmitter_m) + p.distance(receiver_m)) / SPEED_OF_LIGHT_M_S;
        // Delays are convex: largest at a corner of the box. Least near the box's point nearest to the
        // antennas, less than what these are apart.
        let corner = |i: usize| {
            let pick = |bit: usize, a: f64, b: f64| if i >> bit & 1 == 0 { a } else { b };
            DVec3::new(
                pick(0, low.x, high.x),
                pick(1, low.y, high.y),
                pick(2, low.z, high.z),
            )
        };
        let most_s = (0..8).map(|i| delay_s(corner(i))).fold(0.0, f64::max);
        let nearest = |antenna_m: DVec3| antenna_m.clamp(low, high).distance(antenna_m);
        let least_s = (nearest(transmitter_m) + nearest(receiver_m)) / SPEED_OF_LIGHT_M_S;
        (least_s, most_s)
    };
    let ranges = antennas.iter().map(of_pulse);
    ranges.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// What no sum can be made of. The text says what is wrong.
fn check(experiment: &Experiment) -> Result<(), String> {
    let radar = &experiment.radar;
    let positive = |x: f64| x.is_finite() && x > 0.0;
    if !positive(radar.pri_s) || !radar.start_s.is_finite() {
        return Err(format!(
            "a pulse repetition interval of {} s and a start at {} s: the first must be positive",
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
            "{:?}: frequencies, rates and lengths must be positive, and there must be samples",
            radar.waveform
        ));
    }
    Ok(())
}
