//! Streaming pulse compression; equation in [`super`].
//!
//! Samples are pushed in blocks of any length. The samples of a pulse are held until its farthest echo has arrived;
//! samples shared with the next pulse are kept. Each pulse is correlated by FFT, zero-padded so that the circular
//! correlation equals the linear one. Pulses with lost samples are skipped and counted.
//!
//! Memory: `72 K` bytes and the FFT tables, where `K` is the power of two at or above chirp plus lags. Cost per pulse:
//! three FFTs of length `K`; with the ideal replica four, and five sums of `K` sines to locate the reference peak.

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use num_complex::Complex64;
use subaperture_fft::{Fft, Transforms};
use subaperture_signal::phase::phasor;

use super::{LOOP_SAMPLES, Plan};
use crate::transceiver::Sample;

/// Newton iterations to the peak of the reference, starting within half a sample; convergence is quadratic.
const STEPS: usize = 4;

/// Replica of the matched filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Replica {
    /// Computed chirp of the plan; includes no distortion of the radio.
    #[default]
    Ideal,
    /// Reference channel of the same pulse.
    Reference,
}

/// Range profile of a pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChirpProfile<'p> {
    /// Index of the pulse in its burst.
    pub pulse: u64,
    /// Range spacing of the values, metres.
    pub spacing_m: f64,
    /// Index of range zero, fractional.
    pub zero: f64,
    /// Echo divided by reference.
    pub values: &'p [Complex64],
}

impl ChirpProfile<'_> {
    /// Range of value `l`, metres.
    pub fn range_m(&self, l: usize) -> f64 {
        (l as f64 - self.zero) * self.spacing_m
    }
}

/// Streaming pulse compressor for the pulses of a burst.
pub struct Compressor {
    replica: Replica,
    spacing_m: f64,
    period: u64,
    lags: usize,
    /// Samples of a replica, and samples needed for one pulse.
    length: usize,
    span: usize,
    transforms: [Arc<dyn Fft<f64>>; 2],
    /// Spectrum of the ideal replica, and the replica's energy.
    ideal: Vec<Complex64>,
    energy: f64,
    /// Index of the next sample, of the first held sample, and of the next pulse.
    next: u64,
    first: u64,
    pulse: u64,
    held: [Vec<Sample>; 2],
    lost: Vec<Range<u64>>,
    left_out: u64,
    echo: Vec<Complex64>,
    other: Vec<Complex64>,
    work: Vec<Complex64>,
}

impl Compressor {
    /// Make a compressor for the pulses of a plan.
    ///
    /// # Errors
    /// If chirp or interval are empty, or chirp plus lags exceed 2^22 samples ([`Plan::check`] also checks the plan
    /// against a radio).
    pub fn new(plan: &Plan, replica: Replica) -> Result<Self, String> {
        let (count, lags) = (plan.chirp_samples(), plan.lags());
        let length = match replica {
            Replica::Ideal => count,
            Replica::Reference => count + LOOP_SAMPLES,
        };
        let span = length.saturating_add(lags);
        if count == 0 || plan.period() == 0 || span > 1 << 22 {
            return Err(format!(
                "chirp of {count} samples, interval of {} samples, {lags} lags: expected at least one sample each, and at most 2^22 samples of chirp plus lags",
                plan.period()
            ));
        }
        let points = span.next_power_of_two();
        let transforms = Transforms::Portable;
        let (forward, inverse) = (transforms.forward(points), transforms.inverse(points));
        let mut ideal = plan.chirp();
        let energy = ideal.iter().map(Complex64::norm_sqr).sum();
        ideal.resize(points, Complex64::ZERO);
        forward.process(&mut ideal);
        Ok(Self {
            replica,
            spacing_m: plan.spacing_m(),
            period: plan.period() as u64,
            lags,
            length,
            span,
            transforms: [forward, inverse],
            ideal,
            energy,
            next: 0,
            first: 0,
            pulse: 0,
            held: [Vec::with_capacity(span), Vec::with_capacity(span)],
            lost: Vec::new(),
            left_out: 0,
            echo: vec![Complex64::ZERO; points],
            other: vec![Complex64::ZERO; points],
            work: vec![Complex64::ZERO; points],
        })
    }

    /// Begin a new burst and drop the samples held.
    pub fn begin(&mut self) {
        (self.next, self.first, self.pulse) = (0, 0, 0);
        self.held.iter_mut().for_each(Vec::clear);
        self.lost.clear();
    }

