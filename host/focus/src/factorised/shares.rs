//! Division of the error bound among its causes.

use super::decimations::{Decimations, FACTORS, most_decimations};
use super::maps::MapKernels;
use crate::{MARGIN_DB, rounding};
use subaperture_signal::decimation_kernel::{DecimationKernel, TAPS};
use subaperture_signal::range_profile::RangeProfiler;

/// Kernel and number of decimations. Wider bands leave fewer samples, more taps extend every history.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct KernelChoice {
    taps: usize,
    /// Band of the design, cycles per retained sample.
    band: f64,
    /// Largest numbers of decimations over pulses and over samples, which share the error of decimations.
    decimations: [usize; 2],
    /// Factors of the first decimation over pulses and over samples, each 2 or 3; later ones are by two.
    first: [usize; 2],
}

/// Candidate bands, cycles per sample.
const BANDS: [f64; 15] = [
    0.14, 0.16, 0.18, 0.2, 0.22, 0.24, 0.26, 0.28, 0.3, 0.32, 0.34, 0.36, 0.38, 0.4, 0.42,
];

/// Band below which a kernel with more taps is usually faster.
const NARROW: f64 = 0.22;

impl KernelChoice {
    /// Kernels that keep a bound with these numbers of decimations over pulses and over samples: of each number of taps the one with the widest
    /// band. Those with few taps come first, except if their band is narrow.
    pub(super) fn within(error_db: f64, decimations: [usize; 2]) -> Vec<Self> {
        let [slow, fast] = decimation_errors(target(error_db), decimations);
        let allowed = slow.min(fast);
        let of = |taps: usize| {
            let keeps = |band: f64| {
                libm::hypot(DecimationKernel::new(2, taps, band).error(), DECIMATION) <= allowed
            };
            let count = BANDS.partition_point(|&band| keeps(band));
            let band = *BANDS.get(count.checked_sub(1)?)?;
            Some(Self {
                taps,
                band,
                decimations,
                first: [FACTORS[0]; 2],
            })
        };
        let mut kernels: Vec<Self> = TAPS.into_iter().filter_map(of).collect();
        kernels.sort_by_key(|kernel| kernel.band < NARROW);
        kernels
    }

    /// Number of taps at each fraction.
    pub(super) fn taps(self) -> usize {
        self.taps
    }

    /// Largest numbers of decimations over pulses and over samples.
    pub(super) fn decimations(self) -> [usize; 2] {
        self.decimations
    }

    /// Kernel with the widest band that keeps a bound with as many decimations as are profitable for the given numbers of pulses and samples.
    pub(super) fn widest(error_db: f64, counts: [usize; 2]) -> Option<Self> {
        let most = counts.map(|count| most_decimations(count).max(1));
        let kernels = Self::within(error_db, most).into_iter();
        kernels.max_by(|a, b| a.band.total_cmp(&b.band))
    }

    /// The same kernel with these factors of the first decimation over pulses and over samples.
    pub(super) fn beginning_with(self, first: [usize; 2]) -> Self {
        Self { first, ..self }
    }

    /// Whether this is one of [`Self::within`] with possible factors of the first decimation.
    pub(super) fn is_within(self, error_db: f64) -> bool {
        let by_two = self.beginning_with([FACTORS[0]; 2]);
        self.first.iter().all(|factor| FACTORS.contains(factor))
            && self
                .decimations
                .iter()
                .all(|count| (1..=MOST).contains(count))
            && Self::within(error_db, self.decimations).contains(&by_two)
    }
}

/// Largest number of decimations over an axis in a plan.
const MOST: usize = 32;

/// Errors of one decimation over pulses and of one over samples, of the given numbers.
fn decimation_errors(target: f64, decimations: [usize; 2]) -> [f64; 2] {
    [
        shared(target, SLOW, decimations[0]),
        shared(target, FAST, decimations[1]),
    ]
}

