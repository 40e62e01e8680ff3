//! From echoes to phase history: what a receiver's samples need before any image former can use them.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `receive`.
//!
//! [`Echoes`] are raw samples with the record of how they were taken, simulated or measured. Adapters
//! on top of them are [`PhaseHistory`](subaperture_model::phase_history::PhaseHistory), read on demand:
//!
//! | waveform | adapter | what it does |
//! |---|---|---|
//! | [`Waveform::Pulsed`] | [`Compressed`] | matched or inverse filter, cut to the band |
//! | [`Waveform::Fmcw`] | [`Deskewed`] | residual video phase and range skew removed |
//! | [`Waveform::Stepped`], [`Waveform::Ideal`] | [`Referenced`] | nothing more |
//! | range profiles, real or complex | [`Profiles`] | spectrum over range, cut to the band |
//!
//! All refer phases to each pulse's reference path, in float64.
//!
//! # Phase of echoes
//! A scatterer of delay `tau` at frequency `f` gives `exp(-j 2 pi f tau)`, absolute: the oscillator
//! that echoes are mixed with starts every pulse with phase 0. For a pulse `p(t)` at baseband sample
//! `i` is `exp(-j 2 pi centre_hz tau) p(t_i - tau)`, `t_i = window_start_s + i / sample_rate_hz`; for a
//! sweep it is as [`Waveform::Fmcw`] says; for carriers sample `k` is `exp(-j 2 pi f_k tau)`.
//!
//! # Motion while a pulse lasts
//! [`Echoes::reference_path_m`] gives the reference path of a sample at its own moment, from the
//! measured track. [`Deskewed`] and [`Referenced`] compensate every sample with it, so that nothing
//! is neglected for a scatterer at the reference point. For others the difference of delay rates
//! stays in the phases, and formers compensate it: the geometry recorded is that of the middle sample, and
//! [`Sweep`] says when the others were taken and how the antennas move from one to the next, by a parabola through
//! the track at three moments of the sweep. Uncompensated, a sweep of rate `chirp` would shift a scatterer's
//! delay by `(rate_p - rate_ref) centre_hz / chirp`, the coupling of range and Doppler: with 1 m/s of difference,
//! 77 GHz and 30 MHz/us 1.3 mm.
//! [`Compressed`] takes a pulse as short: it neglects the Doppler phase over the pulse's length, unless it is told how fast the
//! antennas were ([`Compressed::moving`]).
#![forbid(unsafe_code)]

mod background;
mod compress;
mod deskew;
mod held;
mod profiles;
mod refer;

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Extent, SceneFrame};
use subaperture_model::phase_history::{Collection, InputFile, Pulse, ReadError, Sweep};
use subaperture_model::radar::Waveform;

pub use background::remove_background;
pub use compress::{Compressed, Filter};
pub use deskew::{Deskewed, Skew};
pub use held::Held;
pub use profiles::{ProfileAxis, ProfileError, Profiles};
pub use refer::Referenced;

/// Geometry of one echo, as recorded. Positions in metres in the scene frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EchoPulse {
    /// Time of the pulse, seconds from the collection's start.
    pub time_s: f64,
    /// Phase centre of the transmitting antenna.
    pub transmitter_m: DVec3,
    /// Phase centre of the receiving antenna.
    pub receiver_m: DVec3,
    /// Point to which phases are to be referred.
    pub reference_m: DVec3,
    /// Two-way path to which phases are to be referred.
    pub reference_path_m: f64,
}

/// What a channel of echoes holds beside its samples.
#[derive(Clone, Debug)]
pub struct EchoCollection {
    /// A name for titles and reports.
    pub name: String,
    /// What was transmitted, and how the echo was sampled.
    pub waveform: Waveform,
    /// Every pulse, in the order of its samples.
    pub pulses: Vec<EchoPulse>,
    /// Where the scene frame lies.
    pub frame: SceneFrame,
    /// The part of the scene the collection is meant for, if it says so.
    pub extent: Option<Extent>,
    /// Whether the recording tells times.
    pub timed: bool,
}

/// Raw samples of one pair of antennas, any run of pulses at a time.
pub trait Echoes: Sync + Send {
    /// Geometry and waveform.
    fn collection(&self) -> &EchoCollection;

    /// Reads pulses `pulses` into `samples`, pulse-major,
    /// [`Waveform::num_samples`] each, every value finite.
    ///
    /// # Panics
    /// If the lengths disagree or `pulses.end` is past the last pulse.
    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError>;

    /// Whether the radar moves on while a pulse lasts, so that each sample has antennas and a reference path of its
    /// own.
    fn moves(&self) -> bool {
        false
    }

    /// Two-way reference path of the sample taken `after_s` after the pulse's start, metres, by the
    /// measured track. The default is a radar that stands still while a pulse lasts.
    fn reference_path_m(&self, pulse: usize, _after_s: f64) -> f64 {
        self.collection().pulses[pulse].reference_path_m
    }

    /// Where, by the measured track, the transmitter was when the wave left it and the receiver when the sample
    /// was taken `after_s` after the pulse's start, metres. The default is a radar that stands still while
    /// a pulse lasts.
    fn antennas_m(&self, pulse: usize, _after_s: f64) -> [DVec3; 2] {
        let pulse = &self.collection().pulses[pulse];
        [pulse.transmitter_m, pulse.receiver_m]
    }

