//! Decimation by two or three in slow time and frequency.
//!
//! Each pulse is first multiplied by a phase ramp over frequency, as in [`crate::compensation`], so that the history varies slowly. Then, over pulses,
//! samples or both, for a factor `M` and `W` taps `h_r` of an interpolation kernel at each of the fractions `r / M` ([`Taps`]),
//!
//! ```text
//! new[l] = old[M (l - W/2 + 1)] + sum_r sum_i h_r[i] old[M (l - i) + r],    r = 1 .. M-1,  i = 0 .. W-1
//! ```
//!
//! Output 0 is at the position of input `-M (W/2 - 1)`, and `N` inputs give `(N - 2)/M + W` outputs ([`decimated`]). This is the
//! transpose (adjoint) of an interpolation that keeps every `M`-th sample and computes the others from `W` of these: a sum over
//! the outputs equals the sum over the inputs.
//!
//! **Layout** planes of float32 ([`Layout`]), one for each phase of the sample index, as input for the next decimation.
//! The output of a decimation over samples is laid out for decimation by two.
//!
//! **Accuracy** Phases are float64 at every 256th sample, float32 at every 32nd (by three: 384th, 48th), and phasor recurrences in between:
//! 2e-6 rad RMS. A sum has `(M - 1) W + 1` terms per dimension. The result is bit-identical in all instruction sets, and
//! independent of the division of rows among calls.
//!
//! **Cost** in vector operations per 16 input samples: 10 for the phase ramp, `2 ((M - 1) W + 1) / M` over pulses, a part `1 / M` of that over samples if
//! pulses are decimated too.

mod layout;

use std::ops::Range;

use num_complex::Complex32;

pub use layout::Layout;

use crate::lanes::{GROUP, Instructions, Kernel, Lanes};
use crate::phasor::{Polynomials, ROUND};

/// Largest number of taps.
pub const MAX_TAPS: usize = 16;

/// Number of outputs of a decimation by `factor` for `count` inputs.
pub fn decimated(count: usize, factor: usize, taps: usize) -> usize {
    count.saturating_sub(2) / factor + taps
}

/// Inputs that the outputs `range` of a decimation by `factor` need, of `count` inputs.
pub fn needed(factor: usize, taps: usize, range: &Range<usize>, count: usize) -> Range<usize> {
    let first = (factor * (range.start + 1) + 1).saturating_sub(factor * taps);
    first.min(count)..(factor * range.end).min(count)
}

/// Taps of the interpolation kernels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taps<const W: usize> {
    /// At the fraction 1/2, for decimation by two.
    pub half: [f32; W],
    /// At the fraction 1/3, for decimation by three; in reverse order they are those at 2/3.
    pub third: [f32; W],
}

impl<const W: usize> Taps<W> {
    /// Taps of decimation by `factor` at its first and last fraction, as vectors.
    #[inline(always)]
    fn splat<L: Lanes>(&self, lanes: L, factor: usize) -> [[L::Numbers; W]; 2] {
        let mut last = match factor {
            2 => self.half,
            _ => self.third,
        };
        let first = last;
        last.reverse();
        [first, last].map(|taps| taps.map(|tap| lanes.splat(tap)))
    }
}

/// Phase ramp over samples, cycles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseRamp {
    /// Phase of the first sample, cycles.
    pub start: f64,
    /// Phase step per sample, cycles.
    pub step: f64,
}

/// Input pulses.
#[derive(Clone, Copy)]
pub enum Rows<'a> {
    /// Pulses in planes ([`Layout`]).
    Planes(&'a [f32]),
    /// Recorded samples with weights.
    Samples {
        /// Samples, pulse by pulse.
        samples: &'a [Complex32],
        /// Fast-time weight per sample.
        fast: &'a [f32],
        /// Slow-time weight per pulse.
        slow: &'a [f32],
    },
}

/// Input and mode of a decimation.
#[derive(Clone, Copy)]
pub struct Decimation<'a> {
    /// Decimation factor over pulses: 1, 2 or 3.
    pub pulses: usize,
    /// Whether to decimate over samples, by the factor of the layout.
    pub samples: bool,
    /// Layout of the input.
    pub layout: Layout,
    /// Input pulses from `first` on.
    pub rows: Rows<'a>,
    /// Index of the first pulse in `rows`.
    pub first: usize,
    /// Phase ramp per pulse; none if empty.
    pub phase_ramps: &'a [PhaseRamp],
}