/// Relative RMS errors allowed for each cause.
#[derive(Clone, Debug)]
pub(super) struct Shares {
    /// Decimations by the kernel.
    decimations: Decimations,
    /// Error of one decimation over pulses, over a patch.
    slow: f64,
    /// The same at the edge of a patch, by two and by three: pixels closer to its centre have a smaller error.
    slow_edge: [f64; 2],
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
    /// Widest band, cycles per retained pulse, with a kernel error within `slow`, by two and by three.
    slow_band: [f64; 2],
    /// Widest band, cycles per retained sample, with a kernel error within `fast`, by two and by three.
    band: [f64; 2],
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
const DECIMATION: f64 = 2e-6;

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
    /// Divide a bound. Without a kernel, histories are not decimated.
    pub(super) fn of(error_db: f64, chosen: Option<KernelChoice>) -> Self {
        let target = target(error_db);
        let kernel = chosen.unwrap_or(KernelChoice {
            taps: TAPS[0],
            band: 0.25,
            decimations: [1; 2],
            first: [FACTORS[0]; 2],
        });
        let kernels = FACTORS.map(|factor| DecimationKernel::new(factor, kernel.taps, kernel.band));
        let [slow, fast] = decimation_errors(target, kernel.decimations);
        let kernel_only = |error: f64| (error * error - DECIMATION * DECIMATION).max(0.0).sqrt();
        let slow_band = kernels
            .each_ref()
            .map(|kernel| kernel.widest_band(kernel_only(slow)));
        let slow_edge = |i: usize| {
            let edge = kernels[i].tone_error(slow_band[i]) * kernels[i].interpolated().sqrt();
            edge.max(slow)
        };
        Self {
            band: kernels
                .each_ref()
                .map(|kernel| kernel.widest_band(kernel_only(fast))),
            fast,
            slow,
            slow_edge: [0, 1].map(slow_edge),
            slow_band,
            rough: target * ROUGH.sqrt(),
            profile: target * PROFILE.sqrt(),
            tiles: target * TILES.sqrt(),
            arithmetic: target * ARITHMETIC.sqrt(),
            decimations: Decimations::new(kernel.decimations, kernel.first, &kernels),
            decimate: chosen.is_some(),
        }
    }

    /// Decimations and their kernels.
    pub(super) fn decimations(&self) -> &Decimations {
        &self.decimations
    }

    /// Widest band of a decimation over samples by `factor`, cycles per retained sample.
    pub(super) fn band(&self, factor: usize) -> f64 {
        self.band[factor - FACTORS[0]]
    }

    /// Widest band of a decimation over pulses by `factor`, cycles per retained pulse.
    pub(super) fn slow_band(&self, factor: usize) -> f64 {
        self.slow_band[factor - FACTORS[0]]
    }

    /// Error of a decimation over pulses by `factor` at the edge of a patch.
    pub(super) fn slow_edge(&self, factor: usize) -> f64 {
        self.slow_edge[factor - FACTORS[0]]
    }

    /// Upsampling factor of range profiles.
    pub(super) fn oversampling(&self) -> f64 {
        RangeProfiler::oversampling_for(DEGREE, 20.0 * libm::log10(self.profile))
    }

    /// Planned error, dB, for `num_pulses` pulses and the given arithmetic error.
    pub(super) fn planned_db(&self, num_pulses: usize, arithmetic: f64) -> f64 {
        let [slow, fast] = self.decimations.most().map(|times| times as f64);
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
        let decimations = [5, 6];
        for error_db in [-25.0, -50.0, -80.0] {
            let kernels = KernelChoice::within(error_db, decimations);
            assert!(kernels.len() > 1, "{error_db}");
            for kernel in kernels {
                let shares = Shares::of(error_db, Some(kernel));
                let allowed = shares.slow.min(shares.fast);
                let keeps = |band: f64| {
                    let kernel = DecimationKernel::new(2, kernel.taps, band);
                    libm::hypot(kernel.error(), DECIMATION) <= allowed
                };
                assert!(keeps(kernel.band), "{error_db}: {kernel:?}");
                let wider = BANDS.into_iter().find(|&band| band > kernel.band);
                assert!(!wider.is_some_and(keeps), "{error_db}: {kernel:?}");
            }
        }
        assert!(KernelChoice::within(-200.0, decimations).is_empty());
    }

    /// The mean over tones evenly spread up to the edge is the share.
    #[test]
    fn error_at_the_edge_of_a_patch_corresponds_to_its_mean() {
        for kernel in KernelChoice::within(-50.0, [5, 6]) {
            let shares = Shares::of(-50.0, Some(kernel));
            for factor in FACTORS {
                let own = DecimationKernel::new(factor, kernel.taps, kernel.band);
                if own.error() > shares.slow {
                    continue;
                }
                let part = own.interpolated().sqrt();
                let tones = (1..20_000).map(|i| 0.5 * f64::from(i) / 20_000.0);
                let edge = tones
                    .filter(|&x| x >= kernel.band)
                    .find(|&x| own.tone_error(x) * part >= shares.slow_edge(factor))
                    .unwrap();
                let mean = own.error_within(edge);
                assert!(
                    // The mean is a sum by the midpoint rule; a step of the rising error by 12 dB in 0.02 cycles is 1 % of it.
                    (mean / shares.slow - 1.0).abs() < 0.02,
                    "{kernel:?} {factor}: {mean}"
                );
            }
        }
    }
}