    /// Delay of sample 0 after the start of this pulse, seconds, where the waveform is a pulse: the waveform's own, unless the
    /// receiver's windows move from pulse to pulse.
    fn window_start_s(&self, _pulse: usize) -> f64 {
        match self.collection().waveform {
            Waveform::Pulsed { window_start_s, .. } => window_start_s,
            _ => 0.0,
        }
    }

    /// Where transmitter and receiver truly were, as
    /// [`PhaseHistory::true_antennas`](subaperture_model::phase_history::PhaseHistory::true_antennas).
    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        None
    }

    /// Bytes held in memory for as long as this lives.
    fn held_bytes(&self) -> u64 {
        size_of_val(self.collection().pulses.as_slice()) as u64
    }

    /// The files behind the echoes.
    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        Ok(Vec::new())
    }
}

/// Echoes as phase history of `count` frequencies from `start_hz` on, the middle raw sample as sample `count / 2`.
/// `sample_s` is the time from one frequency to the next, seconds.
fn collection_of(
    echoes: &impl Echoes,
    (start_hz, step_hz, count): (f64, f64, usize),
    sample_s: f64,
) -> Collection {
    let from = echoes.collection();
    let pulse = |(n, p): (usize, &EchoPulse)| Pulse {
        time_s: p.time_s,
        transmitter_m: p.transmitter_m,
        receiver_m: p.receiver_m,
        reference_m: p.reference_m,
        reference_path_m: p.reference_path_m,
        start_hz,
        step_hz,
        sweep: sweep_of(echoes, n, count, sample_s),
    };
    Collection {
        name: from.name.clone(),
        num_samples: count,
        pulses: from.pulses.iter().enumerate().map(pulse).collect(),
        frame: from.frame,
        extent: from.extent,
        timed: from.timed,
    }
}

/// How the antennas move from sample to sample of pulse `n`. The parabola through the track at the middle and at
/// `sqrt(3) / 2` of the half sweep before and after (the zeros of Chebyshev's cubic) leaves the least of a cubic.
fn sweep_of(echoes: &impl Echoes, n: usize, count: usize, sample_s: f64) -> Sweep {
    let half_s = 0.75f64.sqrt() * 0.5 * count as f64 * sample_s.abs();
    if !echoes.moves() || half_s == 0.0 {
        return Sweep::AT_ONCE;
    }
    let from = echoes.collection();
    let pulse = &from.pulses[n];
    let middle_s = from.waveform.middle_s();
    let [before, after] = [-half_s, half_s].map(|s| echoes.antennas_m(n, middle_s + s));
    let velocity = |i: usize| (after[i] - before[i]) / (2.0 * half_s);
    let acceleration =
        |i: usize, at_m: DVec3| (after[i] - at_m - (at_m - before[i])) / (half_s * half_s);
    // A path that is the same at both ends and in the middle is one for all samples.
    let followed = [-half_s, half_s]
        .iter()
        .any(|s| echoes.reference_path_m(n, middle_s + s) != pulse.reference_path_m);
    Sweep {
        sample_s,
        transmitter_m_s: velocity(0),
        transmitter_m_s2: acceleration(0, pulse.transmitter_m),
        receiver_m_s: velocity(1),
        receiver_m_s2: acceleration(1, pulse.receiver_m),
        reference_m_s: followed.then_some(DVec3::ZERO),
    }
}

impl EchoPulse {
    /// Delay of `point` after that of the reference path, seconds.
    fn relative_delay_s(&self, point: DVec3) -> f64 {
        let path_m = self.transmitter_m.distance(point) + self.receiver_m.distance(point);
        (path_m - self.reference_path_m) / SPEED_OF_LIGHT_M_S
    }
}

/// Echoes do not suit an adapter.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name}: {what}")]
pub struct ReceiveError {
    /// Name of the collection.
    pub name: String,
    /// What is wrong, and what to do.
    pub what: String,
}

impl ReceiveError {
    fn new(collection: &EchoCollection, what: impl Into<String>) -> Self {
        Self {
            name: collection.name.clone(),
            what: what.into(),
        }
    }
}

/// Bytes of raw samples that an adapter reads at a time, at most, or one pulse.
const BLOCK_BYTES: usize = 4 << 20;

/// Reads `pulses` in blocks and hands raw samples, `raw` a pulse, with the rows they go to, `width` a
/// pulse, and the index of the block's first pulse to `process`.
fn in_blocks(
    echoes: &impl Echoes,
    raw: usize,
    pulses: Range<usize>,
    width: usize,
    samples: &mut [Complex32],
    mut process: impl FnMut(usize, &[Complex32], &mut [Complex32]),
) -> Result<(), ReadError> {
    assert_eq!(
        samples.len(),
        pulses.len() * width,
        "samples must hold {pulses:?} whole"
    );
    let at_once = (BLOCK_BYTES / (8 * raw)).clamp(1, pulses.len().max(1));
    let mut buffer = vec![Complex32::ZERO; at_once * raw];
    for (i, rows) in samples.chunks_mut(at_once * width).enumerate() {
        let first = pulses.start + i * at_once;
        let count = rows.len() / width;
        let buffer = &mut buffer[..count * raw];
        echoes.read(first..first + count, buffer)?;
        process(first, buffer, rows);
    }
    Ok(())
}