/// Buffers of one thread.
#[derive(Default)]
pub struct DecimationScratch {
    /// Stride between planes, length and number of planes, number of pulses.
    shape: [usize; 4],
    turned: Vec<f32>,
    mixed: Vec<f32>,
    spread: Vec<f32>,
}

impl Decimation<'_> {
    /// Layout of the output.
    pub fn after(&self, taps: usize) -> Layout {
        match self.samples {
            true => Layout::new(
                decimated(self.layout.count(), self.layout.factor(), taps),
                2,
            ),
            false => self.layout,
        }
    }

    /// Compute output pulses from `first` on, as many as `out` holds. Input pulses not in `rows` are zero.
    ///
    /// # Panics
    /// If lengths are not multiples of a pulse, or `phase_ramps` has neither no ramp nor one per pulse.
    pub fn make<const W: usize>(
        &self,
        instructions: Instructions,
        taps: &Taps<W>,
        first: usize,
        out: &mut [f32],
        scratch: &mut DecimationScratch,
    ) {
        const { assert!(W.is_multiple_of(2) && W <= MAX_TAPS) };
        assert!((1..=3).contains(&self.pulses));
        let after = self.after(W);
        assert!(out.len().is_multiple_of(after.values()));
        let (planes, plane) = (2 * self.layout.factor(), self.layout.plane());
        let stride = match self.samples {
            true => GROUP + plane.max(2 * after.plane()),
            false => GROUP + plane,
        };
        let slots = match self.pulses {
            1 => 1,
            factor => slots(factor, W) + 1,
        };
        // Padding before and after a plane's samples is never written and stays zero.
        let shape = [stride, plane, planes, slots];
        if scratch.shape != shape {
            scratch.shape = shape;
            scratch.turned.clear();
            scratch.turned.resize(slots * planes * stride, 0.0);
            scratch.mixed.clear();
            scratch.mixed.resize(TOGETHER * planes * stride, 0.0);
        }
        scratch.spread.resize(self.layout.values(), 0.0);
        instructions.run(Make {
            decimation: self,
            taps,
            after,
            stride,
            first,
            out,
            turned: &mut scratch.turned,
            mixed: &mut scratch.mixed,
            spread: &mut scratch.spread,
        });
    }

    /// Memory of the input pulses after the given one.
    #[inline(always)]
    fn rows_after(&self, pulse: usize) -> Next<'_> {
        match self.rows {
            Rows::Planes(values) => Next::Planes(&values[(pulse + 1) * self.layout.values()..]),
            Rows::Samples { samples, .. } => {
                Next::Samples(&samples[(pulse + 1) * self.layout.count()..])
            }
        }
    }

    /// Number of input pulses.
    fn num_rows(&self) -> usize {
        match self.rows {
            Rows::Planes(values) => values.len() / self.layout.values(),
            Rows::Samples { slow, .. } => slow.len(),
        }
    }
}

/// Memory of a pulse, in either form.
#[derive(Clone, Copy)]
enum Next<'a> {
    Planes(&'a [f32]),
    Samples(&'a [Complex32]),
}

impl Next<'_> {
    /// Fetch part `i` of the pulse: as many bytes as a group has in `planes` planes.
    #[inline(always)]
    fn prefetch<L: Lanes>(self, lanes: L, planes: usize, i: usize) {
        const LINE: usize = 64;
        let lines = planes * GROUP * size_of::<f32>() / LINE;
        for line in lines * i..lines * (i + 1) {
            match self {
                Self::Planes(values) => {
                    if let Some(value) = values.get(line * (LINE / size_of::<f32>())) {
                        lanes.prefetch(value);
                    }
                }
                Self::Samples(samples) => {
                    if let Some(sample) = samples.get(line * (LINE / size_of::<Complex32>())) {
                        lanes.prefetch(sample);
                    }
                }
            }
        }
    }
}

struct Make<'a, const W: usize> {
    decimation: &'a Decimation<'a>,
    taps: &'a Taps<W>,
    after: Layout,
    /// Stride between planes in the buffers; each begins with zeros for the kernel's overlap.
    stride: usize,
    first: usize,
    out: &'a mut [f32],
    /// Ring of phase-rotated pulses; the last slot is zero.
    turned: &'a mut [f32],
    mixed: &'a mut [f32],
    /// Pulse in its layout.
    spread: &'a mut [f32],
}

