//! Channel balance from clutter: gain, phase and delay of each channel against the first.
//!
//! Pulses at the same along-track position ([`Alignment`]), compensated to a point of the scene, differ between channels only by the
//! receivers. With the cross-spectrum over pairs of such pulses
//!
//! ```text
//! C_c[k] = sum_n z_c[m(n)][k] conj(z_0[n][k]),
//! ```
//!
//! the delay `tau` maximises `|sum_k C_c[k] exp(+j 2 pi (f_k - f_ref) tau)|`, and the phase is that of the sum at its maximum. `f_ref` is the
//! frequency of sample `K/2`. The largest delay that is found is half the period `1 / step` of range profiles.
//!
//! Gain and coherence are computed for each range bin `r` of the pulses' range profiles,
//!
//! ```text
//! gain_r = sqrt(P_c[r] / P_0[r]),   coherence_r = sum_segments |C_c[r]| / sqrt(P_c[r] P_0[r]),
//! ```
//!
//! over segments of the track, in which a wrong baseline changes the phase little. Their median over the stronger half of the bins is used, so that
//! bright moving targets in a few bins do not determine it. The effect of targets on the phase is removed from the images ([`crate::registration`]).
//! Half a pulse of misalignment and noise reduce the coherence. A dead channel, one of another scene and exchanged channels are refused by name.

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use subaperture_fft::Fft;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{
    Band, Beam, Channels, Collection, NoBeam, PhaseHistory, Pulse, ReadError,
};

use crate::adaptive::widen;
use crate::alignment::Alignment;
use crate::error::GmtiError;
use crate::registration::median;
use crate::turns::{RECURRENCE, rotate};

/// Smallest accepted coherence of a channel with the first.
pub const MIN_COHERENCE: f64 = 0.25;

/// Factor of the coherence with exchanged positions on the stated one, from which channels are refused as exchanged.
const EXCHANGED: f64 = 1.25;

/// Number of segments of the track, and smallest number of pulses of a segment: unrelated channels have a coherence of 0.11 there.
const SEGMENTS: usize = 8;
const SEGMENT_PULSES: usize = 64;

/// Largest number of pulses that are compared, the first of each segment: with the bins of a range profile they determine the phase to some 1e-4 radians.
const MAX_PULSES: usize = 1040;

/// Samples of a channel read at a time.
const BLOCK_SAMPLES: usize = 1 << 20;

/// Grid points of the delay search per `1 / bandwidth`.
const DELAYS_A_CELL: usize = 4;

/// Difference of a channel from the first one.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ChannelBalance {
    /// Amplitude relative to channel 0.
    pub gain: f64,
    /// Phase relative to channel 0 at the frequency of sample `K/2`, radians.
    pub phase_rad: f64,
    /// Delay behind channel 0, seconds.
    pub delay_s: f64,
    /// Coherence with channel 0, 0 to 1; median over range bins.
    pub coherence: f64,
}

impl ChannelBalance {
    /// Balance of channel 0.
    const REFERENCE: Self = Self {
        gain: 1.0,
        phase_rad: 0.0,
        delay_s: 0.0,
        coherence: 1.0,
    };
}