    /// Pulses skipped so far, over all bursts.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Push the next samples of both channels, reference and echo, with the index ranges of lost samples in `lost`, and
    /// call `emit` for each pulse that they complete.
    ///
    /// # Panics
    /// If the channels differ in length.
    pub fn push(
        &mut self,
        [reference, echo]: [&[Sample]; 2],
        lost: &[Range<usize>],
        emit: &mut dyn FnMut(&ChirpProfile<'_>),
    ) {
        assert_eq!(
            reference.len(),
            echo.len(),
            "both channels have the same length"
        );
        let gaps = lost.iter().filter(|gap| !gap.is_empty());
        let base = self.next;
        self.lost
            .extend(gaps.map(|gap| base + gap.start as u64..base + gap.end as u64));
        let mut at = 0;
        while at < echo.len() {
            // Skip samples between pulses that no profile needs.
            let begins = self.pulse * self.period;
            let skipped = begins
                .saturating_sub(self.next)
                .min((echo.len() - at) as u64);
            self.next += skipped;
            at += skipped as usize;
            if self.held[0].is_empty() {
                self.first = self.next;
            }
            let room = self.span - self.held[0].len();
            let taken = room.min(echo.len() - at);
            for (held, channel) in self.held.iter_mut().zip([reference, echo]) {
                held.extend_from_slice(&channel[at..at + taken]);
            }
            at += taken;
            self.next += taken as u64;
            if self.held[0].len() == self.span {
                self.compress(emit);
                self.pulse += 1;
                let keep = self.pulse * self.period;
                let dropped = (keep - self.first).min(self.span as u64);
                for held in &mut self.held {
                    held.drain(..dropped as usize);
                }
                self.first += dropped;
                self.lost.retain(|gap| gap.end > keep);
            }
        }
    }

    /// Compress the pulse whose samples are held.
    fn compress(&mut self, emit: &mut dyn FnMut(&ChirpProfile<'_>)) {
        let own = self.first..self.first + self.span as u64;
        if (self.lost.iter()).any(|gap| gap.start < own.end && own.start < gap.end) {
            self.left_out += 1;
            return;
        }
        let [forward, inverse] = self.transforms.clone();
        fill(&mut self.echo, &self.held[1]);
        forward.process(&mut self.echo);
        let unit = 1.0 / self.echo.len() as f64;
        let (zero, scale) = match self.replica {
            Replica::Reference => {
                fill(&mut self.other, &self.held[0][..self.length]);
                let energy: f64 = self.other.iter().map(Complex64::norm_sqr).sum();
                forward.process(&mut self.other);
                correlate(&mut self.echo, &self.other);
                (0.0, Complex64::from(unit / energy))
            }
            Replica::Ideal => {
                fill(&mut self.other, &self.held[0]);
                forward.process(&mut self.other);
                correlate(&mut self.other, &self.ideal);
                correlate(&mut self.echo, &self.ideal);
                self.work.copy_from_slice(&self.other);
                inverse.process(&mut self.work);
                let near = strongest(&self.work[..self.lags.min(2 * LOOP_SAMPLES)]);
                let (zero, value) = top(&self.other, near);
                // Both correlations are divided by the replica's energy, which cancels.
                (zero, unit / value)
            }
        };
        // Skip a pulse whose reference is zero.
        if !(scale.is_finite() && self.energy > 0.0) {
            self.left_out += 1;
            return;
        }
        inverse.process(&mut self.echo);
        let values = &mut self.echo[..self.lags];
        values.iter_mut().for_each(|z| *z *= scale);
        emit(&ChirpProfile {
            pulse: self.pulse,
            spacing_m: self.spacing_m,
            zero,
            values,
        });
    }
}

/// Convert counts to numbers of full scale 1, and pad with zeros.
fn fill(to: &mut [Complex64], samples: &[Sample]) {
    let (own, rest) = to.split_at_mut(samples.len());
    for (to, s) in own.iter_mut().zip(samples) {
        *to = Complex64::new(f64::from(s.re), f64::from(s.im)) / 32768.0;
    }
    rest.fill(Complex64::ZERO);
}

/// Multiply a spectrum by the conjugate of the replica's spectrum.
fn correlate(spectrum: &mut [Complex64], replica: &[Complex64]) {
    for (z, r) in spectrum.iter_mut().zip(replica) {
        *z *= r.conj();
    }
}

/// Index of the largest magnitude.
fn strongest(values: &[Complex64]) -> f64 {
    let power = |i: &usize| values[*i].norm_sqr();
    let best = (0..values.len()).max_by(|a, b| power(a).total_cmp(&power(b)));
    best.unwrap_or(0) as f64
}

/// Locate the maximum of `|y|` near `at`, interpolated between samples, and return its position and `y` there. Newton
/// iteration on `sum_k Y[k] exp(j 2 pi k l / K) / K`.
fn top(spectrum: &[Complex64], mut at: f64) -> (f64, Complex64) {
    let count = spectrum.len() as f64;
    let half = spectrum.len() / 2;
    let sums = |at: f64| {
        let [mut value, mut first, mut second] = [Complex64::ZERO; 3];
        for (k, y) in spectrum.iter().enumerate() {
            // The upper half of an FFT holds the negative frequencies.
            let k = if k < half { k as f64 } else { k as f64 - count };
            let own = y * phasor(k * at / count);
            let turn = TAU * k / count;
            value += own;
            first += Complex64::new(-own.im, own.re) * turn;
            second -= own * (turn * turn);
        }
        [value, first, second].map(|sum| sum / count)
    };
    for _ in 0..STEPS {
        let [value, first, second] = sums(at);
        let slope = (first * value.conj()).re;
        let bend = first.norm_sqr() + (second * value.conj()).re;
        if bend < 0.0 {
            at += (-slope / bend).clamp(-0.5, 0.5);
        }
    }
    let [value, ..] = sums(at);
    (at, value)
}
