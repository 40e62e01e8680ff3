//! Division of the error bound among its causes.

use super::maps::MapKernels;
use super::thinned::pays;
use crate::{MARGIN_DB, rounding};
use subaperture_kernels::decimation::halved;
use subaperture_signal::halfway::{MidpointKernel, TAPS};
use subaperture_signal::range_profile::RangeProfiler;

/// Relative RMS errors allowed for each cause.
#[derive(Clone, Debug)]
pub(super) struct Shares {
    /// Interpolator at the midpoint between samples.
    kernel: MidpointKernel,
    /// Error of one decimation over pulses.
    pub(super) slow: f64,
    /// Error of one decimation over samples.
    fast: f64,
    /// Error from antenna tracks that are not smooth.
    pub(super) rough: f64,
    /// Error of range profiles.
    pub(super) profile: f64,
    /// Error of the path polynomials of tiles.
    pub(super) tiles: f64,
    /// Error of float32 phasors and positions in tiles; tiles are not used where it is exceeded.
    pub(super) arithmetic: f64,
    /// Widest band, cycles per sample, with a kernel error within `fast`.
    pub(super) band: f64,
    /// Largest number of decimations over pulses and over samples.
    halvings: [usize; 2],
    /// Whether the bound permits decimation at all.
    pub(super) decimate: bool,
}

/// Degree of the splines that interpolate range profiles.
pub(super) const DEGREE: usize = 3;

/// Share of the error power.
const SLOW: f64 = 0.35;
const FAST: f64 = 0.3;
const ROUGH: f64 = 0.1;
const PROFILE: f64 = 0.15;
const TILES: f64 = 0.05;
const ARITHMETIC: f64 = 0.05;

/// Shares of a patch imaged by maps, which has no range profiles and tiles: each of the four kernels, and the path model.
const MAP_KERNEL: f64 = 0.04;
const MAP_MODEL: f64 = PROFILE + TILES + ARITHMETIC - 4.0 * MAP_KERNEL;

/// Relative RMS error of phases and sums of one decimation in float32.
const HALVING: f64 = 2e-6;

/// Number of profitable decimations of `count` samples with the given taps.
fn most_halvings(mut count: usize, taps: usize) -> usize {
    let mut times = 0;
    while pays(count, taps) {
        count = halved(count, taps);
        times += 1;
    }
    times
}

impl Shares {
    /// Divide a bound for the given numbers of pulses and samples.
    pub(super) fn of(error_db: f64, counts: [usize; 2]) -> Self {
        let target = libm::pow(10.0, (error_db - MARGIN_DB) / 20.0);
        let each = TAPS.into_iter().map(|taps| {
            let halvings = counts.map(|count| most_halvings(count, taps).max(1));
            (MidpointKernel::new(taps), halvings)
        });
        let good = |(kernel, [slow, fast]): &(MidpointKernel, [usize; 2])| {
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

    /// Kernels of range-Doppler maps; `None` if every kernel has a larger error.
    pub(super) fn map_kernels(&self) -> Option<MapKernels> {
        let target = self.profile / PROFILE.sqrt();
        MapKernels::of(target * MAP_KERNEL.sqrt(), target * MAP_MODEL.sqrt())
    }

    /// Kernel taps at the fraction 1/2.
    pub(super) fn taps(&self) -> Vec<f32> {
        self.kernel.taps().iter().map(|&h| h as f32).collect()
    }

    /// Upsampling factor of range profiles.
    pub(super) fn oversampling(&self) -> f64 {
        RangeProfiler::oversampling_for(DEGREE, 20.0 * libm::log10(self.profile))
    }

    /// Planned error, dB, for `num_pulses` pulses and the given arithmetic error.
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
            // Rounding of transforms and profile phases, `RangeProfiler::rounding` for the longest profile.
            4e-7,
            arithmetic,
        ])
    }
}