/// Estimate the balance of all channels from their clutter. `centre_m` is the point of the scene to which pulses are compensated.
///
/// # Errors
/// [`GmtiError::Band`], [`GmtiError::Dead`], [`GmtiError::Incoherent`], [`GmtiError::Exchanged`], [`GmtiError::Read`].
pub fn balance(
    channels: &Channels,
    alignment: &Alignment,
    centre_m: DVec3,
) -> Result<Vec<ChannelBalance>, GmtiError> {
    let band = similar_band(channels)?;
    let names: Vec<&str> = channels.about().map(|about| about.name.as_str()).collect();
    let reference = channels.channel(0);
    let of_channel = |c: usize| {
        let history = channels.channel(c);
        let cross = |exchanged: bool| {
            let partners = alignment.nearest(c, exchanged);
            Cross::of(&band, reference, history, &partners, centre_m)
        };
        let stated = cross(false)?;
        if let Some(dead) = stated.dead() {
            let channel = names[[0, c][dead]].to_owned();
            return Err(GmtiError::Dead { channel });
        }
        let own = stated.balance(&band);
        // A coherence is at most 1.
        let exchanged = match EXCHANGED * own.coherence >= 1.0 {
            true => 0.0,
            false => cross(true)?.balance(&band).coherence,
        };
        let (channel, reference) = (names[c].to_owned(), names[0].to_owned());
        if exchanged > EXCHANGED * own.coherence && exchanged > MIN_COHERENCE {
            return Err(GmtiError::Exchanged {
                channel,
                reference,
                stated: own.coherence,
                exchanged,
            });
        }
        if own.coherence.is_nan() || own.coherence < MIN_COHERENCE {
            return Err(GmtiError::Incoherent {
                channel,
                reference,
                coherence: own.coherence,
                expected: MIN_COHERENCE,
            });
        }
        Ok(own)
    };
    let others: Vec<Result<ChannelBalance, GmtiError>> = (1..channels.len())
        .into_par_iter()
        .map(of_channel)
        .collect();
    // The first error in the order of the channels.
    std::iter::once(Ok(ChannelBalance::REFERENCE))
        .chain(others)
        .collect()
}

/// Largest difference of first frequencies that is accepted, as a fraction of the step. At the ends of the unambiguous ranges it is a phase of `0.1 pi`, 0.31 rad, between
/// pulses that are compared without their own frequencies; images are formed with the frequencies of each pulse.
const MAX_START_STEPS: f64 = 0.1;

/// Frequency axis of the first pulse of the first channel, from which no other pulse of any channel differs by more than [`MAX_START_STEPS`] at any sample.
pub(crate) fn similar_band(channels: &Channels) -> Result<Band, GmtiError> {
    let first = channels.channel(0).collection();
    let band = first.pulses.first().map(|pulse| Band {
        start_hz: pulse.start_hz,
        step_hz: pulse.step_hz,
        count: first.num_samples,
    });
    let band = band.ok_or(GmtiError::Band)?;
    let last = band.count.saturating_sub(1);
    let most_hz = (MAX_START_STEPS * band.step_hz).max(1e-9 * band.start_hz);
    let alike = |pulse: &Pulse| {
        [0, last]
            .iter()
            .all(|&k| (pulse.frequency_hz(k) - band.frequency_hz(k)).abs() <= most_hz)
    };
    let all_alike = channels.iter().all(|(_, history)| {
        let collection = history.collection();
        collection.num_samples == band.count && collection.pulses.iter().all(alike)
    });
    match all_alike {
        true => Ok(band),
        false => Err(GmtiError::Band),
    }
}

/// Frequency axis of all pulses of all channels, which the maps of sub-CPIs require.
pub(crate) fn shared_band(channels: &Channels) -> Result<Band, GmtiError> {
    let bands = channels
        .iter()
        .map(|(_, history)| history.collection().band());
    let bands: Vec<Band> = bands.collect::<Option<_>>().ok_or(GmtiError::SharedBand)?;
    let alike = |band: &Band| {
        band.count == bands[0].count
            && (band.start_hz - bands[0].start_hz).abs() <= 1e-9 * bands[0].start_hz
            && (band.bandwidth_hz() - bands[0].bandwidth_hz()).abs() <= 1e-9 * bands[0].start_hz
    };
    match bands.iter().all(alike) {
        true => Ok(bands[0]),
        false => Err(GmtiError::SharedBand),
    }
}

/// Cross-spectrum of two channels, and their product and powers in each range bin.
struct Cross {
    spectrum: Vec<Complex64>,
    bins: Vec<Bin>,
}

/// Sums of a range bin.
#[derive(Clone, Copy, Default)]
struct Bin {
    /// Product in the current segment.
    cross: Complex64,
    /// Magnitudes of the products of earlier segments.
    magnitude: f64,
    powers: [f64; 2],
}

impl Bin {
    fn end_segment(&mut self) {
        self.magnitude += std::mem::take(&mut self.cross).norm();
    }
}

