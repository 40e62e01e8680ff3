//! Multiplication of samples by phasors whose phase is a straight line.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};

/// Samples between two sines of the recurrence in [`rotate`]: its error grows by one rounding of float64 for every [`LANES`] samples.
pub(crate) const RECURRENCE: usize = 64;

/// Multiply sample `k` by `scale exp(+j 2 pi (start + k step))`, start and step in cycles.
pub(crate) fn rotate(line: &mut [Complex32], [start, step]: [f64; 2], scale: f64) {
    let phasor = |cycles: f64| Complex64::cis(TAU * (cycles - cycles.round()));
    let turns = Turns::new(phasor(step));
    for (i, part) in line.chunks_mut(RECURRENCE).enumerate() {
        let first = phasor(start + (i * RECURRENCE) as f64 * step) * scale;
        turns.multiply(part, first);
    }
}

/// Samples that are multiplied together: their recurrences do not wait for one another.
const LANES: usize = 8;

/// Powers `exp(+j k step)` of a phase step.
pub(crate) struct Turns {
    /// Those of the first samples, real and imaginary parts.
    first: [[f64; LANES]; 2],
    /// That of all lanes.
    stride: Complex64,
}

impl Turns {
    /// Powers of `turn`, of magnitude 1.
    pub(crate) fn new(turn: Complex64) -> Self {
        let [mut re, mut im] = [[0.0; LANES]; 2];
        let mut power = Complex64::ONE;
        for (re, im) in re.iter_mut().zip(&mut im) {
            (*re, *im) = (power.re, power.im);
            power *= turn;
        }
        Self {
            first: [re, im],
            stride: power,
        }
    }

    /// Multiply sample `k` of a part by `factor exp(+j k step)`. The error is one rounding of float64 for every [`LANES`] samples, and that of the powers.
    pub(crate) fn multiply(&self, part: &mut [Complex32], factor: Complex64) {
        let [mut re, mut im] = self.first;
        for (re, im) in re.iter_mut().zip(&mut im) {
            let value = factor * Complex64::new(*re, *im);
            (*re, *im) = (value.re, value.im);
        }
        let Complex64 { re: c, im: s } = self.stride;
        let mut groups = part.chunks_exact_mut(LANES);
        for group in &mut groups {
            for k in 0..LANES {
                group[k] *= Complex32::new(re[k] as f32, im[k] as f32);
            }
            for k in 0..LANES {
                (re[k], im[k]) = (re[k] * c - im[k] * s, re[k] * s + im[k] * c);
            }
        }
        for (z, (re, im)) in groups.into_remainder().iter_mut().zip(re.iter().zip(&im)) {
            *z *= Complex32::new(*re as f32, *im as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phasors_agree_with_sines() {
        for (count, start, step, scale) in [(203, 0.3, 0.123, 2.0), (5, -7.25, -0.49, 0.5)] {
            let mut line = vec![Complex32::new(1.0, -1.0); count];
            rotate(&mut line, [start, step], scale);
            for (k, z) in line.iter().enumerate() {
                let expected = Complex64::new(1.0, -1.0)
                    * Complex64::cis(TAU * (start + k as f64 * step))
                    * scale;
                let error = Complex64::new(f64::from(z.re), f64::from(z.im)) - expected;
                // Roundings of the factor and of the product in float32: 2^-23 of a magnitude of 1.4 scale.
                assert!(error.norm() < 3e-7 * scale, "{k}: {error}");
            }
        }
    }
}