impl<const W: usize> Kernel for Make<'_, W> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self {
            decimation,
            taps,
            after,
            stride,
            first,
            out,
            turned,
            mixed,
            spread,
        } = self;
        let turning = Turn {
            lanes,
            phasor: Polynomials::new(lanes),
            round: lanes.splat(ROUND),
            decimation,
            stride,
        };
        let factor = decimation.pulses;
        let over_pulses = taps.splat(lanes, factor);
        let over_samples = taps.splat(lanes, decimation.layout.factor());
        let (size, slots) = (2 * decimation.layout.factor() * stride, slots(factor, W));
        let rows = decimation.first..decimation.first + decimation.num_rows();
        // Earlier pulses are in their slots.
        let mut next = rows.start;
        let mut first = first;
        // A single pulse stays in cache between its phase rotation and its decimation.
        let together = if factor > 1 { TOGETHER } else { 1 };
        for out in out.chunks_mut(together * after.values()) {
            let count = out.len() / after.values();
            let made: &[f32] = if factor > 1 {
                let end = (factor * (first + count)).min(rows.end);
                next = next.max((factor * (first + 1) + 1).saturating_sub(factor * W));
                while next < end {
                    let slot = next % slots * size;
                    turning.turn(next - rows.start, spread, &mut turned[slot..slot + size]);
                    next += 1;
                }
                let ring = Ring {
                    turned,
                    rows: &rows,
                    stride,
                    plane: decimation.layout.plane(),
                    size,
                    slots,
                };
                match factor {
                    2 => ring.mixed::<L, W, 1>(lanes, first, count, &over_pulses, mixed),
                    _ => ring.mixed::<L, W, 2>(lanes, first, count, &over_pulses, mixed),
                }
                mixed
            } else {
                match rows.contains(&first) {
                    true => turning.turn(first - rows.start, spread, turned),
                    false => turned.fill(0.0),
                }
                turned
            };
            for (row, out) in made
                .chunks_exact(size)
                .zip(out.chunks_exact_mut(after.values()))
            {
                if !decimation.samples {
                    let length = after.plane();
                    for (plane, out) in out.chunks_exact_mut(length).enumerate() {
                        let from = plane * stride + GROUP;
                        out.copy_from_slice(&row[from..from + length]);
                    }
                } else if decimation.layout.factor() == 2 {
                    samples::<L, W, 1>(lanes, row, stride, &over_samples, after.plane(), out);
                } else {
                    samples::<L, W, 2>(lanes, row, stride, &over_samples, after.plane(), out);
                }
            }
            first += count;
        }
    }
}

/// Output pulses computed together, sharing loads of input pulses.
const TOGETHER: usize = 4;

/// Slots of the ring: the input pulses needed, and one zero slot.
const fn slots(factor: usize, taps: usize) -> usize {
    factor * (taps + TOGETHER)
}

/// Ring buffer of phase-rotated pulses.
struct Ring<'a> {
    turned: &'a [f32],
    rows: &'a Range<usize>,
    stride: usize,
    /// Length of a plane.
    plane: usize,
    size: usize,
    slots: usize,
}

impl Ring<'_> {
    /// Pulse, or zeros if absent.
    #[inline(always)]
    fn at(&self, pulse: Option<usize>) -> &[f32] {
        let slot = match pulse {
            Some(pulse) if self.rows.contains(&pulse) => pulse % self.slots,
            _ => self.slots,
        };
        &self.turned[slot * self.size..(slot + 1) * self.size]
    }

    /// Compute `count` output pulses from `first` on, with kernels at `F` fractions: a decimation by `F + 1`.
    #[inline(always)]
    fn mixed<L: Lanes, const W: usize, const F: usize>(
        &self,
        lanes: L,
        first: usize,
        count: usize,
        weights: &[[L::Numbers; W]; 2],
        mixed: &mut [f32],
    ) {
        if count == TOGETHER {
            return self.mix::<L, W, F, TOGETHER>(lanes, first, weights, mixed);
        }
        for (i, mixed) in (first..first + count).zip(mixed.chunks_exact_mut(self.size)) {
            self.mix::<L, W, F, 1>(lanes, i, weights, mixed);
        }
    }

    /// Sum one retained pulse and `W` pulses at each fraction for each of `N` output pulses from `first` on.
    #[inline(always)]
    fn mix<L: Lanes, const W: usize, const F: usize, const N: usize>(
        &self,
        lanes: L,
        first: usize,
        weights: &[[L::Numbers; W]; 2],
        mixed: &mut [f32],
    ) {
        let factor = F + 1;
        let mut retained = [self.turned; N];
        for (n, row) in retained.iter_mut().enumerate() {
            *row = self.at((first + n + 1).checked_sub(W / 2).map(|l| factor * l));
        }
        // In ascending order of pulses.
        let mut others = [[self.turned; MAX_TAPS + TOGETHER]; F];
        for (r, others) in others.iter_mut().enumerate() {
            for (m, row) in others.iter_mut().enumerate().take(W + N - 1) {
                let from = (first + m + 1).checked_sub(W);
                *row = self.at(from.map(|l| factor * l + r + 1));
            }
        }
        for plane in 0..self.size / self.stride {
            let first = plane * self.stride + GROUP;
            let plane = first..first + self.plane;
            let retained = retained.map(|row| groups(&row[plane.clone()]));
            let others = others.map(|rows| rows.map(|row| groups(&row[plane.clone()])));
            let mut rows = mixed.chunks_exact_mut(self.size);
            let to: [&mut [[f32; GROUP]]; N] = std::array::from_fn(|_| {
                let row = rows.next().expect("one row per output pulse");
                groups_mut(&mut row[plane.clone()])
            });
            for i in 0..self.plane / GROUP {
                for part in (0..GROUP).step_by(L::COUNT) {
                    let mut sums = [weights[0][0]; N];
                    for n in 0..N {
                        sums[n] = lanes.load(&retained[n][i][part..]);
                    }
                    for r in 0..F {
                        for m in 0..W + N - 1 {
                            let value = lanes.load(&others[r][m][i][part..]);
                            for n in 0..N {
                                if m >= n && m < n + W {
                                    sums[n] =
                                        lanes.mul_add(weights[r][n + W - 1 - m], value, sums[n]);
                                }
                            }
                        }
                    }
                    for n in 0..N {
                        lanes.store(sums[n], &mut to[n][i][part..]);
                    }
                }
            }
        }
    }
}