impl Cross {
    fn of(
        band: &Band,
        reference: &dyn PhaseHistory,
        other: &dyn PhaseHistory,
        partners: &[Option<usize>],
        centre_m: DVec3,
    ) -> Result<Self, ReadError> {
        let count = band.count;
        let mut sums = Self {
            spectrum: vec![Complex64::ZERO; count],
            bins: vec![Bin::default(); count],
        };
        let segment = partners.len().div_ceil(SEGMENTS).max(SEGMENT_PULSES);
        let block = (BLOCK_SAMPLES / count).clamp(1, segment);
        let used = segment.min(MAX_PULSES / SEGMENTS);
        let mut reader = Reader::new(count, centre_m);
        for first in (0..partners.len()).step_by(segment) {
            let last = (first + used).min(partners.len());
            for start in (first..last).step_by(block) {
                let pulses = start..(start + block).min(last);
                reader.add([reference, other], pulses, partners, &mut sums)?;
            }
            sums.bins.iter_mut().for_each(Bin::end_segment);
        }
        // Bins by the power of the reference, the stronger half first.
        sums.bins
            .sort_by(|a, b| b.powers[0].total_cmp(&a.powers[0]));
        sums.bins.truncate(count.div_ceil(2));
        Ok(sums)
    }

    /// Index of a channel without power.
    fn dead(&self) -> Option<usize> {
        let power = |channel: usize| self.bins.iter().map(|bin| bin.powers[channel]).sum::<f64>();
        (0..2).find(|&channel| !(power(channel).is_finite() && power(channel) > 0.0))
    }

    fn balance(&self, band: &Band) -> ChannelBalance {
        let middle = (band.count / 2) as f64;
        let sum = |cycles_a_sample: f64| {
            let turn = Complex64::cis(TAU * cycles_a_sample);
            let parts = self.spectrum.chunks(RECURRENCE).enumerate();
            let sums = parts.map(|(i, part)| {
                let first = (i * RECURRENCE) as f64 - middle;
                let first = Complex64::cis(TAU * first * cycles_a_sample);
                // Horner's rule from the last sample.
                first * part.iter().rfold(Complex64::ZERO, |sum, c| sum * turn + c)
            });
            sums.sum::<Complex64>()
        };
        let steps = (DELAYS_A_CELL * band.count) as i64;
        let places = (-steps / 2..steps / 2).map(|i| i as f64 / steps as f64);
        let levels = places.map(|x| (x, sum(x).norm()));
        let (mut best, mut level) = levels.fold((0.0, sum(0.0).norm()), |best, next| {
            if next.1 > best.1 { next } else { best }
        });
        let mut step = 0.5 / steps as f64;
        while step * band.count as f64 > 1e-7 {
            for x in [best - step, best + step] {
                let there = sum(x).norm();
                if there > level {
                    (best, level) = (x, there);
                }
            }
            step /= 2.0;
        }
        ChannelBalance {
            gain: median(
                self.bins
                    .iter()
                    .map(|bin| (bin.powers[1] / bin.powers[0]).sqrt()),
            ),
            phase_rad: sum(best).arg(),
            delay_s: best / band.step_hz,
            coherence: median(
                self.bins
                    .iter()
                    .map(|bin| bin.magnitude / (bin.powers[0] * bin.powers[1]).sqrt()),
            ),
        }
    }
}

/// Buffers for pulses of two channels.
struct Reader {
    centre_m: DVec3,
    transform: Arc<dyn Fft<f32>>,
    scratch: Vec<Complex32>,
    samples: [Vec<Complex32>; 2],
}

impl Reader {
    fn new(count: usize, centre_m: DVec3) -> Self {
        let transform = subaperture_fft::inverse(count);
        let scratch = vec![Complex32::ZERO; transform.get_inplace_scratch_len()];
        Self {
            centre_m,
            transform,
            scratch,
            samples: [Vec::new(), Vec::new()],
        }
    }

