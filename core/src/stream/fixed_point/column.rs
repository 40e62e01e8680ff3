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

use num_complex::Complex;

use super::sine;
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
/// most 4 units of `2^-30` per part: 2 from each part of the rotation, plus its own rounding. After 15
/// rotations the total error, that of the first phasor included, is below 64 units, which is `2^-24`.
const ANCHOR: usize = 16;

/// Guard bits `g`: the smallest with `num_pulses 2^-g < 4`.
pub(super) fn guard_bits(num_pulses: usize) -> u32 {
    num_pulses
        .checked_ilog2()
        .map_or(0, |bits| bits.saturating_sub(1))
}

/// Folded pulses of one frequency.
pub(super) struct Folded<'a> {
    /// `o_u` in descending `u`.
    odd: &'a [Complex<i32>],
    /// `z_0` if the number of pulses is odd.
    centre: Option<Complex<i32>>,
    /// `e_u` in ascending `u`.
    even: &'a [Complex<i32>],
}

/// Compensate `samples` (one per pulse) at frequency `k` and fold them in `buffer` (one element per pulse).
pub(super) fn fold<'a>(
    phases: &mut [PulsePhase],
    samples: impl Iterator<Item = Sc16>,
    k: usize,
    guard_bits: u32,
    buffer: &'a mut [Complex<i32>],
) -> Folded<'a> {
    // Sample (2^-15) times phasor (2^-30) is narrowed to units of 2^-29, which fit 32 bits, and then to 2^(g - 29).
    // Half of the last dropped unit is added for rounding at the shift that drops it.
    let (half, narrow_half) = match guard_bits.checked_sub(1) {
        Some(last) => (0, 1i32.wrapping_shl(last)),
        None => (1 << 15, 0),
    };
    let narrowed = |x: i64| (((x + half) >> 16) as i32).wrapping_add(narrow_half) >> guard_bits;
    for ((z, phase), sample) in buffer.iter_mut().zip(phases.iter_mut()).zip(samples) {
        let value = phase.at(k);
        let (cos, sin) = (i64::from(value.re), i64::from(value.im));
        let (re, im) = (
            i64::from(sample.re.to_bits()),
            i64::from(sample.im.to_bits()),
        );
        z.re = narrowed(cos * re - sin * im);
        z.im = narrowed(cos * im + sin * re);
    }
    let pairs = buffer.len() / 2;
    let (odd, rest) = buffer.split_at_mut_checked(pairs).unwrap_or_default();
    let surplus = rest.len().saturating_sub(pairs);
    let (centre, even) = rest.split_at_mut_checked(surplus).unwrap_or_default();
    for (before, after) in odd.iter_mut().rev().zip(even.iter_mut()) {
        let (x, y) = (*after, *before);
        (*after, *before) = (x + y, x - y);
    }
    Folded {
        odd,
        centre: centre.first().copied(),
        even,
    }
}

impl Folded<'_> {
    /// `X(0)` in units of `2^(g - 27)`, which both results of [`Folded::bins`] equal at phase 0.
    pub(super) fn zero_bin(&self) -> Complex<i32> {
        let centre = self.centre.unwrap_or_default();
        let (mut re, mut im) = (i64::from(centre.re), i64::from(centre.im));
        for e in self.even {
            re += i64::from(e.re);
            im += i64::from(e.im);
        }
        let upper = |x: i64| ((x + 2) >> 2) as i32;
        Complex::new(upper(re), upper(im))
    }

    /// `X(+d)` and `X(-d)` in units of `2^(g - 27)`. `half_turn` is the phase of bin `d` per half pulse,
    /// `a_k d / (2 D)` turns.
    pub(super) fn bins(&self, half_turn: Turns) -> [Complex<i32>; 2] {
        let widened = |part: i32| i64::from(part) << sine::FRACTION_BITS;
        let (mut a, mut b) = (Complex::new(0, 0), Complex::new(0i64, 0));
        if let Some(centre) = self.centre {
            a = Complex::new(widened(centre.re), widened(centre.im));
        }
        // Half pulses from the middle to the first pair: u = 1/2 or u = 1.
        let first = if self.centre.is_some() { 2 } else { 1 };
        let step = sine::phasor(half_turn.times(2));
        // A directly computed phasor every RUN pairs bounds the rounding error to 2^-24 of a segment for any M.
        let runs = self.even.chunks(RUN).zip(self.odd.rchunks(RUN));
        for (run, (even, odd)) in (0..).zip(runs) {
            let mut turn = sine::phasor(half_turn.times(first + 2 * RUN as i64 * run));
            for (e, o) in even.iter().zip(odd.iter().rev()) {
                let (cos, sin) = (i64::from(turn.re), i64::from(turn.im));
                a.re += i64::from(e.re) * cos;
                a.im += i64::from(e.im) * cos;
                b.re += i64::from(o.re) * sin;
                b.im += i64::from(o.im) * sin;
                turn = sine::rotated(turn, step);
            }
        }
        let upper = |x: i64| ((x + (1 << 31)) >> 32) as i32;
        [
            Complex::new(upper(a.re + b.im), upper(a.im - b.re)),
            Complex::new(upper(a.re - b.im), upper(a.im + b.re)),
        ]
    }
}

/// Number of pulse pairs between directly computed phasors.
const RUN: usize = 64;
