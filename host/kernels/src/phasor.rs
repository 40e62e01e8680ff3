//! Sine and cosine of a phase in cycles, by polynomials.

use crate::lanes::Lanes;

/// RMS error of phasors in tiles, including 16 steps of phasor recurrence.
pub const PHASOR_RMS: f64 = 2e-6;

/// Rounding constant: added to and subtracted from a number below 2^22, it rounds to the nearest integer.
pub(crate) const ROUND: f32 = 12_582_912.0;

/// Rounding constant for float64 below 2^51.
pub(crate) const ROUND_F64: f64 = 6_755_399_441_055_744.0;

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
