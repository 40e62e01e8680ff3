//! Sine and cosine of a phase in turns.
//!
//! Within tiles by a table and what is left: with the phase `s + x / 32` turns, `s` a multiple of 1/32 and `|x| <= 1/2`,
//!
//! ```text
//! exp(j 2 pi (s + x / 32)) = T[s] (1 - b x^2 + j a x)
//! ```
//!
//! `a` and `b` such that the RMS over `x` is least; coarsely without `b`, and the table smaller by as much as `1 + j a x` is larger.
//! By points, polynomials of higher degree.

use std::sync::LazyLock;

use crate::lanes::Lanes;

/// Places of the table.
const PLACES: usize = 32;

/// Root of the mean square error of a phasor of the table, over phases; coarsely with the first degree alone.
pub const PHASOR_RMS: [f64; 2] = [2.6e-5, 1.5e-3];

/// Radians from place to place.
const STEP: f64 = std::f64::consts::TAU / PLACES as f64;
/// Best straight line through the sine, and best parabola through the cosine, over half a step either way: `sin x = x - x^3 / 6` less what
/// `0.6 h^2 x` takes of the cube, `h` half a step; `cos x = 1 - x^2 / 2 + x^4 / 24` likewise.
const HALF_SQUARE: f64 = STEP * STEP / 4.0;
const LINE: f64 = STEP * (1.0 - HALF_SQUARE / 10.0);
const PARABOLA: f64 = STEP * STEP * (0.5 - HALF_SQUARE / 28.0);
/// Mean of the magnitude of `1 + j x`.
const COARSE_MAGNITUDE: f64 = 1.0 + HALF_SQUARE / 6.0;

/// Cosines and sines at the places of the first quarter, finely and coarsely.
static TABLES: LazyLock<[[[f32; PLACES / 4]; 2]; 2]> = LazyLock::new(|| {
    [1.0, COARSE_MAGNITUDE].map(|magnitude| {
        let [mut cos, mut sin] = [[0.0; PLACES / 4]; 2];
        for (place, (cos, sin)) in cos.iter_mut().zip(&mut sin).enumerate() {
            let (s, c) = libm::sincos(STEP * place as f64);
            (*cos, *sin) = ((c / magnitude) as f32, (s / magnitude) as f32);
        }
        [cos, sin]
    })
});

/// Added to a number below 2^22 and taken off again, it leaves the nearest whole number.
pub(crate) const ROUND: f32 = 12_582_912.0;

/// The same for float64 below 2^51.
pub(crate) const ROUND_F64: f64 = 6_755_399_441_055_744.0;

/// Phasors by the table.
#[derive(Clone, Copy)]
pub(crate) struct Table<L: Lanes> {
    circle: L::Circle,
    round: L::Numbers,
    line: L::Numbers,
    parabola: L::Numbers,
    one: L::Numbers,
}

impl<L: Lanes> Table<L> {
    /// Phases are counted in this part of a turn.
    pub(crate) const A_TURN: f64 = PLACES as f64;

    #[inline(always)]
    pub(crate) fn new(lanes: L, coarse: bool) -> Self {
        Self {
            circle: lanes.circle(&TABLES[usize::from(coarse)]),
            round: lanes.splat(ROUND),
            line: lanes.splat(if coarse { STEP as f32 } else { LINE as f32 }),
            parabola: lanes.splat((PARABOLA / (LINE * LINE)) as f32),
            one: lanes.splat(1.0),
        }
    }

    /// The place in the table of a phase in [`Self::A_TURN`]ths of a turn, fewer than 2^22, and what is left.
    #[inline(always)]
    pub(crate) fn place(&self, lanes: L, phase: L::Numbers) -> [L::Numbers; 2] {
        let pattern = lanes.add(phase, self.round);
        [pattern, lanes.sub(phase, lanes.sub(pattern, self.round))]
    }

