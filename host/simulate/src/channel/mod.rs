//! Raw samples of an antenna pair of an experiment.
//!
//! A pulse is computed when read: the engine's sum over the scene at the waveform's frequencies and times, the pulse's
//! spectrum for pulsed waveforms, then the effects of the receiver. With the true waveform (the nominal one with the
//! clock's error) and the true track, sample `k` is
//!
//! | waveform | raw sample | from the engine's sum `G` |
//! |---|---|---|
//! | ideal, stepped | `exp(-j 2 pi f_k tau)` | `G` relative to the reference's delay, and back |
//! | pulsed | `exp(-j 2 pi f_c tau) p(t_k - tau)` | `exp(-j 2 pi f_c t_w) IDFT(P G)`, `G` relative to the window's start `t_w` |
//! | FMCW | as [`Waveform::Fmcw`] | `G` relative to the mixer's delay |
//!
//! for a scatterer of 1 m² at the reference point; a pulse has magnitude 1. The receive window of a pulse is circular,
//! so that all echoes must lie within it; this is checked for the static scene. All frequencies of a pulse use the
//! radar's position at the middle of the window; the change of path during the pulse is neglected (see
//! [`subaperture_io::receive`] for its size).
//!
//! Transmitters alternate: a pair contains every `num_transmitters`-th pulse, at its own time.
//!
//! With [`Motion::True`], the recorded geometry of a pulse is that of its middle sample: the receiver at that time, the
//! transmitter one reference delay earlier, and the sample's time as the pulse's time. The measured track gives the
//! reference path of the other samples.
//!
//! Cost beyond the engine's: one FFT per pulse. Memory: 200 bytes per pulse, the scene, the engine's tables (at most
//! 256 MiB), and one row per thread.

mod check;
mod pulsed;
mod sight;
mod sweep;

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use self::check::check;
use self::pulsed::Pulsed;
use self::sight::{Eye, Sight, look, moving};
use self::sweep::sweep;
use super::engine::{Engine, Method, Scratch, View};
use super::experiment::{Experiment, Pair};
use super::receiver::clock::jitter_s;
use super::receiver::{Impairments, Moment};
use super::record_error::RecordError;
use subaperture_io::receive::{EchoCollection, EchoPulse, Echoes};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::ReadError;
use subaperture_model::radar::{Antenna, Motion, MountedAntennas, Reference, Waveform};
use subaperture_signal::phase::{narrow, phasor};

/// Memory limit of the tables reused between pulses, bytes.
const TABLE_BYTES: u64 = 256 << 20;

/// Raw samples of an antenna pair, computed when read.
pub struct Channel<'a> {
    experiment: &'a Experiment,
    pair: Pair,
    engine: Engine<'a>,
    /// Waveform actually transmitted and sampled, with the clock's error.
    waveform: Waveform,
    /// Recorded description: nominal waveform and measured track.
    collection: EchoCollection,
    true_antennas: Vec<[DVec3; 2]>,
    /// Range at which amplitudes are 1, metres.
    reference_range_m: f64,
    impairments: Impairments,
    pulsed: Option<Pulsed>,
    /// Number of saturated samples of each pulse, as last read.
    saturated: Vec<AtomicU32>,
}

/// Range of the reference point at the middle pulse, metres, at which amplitudes are 1.
fn reference_range_m(experiment: &Experiment, true_antennas: &[[DVec3; 2]]) -> Result<f64, String> {
    let origin_m = match experiment.reference {
        Reference::Point(point_m) => point_m,
        Reference::Range(_) => DVec3::ZERO,
    };
    let [transmit_m, receive_m] =
        true_antennas[true_antennas.len() / 2].map(|antenna| antenna.distance(origin_m));
    let reference_range_m = (transmit_m * receive_m).sqrt();
    if reference_range_m < 1e-3 {
        return Err("the radar is at the scene's reference point: move scene.reference".to_owned());
    }
    Ok(reference_range_m)
}

