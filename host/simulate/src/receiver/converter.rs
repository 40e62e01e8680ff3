//! Analogue-to-digital converter: I and Q rounded to steps of `2 A / 2^bits`, with `A` the full scale.
//!
//! Codes range from `-2^(bits-1)` to `2^(bits-1) - 1`, and a signal of 0 stays 0. For a signal that covers many steps,
//! the quantisation error is uniform over a step, with power `step^2 / 12`. A sine of amplitude `A` then has a
//! signal-to-quantisation-noise ratio of `3/2 4^bits`, or `6.02 bits + 1.76` dB. Signals above `A` saturate and are
//! counted.

use num_complex::Complex64;

use subaperture_model::radar::Converter;
use subaperture_model::units::amplitude_of_db;

/// Prepared converter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quantiser {
    full_scale: f64,
    step: f64,
    /// Largest code.
    last: f64,
}

impl Quantiser {
    pub(super) fn new(converter: Converter) -> Result<Self, String> {
        let Converter {
            bits,
            full_scale_db,
        } = converter;
        let full_scale = amplitude_of_db(full_scale_db);
        if !((1..=32).contains(&bits) && full_scale.is_finite() && full_scale > 0.0) {
            return Err(format!(
                "converter of {bits} bits with a full scale of {full_scale_db} dB: expected 1 to 32 bits, and a finite full scale"
            ));
        }
        let half = 2f64.powi(bits as i32 - 1);
        Ok(Self {
            full_scale,
            step: full_scale / half,
            last: half - 1.0,
        })
    }

    /// Quantise samples, and return the number of samples whose I or Q exceeds full scale.
    pub(super) fn convert(&self, samples: &mut [Complex64]) -> u32 {
        let code = |x: f64| (x / self.step).round().clamp(-self.last - 1.0, self.last) * self.step;
        let mut saturated = 0;
        for z in samples {
            saturated += u32::from(z.re.abs().max(z.im.abs()) > self.full_scale);
            *z = Complex64::new(code(z.re), code(z.im));
        }
        saturated
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn quantiser(bits: u32) -> Quantiser {
        let converter = Converter {
            bits,
            full_scale_db: 6.0,
        };
        Quantiser::new(converter).unwrap()
    }

    /// Expected: `6.02 b + 1.76` dB below a full-scale tone. The tone is half a step below full scale, at the largest
    /// code, which costs `20 log10(1 - 2^-b)`: 0.03 dB at 8 bits. Over 65536 samples at an irrational frequency, the
    /// error's mean power has a standard error of `sqrt(4/5 / 131072)`, 0.011 dB; four of these are allowed. A sine of
    /// `A` steps dwells at its crests, where the error is not uniform: the Fourier series of the error, squared and
    /// averaged over the sine, is `1/12 (1 + 12 / pi^2 sum_k (-1)^k / k^2 J0(2 pi k A))`, and `|J0(x)| <= sqrt(2 / (pi
    /// x))`, so that the power differs by at most `12 / pi^2 zeta(5/2) / (pi sqrt(A))`: 0.2 dB at 8 bits.
    #[test]
    fn quantisation_noise_matches_number_of_bits() {
        for bits in [8u32, 10, 12, 14] {
            let amplitude = 10f64.powf(0.3) * (1.0 - 0.5f64.powi(bits as i32));
            let tone: Vec<_> = (0..65536)
                .map(|i| Complex64::cis(f64::from(i) * 1.618_033_988_749) * amplitude)
                .collect();
            let mut codes = tone.clone();
            assert_eq!(quantiser(bits).convert(&mut codes), 0);
            let power = |z: &[Complex64]| z.iter().map(Complex64::norm_sqr).sum::<f64>();
            let error: Vec<_> = tone.iter().zip(&codes).map(|(a, b)| a - b).collect();
            let ratio_db = 10.0 * (power(&tone) / power(&error)).log10();
            let full_db = 20.0 * (1.0 - 0.5f64.powi(bits as i32)).log10();
            let expected_db = 6.0206 * f64::from(bits) + 1.7609 + full_db;
            let steps = 2f64.powi(bits as i32 - 1) - 0.5;
            let crests = 12.0 / PI.powi(2) * 1.3415 / (PI * steps.sqrt());
            let tolerance_db = 10.0 * (1.0 + crests).log10() + 0.044;
            let off_db = (ratio_db - expected_db).abs();
            assert!(off_db < tolerance_db, "{bits}: {ratio_db} dB");
        }
    }

    #[test]
    fn samples_beyond_full_scale_saturate_and_are_counted() {
        let full = 10f64.powf(0.3);
        let mut samples = [
            Complex64::new(1.5 * full, 0.0),
            Complex64::new(0.0, -2.0 * full),
            Complex64::new(0.5 * full, -full),
        ];
        assert_eq!(quantiser(4).convert(&mut samples), 2);
        // Codes are eighths of full scale: 7 is the largest, -8 the smallest.
        let expected = [(7.0, 0.0), (0.0, -8.0), (4.0, -8.0)];
        for (z, (i, q)) in samples.iter().zip(expected) {
            let expected = Complex64::new(i, q) * (full / 8.0);
            assert!((z - expected).norm() < 1e-15, "{z}");
        }
        let many = Converter {
            bits: 40,
            full_scale_db: 0.0,
        };
        assert!(Quantiser::new(many).is_err());
    }
}
