//! Column step of the fixed-point engine: motion compensation and scaled Doppler transform (keystone) of one frequency.
//!
//! **Equation**, with `u_m = m - (M - 1)/2` and `z_m` the sample times its weight and the patch's phasor:
//!
//! ```text
//! X(d) = sum_m z_m exp(-j 2 pi a_k u_m d / D)
//! ```
//!
//! Pulses `u` and `-u` are folded into `e_u = z_u + z_-u` and `o_u = z_u - z_-u`. With
//! `A = z_0 + sum_{u>0} e_u cos(2 pi a_k u d / D)` and `B = sum_{u>0} o_u sin(2 pi a_k u d / D)` one pass
//! gives both `X(+d) = A - j B` and `X(-d) = A + j B` for two real multiplications per pulse and bin.
//!
//! **Fixed-point scaling and headroom.** A part of a sample is at most 1 in magnitude, so a part of `z_m` is at
//! most `sqrt 2`. With `g` guard bits, `M 2^-g < 4` ([`guard_bits`]), and a phasor magnitude of at most
//! `1 + 2^-20`:
//!
//! | number | type | unit | at most |
//! |---|---|---|---|
//! | `z_m` | i32 | `2^(g - 29)` | `sqrt 2` is `2^(29.5 - g)` |
//! | `e_u`, `o_u` | i32 | `2^(g - 29)` | `2^(30.5 - g)` |
//! | cosine, sine | i32 | `2^-30` | `2^30 + 2^10` |
//! | `A`, `B` | i64 | `2^(g - 59)` | `M sqrt 2` is below `2^61.5` |
//! | `X` | i64, then its upper half | `2^(g - 59)`, `2^(g - 27)` | below `2^62.5`, `2^30.5` |
//!
//! No sum can overflow. With 30 pulses `g = 3`, so one unit of `z` is `2^-11` of a sample unit.
//!
//! **Cost.** A processor with 13 free registers holds one complex 64-bit sum, not two together with a phasor and its
//! step. The steps are therefore separate, each for a block of eight pairs in straight code: phasors into a
//! [`Scratch`], then `A`, then `B`. Cells and `black_box(())` keep the compiler from merging or reordering the steps; they
//! have no effect on the result.

use core::cell::Cell;
use core::hint::black_box;

use num_complex::Complex;

use super::{block, sine};
use crate::{Sc16, Turns};

/// Compensation phase and weight of one pulse for the current patch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PulsePhase {
    /// Phase at frequency 0.
    pub(super) start: Turns,
    /// Phase increment per frequency.
    pub(super) step: Turns,
    /// Slow-time weight in units of `2^-31`, relative to the power of two of the largest weight.
    pub(super) weight: i32,
    /// Weighted phasor at the current frequency in units of `2^-30`, and the rotation to the next frequency.
    pub(super) value: Complex<i32>,
    pub(super) rotation: Complex<i32>,
}

impl PulsePhase {
    /// Zero phase and weight; initial value of a buffer.
    pub const EMPTY: Self = Self {
        start: Turns(0),
        step: Turns(0),
        weight: 0,
        value: Complex { re: 0, im: 0 },
        rotation: Complex { re: 0, im: 0 },
    };

    /// Weighted phasor of frequency `k`. Frequencies must be visited in ascending order from 0.
    #[inline]
    fn at(&mut self, k: usize) -> Complex<i32> {
        self.value = if k.is_multiple_of(ANCHOR) {
            let phasor = sine::phasor(self.start.plus(self.step.times(k as i64)));
            let weighted = |part: i32| ((i64::from(part) * i64::from(self.weight)) >> 31) as i32;
            Complex::new(weighted(phasor.re), weighted(phasor.im))
        } else {
            sine::rotated(self.value, self.rotation)
        };
        self.value
    }
}

/// Number of frequencies from one directly computed phasor to the next. In between, each rotation adds an error of at
/// most 8 units of `2^-30` per part: 2 from each part of the rotation, and 4 from its own rounding. After 15
/// rotations the total error, that of the first phasor included, is below 128 units, which is `2^-23`.
const ANCHOR: usize = 16;

/// Guard bits `g`: the smallest with `num_pulses 2^-g < 4`.
pub(super) fn guard_bits(num_pulses: usize) -> u32 {
    num_pulses
        .checked_ilog2()
        .map_or(0, |bits| bits.saturating_sub(1))
}

/// Folded pulses of one frequency.
pub(super) struct Folded<'a> {
    /// `e_u` and `o_u` in ascending `u`.
    pairs: &'a [[Complex<i32>; 2]],
    /// `z_0` if the number of pulses is odd.
    centre: Option<Complex<i32>>,
}