impl<'a> Channel<'a> {
    pub(super) fn new(
        experiment: &'a Experiment,
        pair: Pair,
        table_bytes: u64,
    ) -> Result<Self, RecordError> {
        let radar = &experiment.radar;
        let num_transmitters = radar.transmitters.len();
        let (Some(transmitter), Some(receiver)) = (
            radar.transmitters.get(pair.transmitter),
            radar.receivers.get(pair.receiver),
        ) else {
            return Err(RecordError::new(
                experiment,
                format!("unknown antenna pair {pair:?}"),
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
                "{} pulses leave transmitter {} without a pulse: expected at least one pulse per transmitter",
                radar.num_pulses, pair.transmitter
            );
            return Err(fault(what));
        }
        let eye = Eye {
            experiment,
            transmitter,
            receiver,
        };
        let pulses = times_s.par_iter().map(|&pulse_s| {
            let time_s = eye.seen_at_s(&radar.waveform, pulse_s);
            let seen = eye.look(measured.as_ref(), time_s);
            EchoPulse {
                time_s,
                transmitter_m: seen.antennas_m[0],
                receiver_m: seen.antennas_m[1],
                reference_m: seen.reference_m,
                reference_path_m: seen.reference_path_m,
            }
        });
        let collection = EchoCollection {
            name: eye.name(),
            waveform: radar.waveform.clone(),
            pulses: pulses.collect(),
            frame: experiment.frame,
            extent: experiment.extent,
            timed: true,
        };
        let true_antennas: Vec<[DVec3; 2]> = times_s
            .par_iter()
            .map(|&pulse_s| {
                let time_s = eye.seen_at_s(&waveform, pulse_s / (1.0 + clock.offset));
                eye.look(experiment.track.as_ref(), time_s).antennas_m
            })
            .collect();
        let reference_range_m = reference_range_m(experiment, &true_antennas).map_err(fault)?;
        let mut channel = Self {
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
        };
        channel.recycle(table_bytes.min(TABLE_BYTES));
        Ok(channel)
    }

    /// Set up tables reused between pulses, if track and scene allow.
    fn recycle(&mut self, table_bytes: u64) {
        let experiment = self.experiment;
        if experiment.method == Method::Sum || moving(experiment.radar.motion) {
            return;
        }
        let views: Vec<View> = (0..self.collection.pulses.len())
            .map(|n| self.view(n))
            .collect();
        self.engine.prepare(&views, table_bytes);
    }

    /// Number of samples of the pulses read so far whose I or Q saturated the converter.
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

    /// The antennas of the pair with their attitudes by the measured track.
    pub fn carried(&self) -> MountedAntennas {
        let experiment = self.experiment;
        let measured = experiment.measured.as_ref().unwrap_or(&experiment.track);
        let (transmitter, receiver) = self.antennas();
        let attitude = |pulse: &EchoPulse| [measured.pose(pulse.time_s).attitude; 2];
        MountedAntennas {
            antennas: [transmitter.clone(), receiver.clone()],
            attitudes: self.collection.pulses.iter().map(attitude).collect(),
        }
    }

    /// Index among the pulses of all transmitters.
    fn index(&self, pulse: usize) -> usize {
        self.pair.transmitter + pulse * self.experiment.radar.transmitters.len()
    }

    fn nominal_s(&self, pulse: usize) -> f64 {
        let radar = &self.experiment.radar;
        radar.start_s + self.index(pulse) as f64 * radar.pri_s
    }

    /// Sampling delay of a pulse due to clock jitter, seconds.
    fn late_s(&self, n: usize) -> f64 {
        let clock = self.experiment.radar.receiver.clock.unwrap_or_default();
        jitter_s(&clock, self.experiment.seed, self.index(n))
    }

    fn delay_s(&self, n: usize) -> f64 {
        self.collection.pulses[n].reference_path_m / SPEED_OF_LIGHT_M_S
    }

    /// Antennas and reference `after_s` seconds after the start of pulse `n`, according to the measured track.
    fn measured(&self, n: usize, after_s: f64) -> Sight {
        let experiment = self.experiment;
        let measured = experiment.measured.as_ref().unwrap_or(&experiment.track);
        let (transmitter, receiver) = self.antennas();
        let time_s = self.nominal_s(n) + after_s;
        look(experiment, measured.as_ref(), transmitter, receiver, time_s)
    }

    /// View of pulse `n` for the engine.
    fn view(&self, n: usize) -> View<'a> {
        let radar = &self.experiment.radar;
        let clock = radar.receiver.clock.unwrap_or_default();
        let (sweep, reference_s) = sweep(&self.waveform, self.delay_s(n), self.late_s(n));
        let (transmitter, receiver) = self.antennas();
        View {
            body: self.experiment.track.as_ref(),
            transmitter,
            receiver,
            time_s: self.nominal_s(n) / (1.0 + clock.offset),
            sweep,
            reference_s,
            motion: radar.motion,
            spreading_from_m: radar.spreading.then_some(self.reference_range_m),
        }
    }

