//! How the bound on the error is shared out.

use super::LEAF_PIXELS;
use crate::{MARGIN_DB, rounding};
use subaperture_model::geometry::ImageGrid;
use subaperture_signal::range_profile::RangeProfiler;
use subaperture_signal::windowed_sinc::{TAPS, WindowedSinc};

/// The relative RMS errors that the bound allows each cause.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shares {
    /// One decimation of slow time.
    pub(super) slow: f64,
    /// The recorded antennas' departure from the fitted.
    pub(super) track: f64,
    /// Range profiles.
    pub(super) profile: f64,
    /// Polynomials of tiles' paths.
    pub(super) tiles: f64,
    /// Phasors and places of tiles in float32, or there are none.
    pub(super) arithmetic: f64,
    /// Kernels over frequency, once a level.
    pub(super) fast: f64,
    /// Levels of patches within patches.
    pub(super) levels: f64,
    /// Whether kernels are good enough to decimate at all.
    pub(super) decimate: bool,
}

/// Of the splines that range profiles are read as.
pub(super) const DEGREE: usize = 3;

/// Shares of the error's power.
const SLOW: f64 = 0.45;
const FAST: f64 = 0.2;
const TRACK: f64 = 0.1;
const PROFILE: f64 = 0.15;
const TILES: f64 = 0.05;
const ARITHMETIC: f64 = 0.05;

/// RMS error of a kernel's weights, read from their table.
const TABLE: f64 = 2e-6;

/// Relative RMS error of `taps` taps over frequency, once.
fn kernel_error(taps: usize) -> f64 {
    WindowedSinc::new(taps, 0.25).error(0.25).hypot(TABLE)
}

impl Shares {
    /// Taps of the kernels within an error bound, and the shares.
    pub(super) fn of(error_db: f64, grid: &ImageGrid) -> (usize, Self) {
        let target = 10f64.powf((error_db - MARGIN_DB) / 20.0);
        let side = grid.rows.count.max(grid.columns.count);
        let levels = (side as f64 / LEAF_PIXELS as f64).log2().max(0.0).ceil() + 1.0;
        let fits = TAPS
            .into_iter()
            .find(|&taps| kernel_error(taps) <= target * (FAST / levels).sqrt());
        let taps = fits.unwrap_or(TAPS[TAPS.len() - 1]);
        let shares = Self {
            slow: target * (SLOW / levels).sqrt(),
            track: target * TRACK.sqrt(),
            profile: target * PROFILE.sqrt(),
            tiles: target * TILES.sqrt(),
            arithmetic: target * ARITHMETIC.sqrt(),
            fast: kernel_error(taps),
            levels,
            decimate: fits.is_some(),
        };
        (taps, shares)
    }

    /// Upsampling of range profiles.
    pub(super) fn oversampling(&self) -> f64 {
        RangeProfiler::oversampling_for(DEGREE, 20.0 * self.profile.log10())
    }

    /// What it comes to, dB, for `num_pulses` pulses and errors of the arithmetic.
    pub(super) fn planned_db(&self, num_pulses: usize, arithmetic: f64) -> f64 {
        let decimations = match self.decimate {
            true => self
                .track
                .hypot(self.levels.sqrt() * self.slow.hypot(self.fast)),
            false => 0.0,
        };
        rounding::total_db(&[
            decimations,
            self.profile,
            self.tiles.hypot(self.arithmetic),
            rounding::sum(num_pulses),
            // Float32 weights and sums of a level in both directions.
            (2.0 * self.levels).sqrt() * rounding::sum(TAPS[TAPS.len() - 1]),
            // Transforms and phases of profiles, as `RangeProfiler::rounding` for the longest.
            4e-7,
            arithmetic,
        ])
    }
}