/// Compensate `samples` (one per pulse) at frequency `k` and fold them in `buffer` (one element per pulse).
pub(super) fn fold<'a>(
    phases: &mut [PulsePhase],
    samples: impl DoubleEndedIterator<Item = Sc16> + ExactSizeIterator + Clone,
    k: usize,
    guard_bits: u32,
    buffer: &'a mut [Complex<i32>],
) -> Folded<'a> {
    // Sample (2^-31) times phasor (2^-30) is rounded to units of 2^-29, which fit 32 bits, and then to 2^(g - 29).
    let half = guard_bits
        .checked_sub(1)
        .map_or(0, |last| 1i32.wrapping_shl(last));
    let narrowed = |x: i32| x.wrapping_add(half) >> guard_bits;
    let compensated = |(phase, sample): (&PulsePhase, Sc16)| {
        let wide = |part: i16| i32::from(part) << 16;
        let sample = Complex::new(wide(sample.re.to_bits()), wide(sample.im.to_bits()));
        let z = sine::product(sample, phase.value);
        Complex::new(narrowed(z.re), narrowed(z.im))
    };
    for phase in phases.iter_mut() {
        phase.at(k);
    }
    let (pairs, centre) = buffer.as_chunks_mut::<2>();
    let middle = phases.len() / 2;
    // From the outermost pair to the middle.
    let before = phases.iter().zip(samples.clone());
    let after = phases.iter().rev().zip(samples.clone().rev());
    for (pair, (before, after)) in pairs.iter_mut().rev().zip(before.zip(after)) {
        let (x, y) = (compensated(after), compensated(before));
        *pair = [x + y, x - y];
    }
    let mut pulses = phases.iter().zip(samples);
    Folded {
        pairs,
        centre: centre
            .first()
            .and_then(|_| pulses.nth(middle))
            .map(compensated),
    }
}

impl Folded<'_> {
    /// `X(0)` in units of `2^(g - 27)`.
    pub(super) fn zero_bin(&self) -> Complex<i32> {
        let centre = self.centre.unwrap_or_default();
        let (mut re, mut im) = (i64::from(centre.re), i64::from(centre.im));
        for [e, _] in self.pairs {
            re += i64::from(e.re);
            im += i64::from(e.im);
        }
        let upper = |x: i64| ((x + 2) >> 2) as i32;
        Complex::new(upper(re), upper(im))
    }

    /// Half pulses from the middle to the first pair: `u = 1/2` or `u = 1`.
    fn first(&self) -> i64 {
        if self.centre.is_some() { 2 } else { 1 }
    }

    /// Write `X(-d)` and `X(+d)` times `gain` to bin `d` of `bins`, which begin with `d = 1`. Returns the peak of
    /// the parts. `half_turn` is the phase of bin 1 per half pulse, `a_k / (2 D)` turns.
    #[inline(never)]
    pub(super) fn bins(&self, half_turn: Turns, bins: &[Bin], gain: Gain) -> u32 {
        fill_phasors(bins, half_turn, self.first());
        // The sum A starts at the central pulse, and at half of the unit dropped at the end.
        let widened = |part: i32| (i64::from(part) << sine::FRACTION_BITS) + (1 << 31);
        let centre = self.centre.unwrap_or_default();
        let start = Complex::new(widened(centre.re), widened(centre.im));
        let scratch = Scratch {
            phasors: Default::default(),
            sums: Default::default(),
            starts: [Cell::new(start), Cell::default()],
        };
        let scratch = black_box(&scratch);
        let (blocks, rest) = self.pairs.as_chunks::<BLOCK>();
        // Pairs of zero complete the last block.
        let tail = (!rest.is_empty() || blocks.is_empty())
            .then(|| core::array::from_fn(|j| rest.get(j).copied().unwrap_or_default()));
        let mut peak = 0;
        for (d, [step, turn]) in bins.iter().enumerate() {
            let mut from = &scratch.starts;
            let mut left = blocks;
            while let [pairs, later @ ..] = left {
                let last = scratch.rotate(turn.get(), step.get());
                scratch.add_even(pairs, from);
                left = later;
                if !later.is_empty() || tail.is_some() {
                    let index = blocks.len() - later.len();
                    turn.set(if index.is_multiple_of(RUN) {
                        self.anchor(half_turn.times(d as i64 + 1), index)
                    } else {
                        sine::rotated(last, step.get())
                    });
                }
                scratch.add_odd(pairs, from);
                from = &scratch.sums;
            }
            if let Some(pairs) = &tail {
                scratch.rotate(turn.get(), step.get());
                scratch.add_even(pairs, from);
                scratch.add_odd(pairs, from);
            }
            let [a, b] = &scratch.sums;
            let (a, b) = (a.get(), b.get());
            let scaled = |x: i64| gain.times((x >> 32) as i32);
            let above = Complex::new(scaled(a.re + b.im), scaled(a.im - b.re));
            let below = Complex::new(scaled(a.re - b.im), scaled(a.im + b.re));
            turn.set(above);
            step.set(below);
            peak = block::peak(block::peak(peak, above), below);
        }
        peak
    }

    /// Phasor of the first pair of block `index`. `half_turn` is that of the bin.
    #[cold]
    #[inline(never)]
    fn anchor(&self, half_turn: Turns, index: usize) -> Complex<i32> {
        sine::phasor(half_turn.times(self.first() + (2 * BLOCK * index) as i64))
    }
}