    /// Compute pulse `n` into `samples`; `work` is scratch memory of the FFT.
    fn pulse(
        &self,
        n: usize,
        scratch: &mut Scratch,
        work: &mut Vec<Complex64>,
        samples: &mut [Complex64],
    ) {
        let view = self.view(n);
        let (sweep, reference_s, time_s) = (view.sweep, view.reference_s, view.time_s);
        self.engine.pulse(&view, scratch, samples);
        match (&self.waveform, &self.pulsed) {
            (Waveform::Ideal { .. } | Waveform::Stepped { .. }, _) => {
                let jitter_s = match self.waveform {
                    Waveform::Ideal { .. } => self.late_s(n),
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
            delay_s: self.delay_s(n),
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
        // A scatterer at an antenna's position with spreading loss, or an overflow of float32.
        match samples.iter().position(|z| !z.is_finite()) {
            None => Ok(()),
            Some(i) => Err(ReadError::NotFinite {
                name: self.collection.name.clone(),
                pulse: first + i / width,
                sample: i % width,
            }),
        }
    }

    fn moves(&self) -> bool {
        moving(self.experiment.radar.motion)
    }

    fn reference_path_m(&self, pulse: usize, after_s: f64) -> f64 {
        let experiment = self.experiment;
        let middle = &self.collection.pulses[pulse];
        match (experiment.radar.motion, experiment.reference) {
            (Motion::StopAndGo, _) => middle.reference_path_m,
            (Motion::True, Reference::Point(_)) => self.measured(pulse, after_s).reference_path_m,
            // The reference point at that range at the middle of the pulse is fixed during the pulse.
            (Motion::True, Reference::Range(_)) => {
                let by_way_of = |antennas_m: [DVec3; 2]| -> f64 {
                    let legs = antennas_m.map(|antenna_m| antenna_m.distance(middle.reference_m));
                    legs.iter().sum()
                };
                let drift_m = by_way_of(self.measured(pulse, after_s).antennas_m)
                    - by_way_of([middle.transmitter_m, middle.receiver_m]);
                middle.reference_path_m + drift_m
            }
        }
    }

    fn antennas_m(&self, pulse: usize, after_s: f64) -> [DVec3; 2] {
        match self.experiment.radar.motion {
            Motion::True => self.measured(pulse, after_s).antennas_m,
            Motion::StopAndGo => {
                let pulse = &self.collection.pulses[pulse];
                [pulse.transmitter_m, pulse.receiver_m]
            }
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
            + size_of_val(scene.points.as_slice())
            + size_of_val(scene.moving_points.as_slice())
            + size_of_val(scene.facets.as_slice());
        let shadow = scene.terrain_shadow.as_ref();
        held as u64 + shadow.map_or(0, |shadow| shadow.held_bytes()) + self.engine.held_bytes()
    }
}