/// Groups of a plane.
#[inline(always)]
fn groups(plane: &[f32]) -> &[[f32; GROUP]] {
    plane.as_chunks().0
}

#[inline(always)]
fn groups_mut(plane: &mut [f32]) -> &mut [[f32; GROUP]] {
    plane.as_chunks_mut().0
}

/// Decimate the samples of a row, with kernels at `F` fractions: by `F + 1`.
#[inline(always)]
fn samples<L: Lanes, const W: usize, const F: usize>(
    lanes: L,
    row: &[f32],
    stride: usize,
    weights: &[[L::Numbers; W]; 2],
    half: usize,
    out: &mut [f32],
) {
    for part in 0..2 {
        let mut planes = row[part * (F + 1) * stride..].chunks_exact(stride);
        let retained = planes.next().expect("a plane per phase");
        let others: [&[f32]; F] =
            std::array::from_fn(|_| planes.next().expect("a plane per phase"));
        let out = &mut out[2 * part * half..2 * (part + 1) * half];
        let (to_even, to_odd) = out.split_at_mut(half);
        let to = to_even.chunks_exact_mut(L::COUNT);
        for (i, (to_even, to_odd)) in to.zip(to_odd.chunks_exact_mut(L::COUNT)).enumerate() {
            let from = GROUP + 2 * i * L::COUNT;
            let retained = &retained[from + 1 - W / 2..][..2 * L::COUNT];
            let mut low = lanes.load(retained);
            let mut high = lanes.load(&retained[L::COUNT..]);
            for (other, weights) in others.iter().zip(weights) {
                // From the last tap's sample on.
                let other = &other[from + 1 - W..][..W - 1 + 2 * L::COUNT];
                for tap in 0..W {
                    let other = &other[W - 1 - tap..];
                    low = lanes.mul_add(weights[tap], lanes.load(other), low);
                    high = lanes.mul_add(weights[tap], lanes.load(&other[L::COUNT..]), high);
                }
            }
            let [even, odd] = lanes.unzip(low, high);
            lanes.store(even, to_even);
            lanes.store(odd, to_odd);
        }
    }
}

/// Phase rotation of pulses.
struct Turn<'a, L: Lanes> {
    lanes: L,
    phasor: Polynomials<L>,
    round: L::Numbers,
    decimation: &'a Decimation<'a>,
    stride: usize,
}

/// Indices within a group.
const PLACES: [f32; GROUP] = {
    let mut places = [0.0; GROUP];
    let mut i = 0;
    while i < GROUP {
        places[i] = i as f32;
        i += 1;
    }
    places
};