/// `X(-d)` and `X(+d)`; before, the phasors of two half pulses and of the first pair.
pub(super) type Bin = [Cell<Complex<i32>>; 2];

/// `e_u` and `o_u` of consecutive `u`.
type Block = [[Complex<i32>; 2]; BLOCK];

/// Number of pulse pairs in a block.
const BLOCK: usize = 8;

/// Number of blocks between directly computed phasors, 64 pairs. Bounds the rounding error to `2^-21` of a run for any
/// number of pulses.
const RUN: usize = 8;

/// Phasors of a block and the sums of a bin, in memory.
struct Scratch {
    /// Phasors, each followed by a gap. Without it, the compiler does not store both parts in one instruction.
    phasors: [[Cell<Complex<i32>>; 2]; BLOCK],
    /// `A` and `B`.
    sums: [Cell<Complex<i64>>; 2],
    /// `A` and `B` before the first pair.
    starts: [Cell<Complex<i64>>; 2],
}

impl Scratch {
    /// Compute the phasors of a block. `turn` is the first; returns the last.
    #[inline(always)]
    fn rotate(&self, mut turn: Complex<i32>, step: Complex<i32>) -> Complex<i32> {
        for (j, [phasor, _]) in self.phasors.iter().enumerate() {
            if j > 0 {
                turn = sine::rotated(turn, step);
            }
            phasor.set(turn);
            black_box(());
        }
        turn
    }

    /// Add the terms of `A`.
    #[inline(always)]
    fn add_even(&self, pairs: &Block, [from, _]: &[Cell<Complex<i64>>; 2]) {
        let mut sum = from.get();
        for ([e, _], [phasor, _]) in pairs.iter().zip(&self.phasors) {
            let cos = i64::from(phasor.get().re);
            sum.re += i64::from(e.re) * cos;
            sum.im += i64::from(e.im) * cos;
        }
        let [a, _] = &self.sums;
        a.set(sum);
        black_box(());
    }

    /// Add the terms of `B`.
    #[inline(always)]
    fn add_odd(&self, pairs: &Block, [_, from]: &[Cell<Complex<i64>>; 2]) {
        let mut sum = from.get();
        for ([_, o], [phasor, _]) in pairs.iter().zip(&self.phasors) {
            let sin = i64::from(phasor.get().im);
            sum.re += i64::from(o.re) * sin;
            sum.im += i64::from(o.im) * sin;
        }
        let [_, b] = &self.sums;
        b.set(sum);
        black_box(());
    }
}

/// Write the phasors of two half pulses and of the first pair, at `first` half pulses, to each bin.
#[inline(never)]
fn fill_phasors(bins: &[Bin], half_turn: Turns, first: i64) {
    let double = half_turn.times(2);
    let (mut turns, mut double_turns) = (half_turn, double);
    for [step, turn] in bins {
        turn.set(Complex::new(sine::phase(turns) as i32, 0));
        step.set(Complex::new(sine::phase(double_turns) as i32, 0));
        turns = turns.plus(half_turn);
        double_turns = double_turns.plus(double);
        black_box(());
    }
    to_phasors(bins);
    if first == 2 {
        for [step, turn] in bins {
            turn.set(step.get());
        }
        return;
    }
    // One half pulse of bin 2 d is two of bin d.
    let turns = bins.as_flattened().get(1..).unwrap_or_default();
    let (turns, last) = turns.as_chunks::<4>();
    to_phasors(turns);
    if let [turn, ..] = last {
        turn.set(sine::of_phase(turn.get().re as u32));
    }
    let from_second = bins.get(1..).unwrap_or_default();
    for ([step, _], bins) in bins.iter().zip(from_second.chunks(2)) {
        if let [[_, turn], ..] = bins {
            turn.set(step.get());
        }
    }
}