    /// Add pulses of the first channel and their partners of the second.
    fn add(
        &mut self,
        [reference, other]: [&dyn PhaseHistory; 2],
        pulses: Range<usize>,
        partners: &[Option<usize>],
        sums: &mut Cross,
    ) -> Result<(), ReadError> {
        let matched = || partners[pulses.clone()].iter().flatten();
        let (Some(&first), Some(&last)) = (matched().min(), matched().max()) else {
            return Ok(());
        };
        let count = sums.spectrum.len();
        let [own, others] = &mut self.samples;
        read_at(reference, pulses.clone(), self.centre_m, own)?;
        read_at(other, first..last + 1, self.centre_m, others)?;
        let start = pulses.start;
        let pairs = || {
            let pulses = pulses.clone().zip(&partners[pulses.clone()]);
            pulses.filter_map(|(n, m)| Some(((n - start) * count, ((*m)? - first) * count)))
        };
        for (a, b) in pairs() {
            let values = own[a..a + count].iter().zip(&others[b..b + count]);
            for (sum, (&a, &b)) in sums.spectrum.iter_mut().zip(values) {
                *sum += widen(b) * widen(a).conj();
            }
        }
        for line in own
            .chunks_exact_mut(count)
            .chain(others.chunks_exact_mut(count))
        {
            self.transform.process_with_scratch(line, &mut self.scratch);
        }
        for (a, b) in pairs() {
            let values = own[a..a + count].iter().zip(&others[b..b + count]);
            for (bin, (&a, &b)) in sums.bins.iter_mut().zip(values) {
                let (a, b) = (widen(a), widen(b));
                bin.cross += b * a.conj();
                bin.powers[0] += a.norm_sqr();
                bin.powers[1] += b.norm_sqr();
            }
        }
        Ok(())
    }
}

/// Read pulses, compensated to `centre_m`.
pub(crate) fn read_at(
    history: &dyn PhaseHistory,
    pulses: Range<usize>,
    centre_m: DVec3,
    samples: &mut Vec<Complex32>,
) -> Result<(), ReadError> {
    let collection = history.collection();
    let count = collection.num_samples;
    samples.clear();
    samples.resize(pulses.len() * count, Complex32::ZERO);
    history.read(pulses.clone(), samples)?;
    let lines = samples.chunks_exact_mut(count);
    for (pulse, line) in collection.pulses[pulses].iter().zip(lines) {
        compensate(pulse, centre_m, line);
    }
    Ok(())
}

/// Multiply the samples of a pulse by `exp(+j 2 pi f path / c)`, the path to `centre_m` relative to the reference path.
fn compensate(pulse: &Pulse, centre_m: DVec3, line: &mut [Complex32]) {
    let cycles_a_hz = pulse.relative_path_m(centre_m) / SPEED_OF_LIGHT_M_S;
    rotate(
        line,
        [pulse.start_hz, pulse.step_hz].map(|hz| hz * cycles_a_hz),
        1.0,
    );
}

/// Phase history of a channel with its [`ChannelBalance`] removed.
pub struct Balanced<'a> {
    history: &'a dyn PhaseHistory,
    rotation: Vec<Complex32>,
}

impl<'a> Balanced<'a> {
    /// Remove `balance` from `history`.
    pub fn new(history: &'a dyn PhaseHistory, balance: &ChannelBalance) -> Self {
        let collection = history.collection();
        let mut rotation = vec![Complex32::ONE; collection.num_samples];
        let middle = (rotation.len() / 2) as f64;
        let step_hz = collection.pulses.first().map_or(0.0, |pulse| pulse.step_hz);
        let step = step_hz * balance.delay_s;
        let start = -middle * step - balance.phase_rad / TAU;
        rotate(&mut rotation, [start, step], 1.0 / balance.gain);
        Self { history, rotation }
    }
}

impl PhaseHistory for Balanced<'_> {
    fn collection(&self) -> &Collection {
        self.history.collection()
    }

    fn inner(&self) -> Option<&dyn PhaseHistory> {
        Some(self.history)
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history.read(pulses, samples)?;
        for line in samples.chunks_exact_mut(self.rotation.len()) {
            for (z, factor) in line.iter_mut().zip(&self.rotation) {
                *z *= factor;
            }
        }
        Ok(())
    }

    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        self.history.stated_beam()
    }
}
