//! Decimation by two in slow time and frequency.
//!
//! Each pulse is first multiplied by a phase ramp over frequency, as in [`crate::compensation`], so that the history varies slowly. Then, over pulses,
//! samples or both, with `W` taps `h` of an interpolation kernel at the fraction 1/2,
//!
//! ```text
//! new[l] = old[2 (l - W/2 + 1)] + sum_i h[i] old[2 (l - i) + 1],    i = 0 .. W-1
//! ```
//!
//! Output 0 is at the position of input `-(W - 2)`, and `N` inputs give `N/2 + W - 1` outputs ([`halved`]). This is the
//! transpose (adjoint) of an interpolation that keeps even samples and computes odd ones from `W` even ones: a sum over
//! the outputs equals the sum over the inputs.
//!
//! **Layout** planes of float32 ([`Layout`]), even and odd samples separate, as input for the
//! next decimation.
//!
//! **Accuracy** Phases are float64 at every 256th sample, float32 at every 32nd, and phasor recurrences in between:
//! 2e-6 rad RMS. A sum has `W + 1` terms per dimension. The result is bit-identical in all instruction sets, and
//! independent of the division of rows among calls.
//!
//! **Cost** in vector operations per 16 input samples: 10 for the phase ramp, `W + 1` over pulses, half of that over samples if
//! pulses are decimated too.

mod layout;

use std::ops::Range;

use num_complex::Complex32;

pub use layout::Layout;

use crate::lanes::{GROUP, Instructions, Kernel, Lanes};
use crate::phasor::{Polynomials, ROUND};

/// Largest number of taps.
pub const MAX_TAPS: usize = 16;

/// Number of outputs for `count` inputs.
pub fn halved(count: usize, taps: usize) -> usize {
    count / 2 + taps - 1
}

/// Inputs that the outputs `range` need, of `count` inputs.
pub fn needed(taps: usize, range: &Range<usize>, count: usize) -> Range<usize> {
    let first = (2 * range.start + 3).saturating_sub(2 * taps);
    first.min(count)..(2 * range.end).min(count)
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
    /// Whether to decimate over pulses.
    pub pulses: bool,
    /// Whether to decimate over samples.
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
    /// Stride between planes, length of a plane, number of pulses.
    shape: [usize; 3],
    turned: Vec<f32>,
    mixed: Vec<f32>,
    spread: Vec<f32>,
}