/// Replace the phase in the real part of every `N`-th element by its phasor.
#[inline(never)]
fn to_phasors<const N: usize>(phases: &[[Cell<Complex<i32>>; N]]) {
    for phases in phases {
        if let Some(phase) = phases.first() {
            phase.set(sine::of_phase(phase.get().re as u32));
            black_box(());
        }
    }
}

/// Factor of a column in units of `2^-31`.
#[derive(Clone, Copy)]
pub(super) struct Gain {
    /// Twice the factor is `whole 2^32 + fraction`, so that a product is a multiplication and the upper half of another.
    whole: i32,
    fraction: i32,
}

impl Gain {
    /// `mantissa 2^-31`.
    pub(super) fn new(mantissa: i32) -> Self {
        let double = i64::from(mantissa) << 1;
        let fraction = double as i32;
        Self {
            whole: ((double - i64::from(fraction)) >> 32) as i32,
            fraction,
        }
    }

    /// Product rounded to nearest. `x` must be at most `2^30.5`.
    #[inline]
    pub(super) fn times(self, x: i32) -> i32 {
        let whole = i64::from(self.whole * x) << 32;
        let product = whole + i64::from(x) * i64::from(self.fraction);
        ((product + (1 << 31)) >> 32) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bin `d` by one loop over the pairs, with a phasor computed directly every 64 pairs. Returns `X(-d)` and `X(+d)`.
    fn direct(folded: &Folded<'_>, half_turn: Turns, mantissa: i32) -> [Complex<i32>; 2] {
        let centre = folded.centre.unwrap_or_default();
        let widened = |part: i32| i64::from(part) << 30;
        let mut a = Complex::new(widened(centre.re), widened(centre.im));
        let (mut b, mut turn) = (Complex::new(0, 0), Complex::new(0, 0));
        for (n, [e, o]) in folded.pairs.iter().enumerate() {
            turn = if n % 64 == 0 {
                sine::phasor(half_turn.times(folded.first() + 2 * n as i64))
            } else {
                sine::rotated(turn, sine::phasor(half_turn.times(2)))
            };
            let (cos, sin) = (i64::from(turn.re), i64::from(turn.im));
            a += Complex::new(i64::from(e.re) * cos, i64::from(e.im) * cos);
            b += Complex::new(i64::from(o.re) * sin, i64::from(o.im) * sin);
        }
        let scaled = |x: i64| {
            let x = (x + (1 << 31)) >> 32;
            ((x * i64::from(mantissa) + (1 << 30)) >> 31) as i32
        };
        [
            Complex::new(scaled(a.re - b.im), scaled(a.im + b.re)),
            Complex::new(scaled(a.re + b.im), scaled(a.im - b.re)),
        ]
    }

    #[test]
    fn blocks_equal_one_loop_over_the_pairs_bit_by_bit() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
            (state >> 32) as i32
        };
        let mut buffer = [[Complex::new(0, 0); 2]; 150];
        for round in 0..2000 {
            let pulses = random() as usize % if round % 10 == 0 { 301 } else { 67 };
            let bits = guard_bits(pulses.max(1));
            let mut part = || random() >> (2 + bits);
            for element in buffer.as_flattened_mut() {
                *element = Complex::new(part(), part());
            }
            let centre = (pulses % 2 == 1).then(|| Complex::new(part(), part()));
            let folded = Folded {
                pairs: buffer.get(..pulses / 2).unwrap_or_default(),
                centre,
            };
            let half_turn = Turns((random() as u64) << 32 | random() as u32 as u64);
            let normal = 1 << 30 | (random() & 0x3fff_ffff);
            let mantissa = [normal, -normal, 1 << 30, -(1 << 30), 0][round % 5];
            let cells: [Bin; 19] = Default::default();
            let (bins, _) = cells.split_at(random() as usize % cells.len());
            let peak = folded.bins(half_turn, bins, Gain::new(mantissa));
            let mut direct_peak = 0;
            for (d, [below, above]) in (1..).zip(bins) {
                let expected = direct(&folded, half_turn.times(d), mantissa);
                let context = (pulses, d, mantissa);
                assert_eq!([below.get(), above.get()], expected, "{context:?}");
                direct_peak = expected.into_iter().fold(direct_peak, block::peak);
            }
            assert_eq!(peak, direct_peak);
        }
    }
}