    /// Cosine and sine of the phase of [`Self::place`].
    #[inline(always)]
    pub(crate) fn at<const COARSE: bool>(
        &self,
        lanes: L,
        [pattern, left]: [L::Numbers; 2],
    ) -> [L::Numbers; 2] {
        let x = lanes.mul(left, self.line);
        let [mut cos, mut sin] = lanes.of_circle(self.circle, pattern);
        let [across, along] = [sin, cos];
        if !COARSE {
            let shrunk = lanes.neg_mul_add(lanes.mul(x, x), self.parabola, self.one);
            cos = lanes.mul(cos, shrunk);
            sin = lanes.mul(sin, shrunk);
        }
        [
            lanes.neg_mul_add(x, across, cos),
            lanes.mul_add(x, along, sin),
        ]
    }
}

/// Polynomials in the square of the phase over half a turn either way, of least largest error: 4e-7 and 4e-8, beside roundings.
const SIN: [f32; 6] = [
    6.283_182_6,
    -41.341_423,
    81.596_18,
    -76.580_1,
    41.205_395,
    -12.271_26,
];
const COS: [f32; 7] = [
    1.0,
    -19.739_204,
    64.939_12,
    -85.450_165,
    60.167_835,
    -25.968_32,
    6.529_62,
];

/// Phasors by polynomials.
#[derive(Clone, Copy)]
pub(crate) struct Polynomials<L: Lanes> {
    sin: [L::Numbers; SIN.len()],
    cos: [L::Numbers; COS.len()],
}

impl<L: Lanes> Polynomials<L> {
    #[inline(always)]
    pub(crate) fn new(lanes: L) -> Self {
        let mut constants = Self {
            sin: [lanes.splat(0.0); SIN.len()],
            cos: [lanes.splat(0.0); COS.len()],
        };
        for (numbers, &constant) in constants.sin.iter_mut().zip(&SIN) {
            *numbers = lanes.splat(constant);
        }
        for (numbers, &constant) in constants.cos.iter_mut().zip(&COS) {
            *numbers = lanes.splat(constant);
        }
        constants
    }

    /// Cosine and sine of `2 pi turns`, for at most half a turn: good to 3e-7.
    #[inline(always)]
    pub(crate) fn at(&self, lanes: L, turns: L::Numbers) -> [L::Numbers; 2] {
        let square = lanes.mul(turns, turns);
        let mut cos = self.cos[COS.len() - 1];
        for k in (0..COS.len() - 1).rev() {
            cos = lanes.mul_add(cos, square, self.cos[k]);
        }
        let mut sin = self.sin[SIN.len() - 1];
        for k in (0..SIN.len() - 1).rev() {
            sin = lanes.mul_add(sin, square, self.sin[k]);
        }
        [cos, lanes.mul(sin, turns)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Portable;

    /// RMS error of phasors over `turns` to either side, against float64.
    fn rms(turns: f64, of: impl Fn(f32) -> [f32; 2]) -> f64 {
        let count = 100_000;
        let squares = (0..count).map(|i| {
            let phase = (turns * (2.0 * f64::from(i) / f64::from(count) - 1.0)) as f32;
            let (sin, cos) = (std::f64::consts::TAU * f64::from(phase)).sin_cos();
            let [c, s] = of(phase);
            (f64::from(c) - cos).powi(2) + (f64::from(s) - sin).powi(2)
        });
        (squares.sum::<f64>() / f64::from(count)).sqrt()
    }

    #[test]
    fn errors_are_the_stated_ones() {
        let lanes = Portable;
        for (coarse, stated) in [false, true].into_iter().zip(PHASOR_RMS) {
            let table = Table::new(lanes, coarse);
            let got = rms(3.0, |turns| {
                let phase = lanes.splat(turns * Table::<Portable>::A_TURN as f32);
                let place = table.place(lanes, phase);
                let [cos, sin] = match coarse {
                    false => table.at::<false>(lanes, place),
                    true => table.at::<true>(lanes, place),
                };
                [cos[0], sin[0]]
            });
            assert!(got <= stated && got > 0.9 * stated, "{got} {stated}");
        }
        let polynomials = Polynomials::new(lanes);
        let got = rms(0.5, |turns| {
            let [cos, sin] = polynomials.at(lanes, lanes.splat(turns));
            [cos[0], sin[0]]
        });
        assert!(got < 3e-7, "{got}");
    }
}
