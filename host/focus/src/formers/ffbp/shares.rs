//! How the bound on the error is shared out.

use super::thinned::pays;
use crate::{MARGIN_DB, rounding};
use subaperture_kernels::halving::halved;
use subaperture_signal::halfway::{Halfway, TAPS};
use subaperture_signal::range_profile::RangeProfiler;

/// The relative RMS errors that the bound allows each cause.
#[derive(Clone, Debug)]
pub(super) struct Shares {
    /// Interpolates halfway.
    kernel: Halfway,
    /// One halving over pulses.
    pub(super) slow: f64,
    /// One halving over samples.
    fast: f64,
    /// Antennas that are not smooth.
    pub(super) rough: f64,
    /// Range profiles.
    pub(super) profile: f64,
    /// Polynomials of tiles' paths.
    pub(super) tiles: f64,
    /// Phasors and places of tiles in float32, or there are none.
    pub(super) arithmetic: f64,
    /// Widest band over which the kernel errs by no more than a halving over samples may, cycles a sample.
    pub(super) band: f64,
    /// Most halvings, over pulses and over samples.
    halvings: [usize; 2],
    /// Whether kernels are good enough to halve at all.
    pub(super) decimate: bool,
}

/// Of the splines that range profiles are read as.
pub(super) const DEGREE: usize = 3;

/// Shares of the error's power.
const SLOW: f64 = 0.35;
const FAST: f64 = 0.3;
const ROUGH: f64 = 0.1;
const PROFILE: f64 = 0.15;
const TILES: f64 = 0.05;
const ARITHMETIC: f64 = 0.05;

/// Relative RMS error of the phases of a halving, and of its sums, in float32.
const HALVING: f64 = 2e-6;

/// How often so many places can be halved by so many taps.
fn most_halvings(mut count: usize, taps: usize) -> usize {
    let mut times = 0;
    while pays(count, taps) {
        count = halved(count, taps);
        times += 1;
    }
    times
}

impl Shares {
    /// The shares of a bound for so many pulses and samples.
    pub(super) fn of(error_db: f64, counts: [usize; 2]) -> Self {
        let target = libm::pow(10.0, (error_db - MARGIN_DB) / 20.0);
        let each = TAPS.into_iter().map(|taps| {
            let halvings = counts.map(|count| most_halvings(count, taps).max(1));
            (Halfway::new(taps), halvings)
        });
        let good = |(kernel, [slow, fast]): &(Halfway, [usize; 2])| {
            let error = libm::hypot(kernel.error(), HALVING);
            error <= target * (SLOW / *slow as f64).sqrt()
                && error <= target * (FAST / *fast as f64).sqrt()
        };
        let mut kernels: Vec<_> = each.collect();
        let found = kernels.iter().position(good);
        let (kernel, halvings) = kernels.swap_remove(found.unwrap_or(kernels.len() - 1));
        let fast = target * (FAST / halvings[1] as f64).sqrt();
        Self {
            band: kernel.widest_band((fast * fast - HALVING * HALVING).max(0.0).sqrt()),
            fast,
            slow: target * (SLOW / halvings[0] as f64).sqrt(),
            rough: target * ROUGH.sqrt(),
            profile: target * PROFILE.sqrt(),
            tiles: target * TILES.sqrt(),
            arithmetic: target * ARITHMETIC.sqrt(),
            kernel,
            halvings,
            decimate: found.is_some(),
        }
    }

    /// The kernel at the fraction 1/2.
    pub(super) fn taps(&self) -> Vec<f32> {
        self.kernel.taps().iter().map(|&h| h as f32).collect()
    }

    /// Upsampling of range profiles.
    pub(super) fn oversampling(&self) -> f64 {
        RangeProfiler::oversampling_for(DEGREE, 20.0 * libm::log10(self.profile))
    }

    /// What it comes to, dB, for `num_pulses` pulses and errors of the arithmetic.
    pub(super) fn planned_db(&self, num_pulses: usize, arithmetic: f64) -> f64 {
        let [slow, fast] = self.halvings.map(|times| times as f64);
        let decimations = match self.decimate {
            true => libm::hypot(
                libm::hypot(self.rough, slow.sqrt() * self.slow),
                fast.sqrt() * self.fast,
            ),
            false => 0.0,
        };
        rounding::total_db(&[
            decimations,
            self.profile,
            libm::hypot(self.tiles, self.arithmetic),
            rounding::sum(num_pulses),
            // Transforms and phases of profiles, as `RangeProfiler::rounding` for the longest.
            4e-7,
            arithmetic,
        ])
    }
}
