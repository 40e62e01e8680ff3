//! Conversion of radar echoes into phase history, the input of image formers: pulse compression, deskew of FMCW sweeps,
//! referencing.
//!
//! [`Echoes`] are raw samples with a description of their acquisition, simulated or measured. Adapters convert them to
//! [`PhaseHistory`](subaperture_model::phase_history::PhaseHistory), which is computed when read:
//!
//! | waveform | adapter | processing |
//! |---|---|---|
//! | [`Waveform::Pulsed`] | [`Compressed`] | matched or inverse filter, limited to the band |
//! | [`Waveform::Fmcw`] | [`Deskewed`] | removal of residual video phase and range skew |
//! | [`Waveform::Stepped`], [`Waveform::Ideal`] | [`Referenced`] | referencing only |
//! | range profiles, real or complex | [`Profiles`] | spectrum over range, limited to the band |
//!
//! All of them reference phases to each pulse's reference path (motion compensation), in float64.
//!
//! # Phase of echoes
//! A scatterer with delay `tau` has the absolute phase `exp(-j 2 pi f tau)` at frequency `f`: the oscillator with which
//! echoes are mixed starts every pulse with phase 0. For a baseband pulse `p(t)`, sample `i` is `exp(-j 2 pi centre_hz
//! tau) p(t_i - tau)` with `t_i = window_start_s + i / sample_rate_hz`. For an FMCW sweep see [`Waveform::Fmcw`]. For
//! stepped carriers, sample `k` is `exp(-j 2 pi f_k tau)`.
//!
//! # Intra-pulse motion
//! [`Echoes::reference_path_m`] is the reference path of a sample at its own time, according to the measured track.
//! [`Deskewed`] and [`Referenced`] compensate every sample with it, so that nothing is neglected for a scatterer at the
//! reference point. For other scatterers the difference of delay rates remains in the phases, and image formers
//! compensate it: the recorded geometry is that of the middle sample, and [`Sweep`] describes the times of the other
//! samples and the antennas' motion between them, by a parabola through the track at three times of the sweep. Without
//! compensation, range-Doppler coupling shifts a scatterer's delay by `(rate_p - rate_ref) centre_hz / chirp`: 1.3 mm
//! for a difference of 1 m/s, 77 GHz and 30 MHz/us. [`Compressed`] treats pulses as short: it neglects the Doppler
//! phase over the pulse unless the antennas' velocities are given ([`Compressed::moving`]).

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
pub use held::StoredEchoes;
pub use profiles::{ProfileAxis, ProfileError, Profiles};
pub use refer::Referenced;

/// Recorded geometry of one echo. Positions are in metres in the scene frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EchoPulse {
    /// Time of the pulse, seconds from the collection's start.
    pub time_s: f64,
    /// Phase centre of the transmit antenna, metres.
    pub transmitter_m: DVec3,
    /// Phase centre of the receive antenna, metres.
    pub receiver_m: DVec3,
    /// Motion compensation reference point, metres.
    pub reference_m: DVec3,
    /// Two-way reference path, metres.
    pub reference_path_m: f64,
}

/// Description of a channel of echoes.
#[derive(Clone, Debug)]
pub struct EchoCollection {
    /// Name, for titles and reports.
    pub name: String,
    /// Transmitted waveform, and sampling of the echo.
    pub waveform: Waveform,
    /// Pulses in the order of their samples.
    pub pulses: Vec<EchoPulse>,
    /// Position of the scene frame on the Earth.
    pub frame: SceneFrame,
    /// Extent of the scene to be imaged; `None` if unknown.
    pub extent: Option<Extent>,
    /// Whether the recording contains pulse times.
    pub timed: bool,
}

/// Raw samples of an antenna pair, read by ranges of pulses.
pub trait Echoes: Sync + Send {
    /// Geometry and waveform.
    fn collection(&self) -> &EchoCollection;

    /// Read the pulses `pulses` into `samples`, pulse-major, with [`Waveform::num_samples`] samples each. All values
    /// are finite.
    ///
    /// # Panics
    /// Panics if the lengths disagree or `pulses.end` is beyond the last pulse.
    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError>;

    /// Whether the radar moves during a pulse, so that each sample has its own antenna positions and reference path.
    fn moves(&self) -> bool {
        false
    }

    /// Two-way reference path of the sample taken `after_s` after the pulse's start, metres, according to the measured
    /// track. Default: stop-and-go, the path of the pulse.
    fn reference_path_m(&self, pulse: usize, _after_s: f64) -> f64 {
        self.collection().pulses[pulse].reference_path_m
    }

    /// Positions, according to the measured track, of the transmitter when the wave was transmitted and of the receiver
    /// when the sample was taken `after_s` after the pulse's start, metres. Default: stop-and-go, the positions of the
    /// pulse.
    fn antennas_m(&self, pulse: usize, _after_s: f64) -> [DVec3; 2] {
        let pulse = &self.collection().pulses[pulse];
        [pulse.transmitter_m, pulse.receiver_m]
    }

    /// Delay of sample 0 after the start of this pulse, seconds, for pulsed waveforms: that of the waveform, unless the
    /// receive window changes from pulse to pulse.
    fn window_start_s(&self, _pulse: usize) -> f64 {
        match self.collection().waveform {
            Waveform::Pulsed { window_start_s, .. } => window_start_s,
            _ => 0.0,
        }
    }

    /// True antenna positions, as in
    /// [`PhaseHistory::true_antennas`](subaperture_model::phase_history::PhaseHistory::true_antennas).
    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        None
    }

    /// Memory held for the lifetime of this value, bytes.
    fn held_bytes(&self) -> u64 {
        size_of_val(self.collection().pulses.as_slice()) as u64
    }

    /// Files from which the echoes are read.
    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        Ok(Vec::new())
    }
}

/// Phase history description of echoes with `count` frequencies from `start_hz` on; the middle raw sample is sample
/// `count / 2`. `sample_s` is the time from one frequency to the next, seconds.
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
        recorded_path_m: None,
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

/// Intra-pulse motion of the antennas in pulse `n`. The parabola passes through the track at the middle and at `sqrt(3)
/// / 2` of the half sweep before and after it (the zeros of the cubic Chebyshev polynomial), which minimises the error
/// of a cubic.
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
    // A path that is equal at both ends and in the middle is constant for all samples.
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
    /// Delay of `point` relative to the reference path, seconds.
    fn relative_delay_s(&self, point: DVec3) -> f64 {
        let path_m = self.transmitter_m.distance(point) + self.receiver_m.distance(point);
        (path_m - self.reference_path_m) / SPEED_OF_LIGHT_M_S
    }
}

/// Echoes that an adapter cannot process.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name}: {what}")]
pub struct ReceiveError {
    /// Name of the collection.
    pub name: String,
    /// Fault, and what to change.
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

/// Bytes of raw samples that an adapter reads at a time, unless a single pulse is larger.
const BLOCK_BYTES: usize = 4 << 20;

/// Read `pulses` in blocks, and call `process` with the index of the block's first pulse, the raw samples (`raw` per
/// pulse), and the output rows (`width` per pulse).
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
