//! Division of the error bound among its causes.

use super::maps::MapKernels;
use super::thinned::pays;
use crate::{MARGIN_DB, rounding};
use subaperture_kernels::decimation::halved;
use subaperture_signal::halfway::{MidpointKernel, TAPS};
use subaperture_signal::range_profile::RangeProfiler;

/// Interpolation kernel of decimations: taps and band, cycles per sample. Wider bands leave fewer samples, more taps extend every history.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct KernelChoice {
    taps: usize,
    band: f64,
}

/// Candidate bands, cycles per sample.
const BANDS: [f64; 15] = [
    0.14, 0.16, 0.18, 0.2, 0.22, 0.24, 0.26, 0.28, 0.3, 0.32, 0.34, 0.36, 0.38, 0.4, 0.42,
];

/// Band below which a kernel with more taps is usually faster.
const NARROW: f64 = 0.22;

impl KernelChoice {
    /// Kernels that keep a bound for the given numbers of pulses and samples: of each number of taps the one with the widest band. Those with
    /// few taps come first, except if their band is narrow.
    pub(super) fn within(error_db: f64, counts: [usize; 2]) -> Vec<Self> {
        let of = |taps: usize| {
            let (halvings, target) = (halvings(counts, taps), target(error_db));
            let allowed = shared(target, SLOW, halvings[0]).min(shared(target, FAST, halvings[1]));
            let keeps = |band: f64| {
                libm::hypot(MidpointKernel::new(taps, band).error(), HALVING) <= allowed
            };
            let count = BANDS.partition_point(|&band| keeps(band));
            let band = *BANDS.get(count.checked_sub(1)?)?;
            Some(Self { taps, band })
        };
        let mut kernels: Vec<Self> = TAPS.into_iter().filter_map(of).collect();
        kernels.sort_by_key(|kernel| kernel.band < NARROW);
        kernels
    }
}

/// Relative RMS errors allowed for each cause.
#[derive(Clone, Debug)]
pub(super) struct Shares {
    /// Interpolator at the midpoint between samples.
    kernel: MidpointKernel,
    /// Error of one decimation over pulses, over a patch.
    slow: f64,
    /// The same at the edge of a patch: pixels closer to its centre have a smaller error.
    pub(super) slow_edge: f64,
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

fn halvings(counts: [usize; 2], taps: usize) -> [usize; 2] {
    counts.map(|count| most_halvings(count, taps).max(1))
}

/// Relative RMS error planned for, below the bound by the margin.
fn target(error_db: f64) -> f64 {
    libm::pow(10.0, (error_db.clamp(-300.0, 0.0) - MARGIN_DB) / 20.0)
}

/// Kernels of range-Doppler maps for a bound; `None` if every kernel has a larger error.
pub(super) fn map_kernels(error_db: f64) -> Option<MapKernels> {
    let target = target(error_db);
    MapKernels::of(target * MAP_KERNEL.sqrt(), target * MAP_MODEL.sqrt())
}

/// Error of each of `parts` equal ones that have a share of the error power together.
fn shared(target: f64, share: f64, parts: usize) -> f64 {
    target * (share / parts as f64).sqrt()
}

impl Shares {
    /// Divide a bound for the given numbers of pulses and samples. Without a kernel, histories are not decimated.
    pub(super) fn of(error_db: f64, counts: [usize; 2], chosen: Option<KernelChoice>) -> Self {
        let target = target(error_db);
        let KernelChoice { taps, band } = chosen.unwrap_or(KernelChoice {
            taps: TAPS[0],
            band: 0.25,
        });
        let kernel = MidpointKernel::new(taps, band);
        let halvings = halvings(counts, taps);
        let [slow, fast] = [
            shared(target, SLOW, halvings[0]),
            shared(target, FAST, halvings[1]),
        ];
        let kernel_only = |error: f64| (error * error - HALVING * HALVING).max(0.0).sqrt();
        let slow_band = kernel.widest_band(kernel_only(slow));
        Self {
            band: kernel.widest_band(kernel_only(fast)),
            fast,
            slow,
            slow_edge: (kernel.tone_error(slow_band).abs() * 0.5f64.sqrt()).max(slow),
            rough: target * ROUGH.sqrt(),
            profile: target * PROFILE.sqrt(),
            tiles: target * TILES.sqrt(),
            arithmetic: target * ARITHMETIC.sqrt(),
            kernel,
            halvings,
            decimate: chosen.is_some(),
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn candidate_kernels_have_the_widest_band_that_keeps_the_bound() {
        let counts = [1040, 1024];
        for error_db in [-25.0, -50.0, -80.0] {
            let kernels = KernelChoice::within(error_db, counts);
            assert!(kernels.len() > 1, "{error_db}");
            for kernel in kernels {
                let shares = Shares::of(error_db, counts, Some(kernel));
                let allowed = shares.slow.min(shares.fast);
                let keeps = |band: f64| {
                    libm::hypot(MidpointKernel::new(kernel.taps, band).error(), HALVING) <= allowed
                };
                assert!(keeps(kernel.band), "{error_db}: {kernel:?}");
                let wider = BANDS.into_iter().find(|&band| band > kernel.band);
                assert!(!wider.is_some_and(keeps), "{error_db}: {kernel:?}");
            }
        }
        assert!(KernelChoice::within(-200.0, counts).is_empty());
    }

    /// The mean over tones evenly spread up to the edge is the share.
    #[test]
    fn error_at_the_edge_of_a_patch_corresponds_to_its_mean() {
        let counts = [1040, 1024];
        for kernel in KernelChoice::within(-50.0, counts) {
            let shares = Shares::of(-50.0, counts, Some(kernel));
            let own = MidpointKernel::new(kernel.taps, kernel.band);
            let tones = (1..20_000).map(|i| 0.5 * f64::from(i) / 20_000.0);
            let edge = tones
                .filter(|&x| x >= kernel.band)
                .find(|&x| own.tone_error(x).abs() * 0.5f64.sqrt() >= shares.slow_edge)
                .unwrap();
            let mean = own.error_within(edge);
            assert!(
                (mean / shares.slow - 1.0).abs() < 0.01,
                "{kernel:?}: {mean}"
            );
        }
    }
}
