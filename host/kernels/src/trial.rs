//! Deterministic test data.

use num_complex::{Complex32, Complex64};

/// Pseudo-random generator: hashed Weyl sequence.
pub(crate) struct Numbers(u64);

impl Numbers {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed << 32)
    }

    /// Uniform in 0 to 1.
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (bits >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in -1 to 1.
    pub(crate) fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// Complex values of magnitude at most 1.
    pub(crate) fn samples(&mut self, count: usize) -> Vec<Complex32> {
        let one = |_| {
            let magnitude = self.unit();
            let (sin, cos) = libm::sincos(7.0 * self.unit());
            Complex32::new((magnitude * cos) as f32, (magnitude * sin) as f32)
        };
        (0..count).map(one).collect()
    }
}

/// `exp(j 2 pi turns)` in float64.
pub(crate) fn turned(turns: f64) -> Complex64 {
    Complex64::from_polar(1.0, std::f64::consts::TAU * turns.fract())
}

/// Convert to float64.
pub(crate) fn wide(z: Complex32) -> Complex64 {
    Complex64::new(z.re.into(), z.im.into())
}

/// Kaiser-Bessel kernel of `taps` taps at `t` samples, oversampling 2, by the series of `I0`.
pub(crate) fn kaiser_bessel(taps: usize, t: f64) -> f64 {
    let i0 = |x: f64| {
        let mut term = 1.0;
        let mut sum = 1.0;
        for n in 1..60 {
            term *= (x / 2.0 / f64::from(n)).powi(2);
            sum += term;
        }
        sum
    };
    let half = taps as f64 / 2.0;
    let beta = std::f64::consts::PI * (half * half * 2.25 - 0.8).sqrt();
    let inside = 1.0 - (t / half).powi(2);
    if inside < 0.0 {
        return 0.0;
    }
    i0(beta * inside.sqrt()) / i0(beta)
}