impl Decimation<'_> {
    /// Layout of the output.
    pub fn after(&self, taps: usize) -> Layout {
        match self.samples {
            true => Layout::new(halved(self.layout.count(), taps)),
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
        taps: &[f32; W],
        first: usize,
        out: &mut [f32],
        scratch: &mut DecimationScratch,
    ) {
        const { assert!(W.is_multiple_of(2) && W <= MAX_TAPS) };
        let after = self.after(W);
        assert!(out.len().is_multiple_of(after.values()));
        let half = self.layout.half();
        let stride = match self.samples {
            true => GROUP + half.max(2 * after.half()),
            false => GROUP + half,
        };
        let slots = if self.pulses { slots(W) + 1 } else { TOGETHER };
        // Padding before and after a plane's samples is never written and stays zero.
        let shape = [stride, half, slots];
        if scratch.shape != shape {
            scratch.shape = shape;
            scratch.turned.clear();
            scratch.turned.resize(slots * 4 * stride, 0.0);
            scratch.mixed.clear();
            scratch.mixed.resize(TOGETHER * 4 * stride, 0.0);
        }
        scratch.spread.resize(self.layout.values(), 0.0);
        instructions.run(Make {
            halving: self,
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
    /// Fetch part `i` of the pulse: as many bytes as a group has in the four planes.
    #[inline(always)]
    fn prefetch<L: Lanes>(self, lanes: L, i: usize) {
        const LINE: usize = 64;
        const LINES: usize = 4 * GROUP * size_of::<f32>() / LINE;
        for line in LINES * i..LINES * (i + 1) {
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
    halving: &'a Decimation<'a>,
    taps: &'a [f32; W],
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
            halving,
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
            halving,
            stride,
        };
        let mut weights = [lanes.splat(0.0); W];
        for (weight, &tap) in weights.iter_mut().zip(taps) {
            *weight = lanes.splat(tap);
        }
        let (size, slots) = (4 * stride, slots(W));
        let rows = halving.first..halving.first + halving.num_rows();
        // Earlier pulses are in their slots.
        let mut next = rows.start;
        let mut first = first;
        for out in out.chunks_mut(TOGETHER * after.values()) {
            let count = out.len() / after.values();
            let made: &[f32] = if halving.pulses {
                let end = (2 * (first + count)).min(rows.end);
                next = next.max((2 * first + 3).saturating_sub(2 * W));
                while next < end {
                    let slot = next % slots * size;
                    turning.turn(next - rows.start, spread, &mut turned[slot..slot + size]);
                    next += 1;
                }
                let ring = Ring {
                    turned,
                    rows: &rows,
                    stride,
                    half: halving.layout.half(),
                    size,
                    slots,
                };
                if count == TOGETHER {
                    mix::<L, W, TOGETHER>(lanes, &ring, first, &weights, mixed);
                } else {
                    for (i, mixed) in (first..first + count).zip(mixed.chunks_exact_mut(size)) {
                        mix::<L, W, 1>(lanes, &ring, i, &weights, mixed);
                    }
                }
                mixed
            } else {
                for (i, turned) in (first..first + count).zip(turned.chunks_exact_mut(size)) {
                    if rows.contains(&i) {
                        turning.turn(i - rows.start, spread, turned);
                    } else {
                        turned.fill(0.0);
                    }
                }
                turned
            };
            for (row, out) in made
                .chunks_exact(size)
                .zip(out.chunks_exact_mut(after.values()))
            {
                if halving.samples {
                    samples(lanes, row, stride, &weights, after.half(), out);
                } else {
                    let half = after.half();
                    for (plane, out) in out.chunks_exact_mut(half).enumerate() {
                        let from = plane * stride + GROUP;
                        out.copy_from_slice(&row[from..from + half]);
                    }
                }
            }
            first += count;
        }
    }
}

/// Output pulses computed together, sharing loads of input pulses.
const TOGETHER: usize = 4;

/// Slots of the ring: the input pulses needed, and one zero slot.
const fn slots(taps: usize) -> usize {
    2 * (taps + TOGETHER)
}

/// Ring buffer of phase-rotated pulses.
struct Ring<'a> {
    turned: &'a [f32],
    rows: &'a Range<usize>,
    stride: usize,
    half: usize,
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
}

/// Sum one even and `W` odd pulses for each of `N` output pulses from `first` on.
#[inline(always)]
fn mix<L: Lanes, const W: usize, const N: usize>(
    lanes: L,
    ring: &Ring,
    first: usize,
    weights: &[L::Numbers; W],
    mixed: &mut [f32],
) {
    let size = ring.size;
    let mut even = [ring.turned; N];
    for (n, row) in even.iter_mut().enumerate() {
        *row = ring.at((first + n + 1).checked_sub(W / 2).map(|l| 2 * l));
    }
    // In ascending order of pulses.
    let mut odd = [ring.turned; MAX_TAPS + TOGETHER];
    for (m, row) in odd.iter_mut().enumerate().take(W + N - 1) {
        *row = ring.at((first + m + 1).checked_sub(W).map(|l| 2 * l + 1));
    }
    for plane in 0..4 {
        let first = plane * ring.stride + GROUP;
        let plane = first..first + ring.half;
        let (even, odd) = (
            even.map(|row| groups(&row[plane.clone()])),
            odd.map(|row| groups(&row[plane.clone()])),
        );
        let mut rows = mixed.chunks_exact_mut(size);
        let to: [&mut [[f32; GROUP]]; N] = std::array::from_fn(|_| {
            let row = rows.next().expect("one row per output pulse");
            groups_mut(&mut row[plane.clone()])
        });
        for i in 0..ring.half / GROUP {
            for part in (0..GROUP).step_by(L::COUNT) {
                let mut sums = [weights[0]; N];
                for n in 0..N {
                    sums[n] = lanes.load(&even[n][i][part..]);
                }
                for m in 0..W + N - 1 {
                    let value = lanes.load(&odd[m][i][part..]);
                    for n in 0..N {
                        if m >= n && m < n + W {
                            sums[n] = lanes.mul_add(weights[n + W - 1 - m], value, sums[n]);
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

/// Groups of a plane.
#[inline(always)]
fn groups(plane: &[f32]) -> &[[f32; GROUP]] {
    plane.as_chunks().0
}

#[inline(always)]
fn groups_mut(plane: &mut [f32]) -> &mut [[f32; GROUP]] {
    plane.as_chunks_mut().0
}

/// Decimate the samples of a row by two.
#[inline(always)]
fn samples<L: Lanes, const W: usize>(
    lanes: L,
    row: &[f32],
    stride: usize,
    weights: &[L::Numbers; W],
    half: usize,
    out: &mut [f32],
) {
    for part in 0..2 {
        let even = &row[2 * part * stride..(2 * part + 1) * stride];
        let odd = &row[(2 * part + 1) * stride..(2 * part + 2) * stride];
        let out = &mut out[2 * part * half..2 * (part + 1) * half];
        let (to_even, to_odd) = out.split_at_mut(half);
        let to = to_even.chunks_exact_mut(L::COUNT);
        for (i, (to_even, to_odd)) in to.zip(to_odd.chunks_exact_mut(L::COUNT)).enumerate() {
            let from = GROUP + 2 * i * L::COUNT;
            let even = &even[from + 1 - W / 2..][..2 * L::COUNT];
            // From the last tap's sample on.
            let odd = &odd[from + 1 - W..][..W - 1 + 2 * L::COUNT];
            let mut low = lanes.load(even);
            let mut high = lanes.load(&even[L::COUNT..]);
            for tap in 0..W {
                let odd = &odd[W - 1 - tap..];
                low = lanes.mul_add(weights[tap], lanes.load(odd), low);
                high = lanes.mul_add(weights[tap], lanes.load(&odd[L::COUNT..]), high);
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
    halving: &'a Decimation<'a>,
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
            halving, stride, ..
        } = *self;
        let (layout, half) = (halving.layout, halving.layout.half());
        let values = match halving.rows {
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
        match halving.phase_ramps.get(pulse) {
            Some(turning) => self.turned(turning, values, halving.rows_after(pulse), to),
            None => {
                for (plane, values) in values.chunks_exact(half).enumerate() {
                    to[plane * stride + GROUP..][..half].copy_from_slice(values);
                }
            }
        }
    }

    /// Multiply a pulse by its phase ramp, and meanwhile fetch the `next` pulse from memory.
    #[inline(always)]
    fn turned(&self, turning: &PhaseRamp, from: &[f32], next: Next, to: &mut [f32]) {
        let (lanes, stride, half) = (self.lanes, self.stride, self.halving.layout.half());
        let count = half / GROUP;
        let mut planes = from.chunks_exact(half).map(groups);
        let [re_even, re_odd, im_even, im_odd] =
            [(); 4].map(|()| &planes.next().expect("four planes")[..count]);
        let (re, im) = ([re_even, re_odd], [im_even, im_odd]);
        let mut planes = to
            .chunks_exact_mut(stride)
            .map(|plane| groups_mut(&mut plane[GROUP..GROUP + half]));
        let [to_re_even, to_re_odd, to_im_even, to_im_odd] =
            [(); 4].map(|()| &mut planes.next().expect("four planes")[..count]);
        let (to_re, to_im) = ([to_re_even, to_re_odd], [to_im_even, to_im_odd]);
        let step = lanes.splat(reduced(2.0 * turning.step));
        // Phasor from group to group.
        let [on_cos, on_sin] = self.phasor(lanes.splat(reduced(32.0 * turning.step)));
        // Separate recurrences for even and odd samples and for the parts of a group hide the latency.
        let mut phasors = [[[step; 2]; MAX_PARTS]; 2];
        for anew in (0..count).step_by(ANEW) {
            for (odd, phasors) in phasors.iter_mut().enumerate() {
                let first = (2 * GROUP * anew + odd) as f64;
                let base = lanes.splat(reduced(turning.start + turning.step * first));
                for (part, phasor) in phasors.iter_mut().enumerate().take(GROUP / L::COUNT) {
                    let places = lanes.load(&PLACES[part * L::COUNT..]);
                    *phasor = self.phasor(lanes.mul_add(step, places, base));
                }
            }
            for i in anew..(anew + ANEW).min(count) {
                next.prefetch(lanes, i);
                for (odd, phasors) in phasors.iter_mut().enumerate() {
                    let (re, im) = (&re[odd][i], &im[odd][i]);
                    let (to_re, to_im) = (&mut to_re[odd][i], &mut to_im[odd][i]);
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