impl<L: Lanes> Turn<'_, L> {
    /// Store a phase-rotated pulse in planes with leading zeros.
    #[inline(always)]
    fn turn(&self, pulse: usize, spread: &mut [f32], to: &mut [f32]) {
        let Self {
            decimation, stride, ..
        } = *self;
        let (layout, length) = (decimation.layout, decimation.layout.plane());
        let values = match decimation.rows {
            Rows::Planes(values) => &values[pulse * layout.values()..(pulse + 1) * layout.values()],
            Rows::Samples {
                samples,
                fast,
                slow,
            } => {
                let samples = &samples[pulse * layout.count()..(pulse + 1) * layout.count()];
                layout.spread(samples, fast, slow[pulse], spread);
                spread
            }
        };
        let Some(turning) = decimation.phase_ramps.get(pulse) else {
            for (plane, values) in values.chunks_exact(length).enumerate() {
                to[plane * stride + GROUP..][..length].copy_from_slice(values);
            }
            return;
        };
        let next = decimation.rows_after(pulse);
        match layout.factor() {
            2 => self.turned::<2>(turning, values, next, to),
            _ => self.turned::<3>(turning, values, next, to),
        }
    }

    /// Multiply a pulse of `M` planes by its phase ramp, and meanwhile fetch the `next` pulse from memory.
    #[inline(always)]
    fn turned<const M: usize>(
        &self,
        turning: &PhaseRamp,
        from: &[f32],
        next: Next,
        to: &mut [f32],
    ) {
        let (lanes, stride, length) = (self.lanes, self.stride, self.decimation.layout.plane());
        let count = length / GROUP;
        let mut planes = from.chunks_exact(length).map(groups);
        let [re, im]: [[_; M]; 2] = std::array::from_fn(|_| {
            std::array::from_fn(|_| &planes.next().expect("2 M planes")[..count])
        });
        let mut planes = to
            .chunks_exact_mut(stride)
            .map(|plane| groups_mut(&mut plane[GROUP..GROUP + length]));
        let [to_re, to_im]: [[_; M]; 2] = std::array::from_fn(|_| {
            std::array::from_fn(|_| &mut planes.next().expect("2 M planes")[..count])
        });
        let step = lanes.splat(reduced(M as f64 * turning.step));
        // Phasor from group to group.
        let [on_cos, on_sin] = self.phasor(lanes.splat(reduced((M * GROUP) as f64 * turning.step)));
        // Separate recurrences for the planes and for the parts of a group hide the latency.
        let mut phasors = [[[step; 2]; MAX_PARTS]; M];
        for anew in (0..count).step_by(ANEW) {
            for (plane, phasors) in phasors.iter_mut().enumerate() {
                let first = (M * GROUP * anew + plane) as f64;
                let base = lanes.splat(reduced(turning.start + turning.step * first));
                for (part, phasor) in phasors.iter_mut().enumerate().take(GROUP / L::COUNT) {
                    let places = lanes.load(&PLACES[part * L::COUNT..]);
                    *phasor = self.phasor(lanes.mul_add(step, places, base));
                }
            }
            for i in anew..(anew + ANEW).min(count) {
                next.prefetch(lanes, 2 * M, i);
                for (plane, phasors) in phasors.iter_mut().enumerate() {
                    let (re, im) = (&re[plane][i], &im[plane][i]);
                    let (to_re, to_im) = (&mut to_re[plane][i], &mut to_im[plane][i]);
                    for (part, phasor) in phasors.iter_mut().enumerate().take(GROUP / L::COUNT) {
                        let ([cos, sin], from) = (*phasor, part * L::COUNT);
                        let (a, b) = (lanes.load(&re[from..]), lanes.load(&im[from..]));
                        let real = lanes.neg_mul_add(sin, b, lanes.mul(cos, a));
                        let imaginary = lanes.mul_add(sin, a, lanes.mul(cos, b));
                        lanes.store(real, &mut to_re[from..]);
                        lanes.store(imaginary, &mut to_im[from..]);
                        *phasor = [
                            lanes.neg_mul_add(sin, on_sin, lanes.mul(cos, on_cos)),
                            lanes.mul_add(sin, on_cos, lanes.mul(cos, on_sin)),
                        ];
                    }
                }
            }
        }
    }

    /// Cosine and sine of a phase in cycles, below 2^22.
    #[inline(always)]
    fn phasor(&self, turns: L::Numbers) -> [L::Numbers; 2] {
        let lanes = self.lanes;
        let whole = lanes.sub(lanes.add(turns, self.round), self.round);
        self.phasor.at(lanes, lanes.sub(turns, whole))
    }
}

/// Groups after which the recurrence restarts.
const ANEW: usize = 8;
/// Largest number of parts of a group.
const MAX_PARTS: usize = 4;

/// Phase reduced to half a cycle.
#[inline(always)]
fn reduced(turns: f64) -> f32 {
    (turns - turns.round_ties_even()) as f32
}
