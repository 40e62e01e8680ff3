//! Clutter of known covariance.

use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// Generator for a block of cells of a test.
pub(crate) fn random(seed: u64, block: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(block);
    random
}

/// Circular complex Gaussian sample of mean square 1.
pub(crate) fn gaussian(random: &mut ChaCha8Rng) -> Complex64 {
    let mut normal = || -> f64 { StandardNormal.sample(random) };
    Complex64::new(normal(), normal()) * std::f64::consts::FRAC_1_SQRT_2
}

/// First-order autoregressive clutter of power 1: `R_ij = rho^(i - j)` for `i >= j`, from a recursion that needs no matrix.
#[derive(Clone, Copy)]
pub(crate) struct Clutter {
    pub(crate) rho: Complex64,
}

impl Clutter {
    pub(crate) fn sample(self, random: &mut ChaCha8Rng, cell: &mut [Complex64]) {
        let innovation = (1.0 - self.rho.norm_sqr()).sqrt();
        let mut last = gaussian(random);
        for (i, value) in cell.iter_mut().enumerate() {
            if i > 0 {
                last = self.rho * last + gaussian(random) * innovation;
            }
            *value = last;
        }
    }

    /// Covariance matrix of `n` elements, row by row.
    pub(crate) fn matrix(self, n: usize) -> Vec<Complex64> {
        let element = |i: usize, j: usize| match i >= j {
            true => self.rho.powu((i - j) as u32),
            false => self.rho.conj().powu((j - i) as u32),
        };
        (0..n * n).map(|k| element(k / n, k % n)).collect()
    }

    /// `s^H R^-1 s` from the recursion: the power of the whitened innovations of `s`.
    pub(crate) fn snr(self, steering: &[Complex64]) -> f64 {
        let innovations = steering
            .windows(2)
            .map(|s| (s[1] - self.rho * s[0]).norm_sqr());
        steering[0].norm_sqr() + innovations.sum::<f64>() / (1.0 - self.rho.norm_sqr())
    }
}

/// Clutter of most tests: correlation 0.9 between neighbours.
pub(crate) const CLUTTER: Clutter = Clutter {
    rho: Complex64::new(0.72, 0.54),
};

/// Steering vector of `n` elements with a phase step in rad.
pub(crate) fn steering(n: usize, step_rad: f64) -> Vec<Complex64> {
    (0..n)
        .map(|i| Complex64::cis(step_rad * i as f64))
        .collect()
}
