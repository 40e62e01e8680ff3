//! Sine and cosine of phases in cycles, by polynomials.

use num_complex::Complex64;

use crate::lanes::{Instructions, Kernel, Lanes};

/// RMS error of phasors in tiles, including 16 steps of phasor recurrence.
pub const PHASOR_RMS: f64 = 2e-6;

/// Rounding constant: added to and subtracted from a number below 2^22, it rounds to the nearest integer.
pub(crate) const ROUND: f32 = 12_582_912.0;

/// Rounding constant for float64 below 2^51.
pub(crate) const ROUND_F64: f64 = 6_755_399_441_055_744.0;

/// Nearest integer, for magnitudes below 2^51.
#[inline(always)]
pub(crate) fn nearest(x: f64) -> f64 {
    (x + ROUND_F64) - ROUND_F64
}

/// Phase modulo one cycle, within half a cycle, for phases below 2^22.
#[inline(always)]
pub(crate) fn reduced<L: Lanes>(lanes: L, turns: L::Numbers) -> L::Numbers {
    let round = lanes.splat(ROUND);
    lanes.sub(turns, lanes.sub(lanes.add(turns, round), round))
}

/// Minimax polynomials in the squared phase over half a cycle to either side: errors 4e-7 (sine) and 4e-8 (cosine), plus rounding.
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

/// Evaluator of phasors.
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

    /// Cosine and sine of `2 pi turns` for at most half a cycle; error 3e-7.
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

/// Compute `exp(j 2 pi turns)` in float64 for many phases, each below 2^51 turns; the error is 3e-16 plus the rounding of the phase.
///
/// # Panics
/// If the numbers of phases and phasors differ.
pub fn phasors(instructions: Instructions, turns: &[f64], phasors: &mut [Complex64]) {
    assert_eq!(turns.len(), phasors.len());
    instructions.run(Phasors { turns, phasors });
}

struct Phasors<'a> {
    turns: &'a [f64],
    phasors: &'a mut [Complex64],
}

/// Taylor coefficients of sine and cosine in the squared angle, enough for an eighth of a turn.
const SIN_TAYLOR: [f64; 8] = [
    1.0,
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 1_307_674_368_000.0,
];
const COS_TAYLOR: [f64; 9] = [
    1.0,
    -0.5,
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 20_922_789_888_000.0,
];

impl Kernel for Phasors<'_> {
    type Output = ();

    /// A plain loop without branches, vectorised by the compiler.
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        for (phasor, &turns) in self.phasors.iter_mut().zip(self.turns) {
            let left = turns - nearest(turns);
            let quarter = nearest(4.0 * left);
            let angle = std::f64::consts::TAU * (left - 0.25 * quarter);
            let square = angle * angle;
            let mut sin = SIN_TAYLOR[SIN_TAYLOR.len() - 1];
            for k in (0..SIN_TAYLOR.len() - 1).rev() {
                sin = sin * square + SIN_TAYLOR[k];
            }
            sin *= angle;
            let mut cos = COS_TAYLOR[COS_TAYLOR.len() - 1];
            for k in (0..COS_TAYLOR.len() - 1).rev() {
                cos = cos * square + COS_TAYLOR[k];
            }
            // Quarters -2 to 2.
            let is_odd = quarter == 1.0 || quarter == -1.0;
            let sign = if quarter == 2.0 || quarter == -2.0 {
                -1.0
            } else {
                1.0
            };
            let re = if is_odd { -quarter * sin } else { sign * cos };
            let im = if is_odd { quarter * cos } else { sign * sin };
            *phasor = Complex64::new(re, im);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Portable;

    /// RMS error of phasors within `turns` cycles, against float64.
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
    fn many_phasors_match_libm() {
        let turns: Vec<f64> = (-4000..4000)
            .map(|i| f64::from(i) * 0.062_5 + 1e4 / 3.0)
            .collect();
        let turns = [
            turns,
            vec![0.0, 0.125, -0.125, 0.375, 0.5, -0.5, 1e9 + 0.25],
        ]
        .concat();
        let mut first = None;
        for instructions in Instructions::available() {
            let mut got = vec![Complex64::ZERO; turns.len()];
            phasors(instructions, &turns, &mut got);
            for (got, &turns) in got.iter().zip(&turns) {
                let expected = subaperture_signal::phase::phasor(turns);
                assert!((got - expected).norm() < 4e-16, "{turns}: {got} {expected}");
            }
            assert_eq!(*first.get_or_insert(got.clone()), got, "{instructions:?}");
        }
    }

    #[test]
    fn phasor_errors_are_as_documented() {
        let lanes = Portable;
        let polynomials = Polynomials::new(lanes);
        let got = rms(0.5, |turns| {
            let [cos, sin] = polynomials.at(lanes, lanes.splat(turns));
            [cos[0], sin[0]]
        });
        assert!(got < 3e-7, "{got}");
    }
}
