//! Selection of sub-CPI, patches and interpolation kernel for a module.
//!
//! Like the host's planner ([`subaperture_focus::rdbp::plan`]), with the same measure of the path model's error on the
//! recorded track: the predicted error is the root sum of squares of the errors of the path model and the kernels
//! ([`crate::image::kernels`]), and [`MARGIN_DB`] is reserved. Differences:
//! - all sub-CPIs have the same length. They do not end at gaps in the track and are not shortened where it is rough, since a
//!   module only counts pulses. The prediction is the worst over all sub-CPIs, so a gap within one shortens all of them or
//!   makes a plan impossible;
//! - maps have `R` range bins, the power of two from `2F` (4096 at most), and `D` Doppler bins, twice the Nyquist number at
//!   the highest frequency, so that kernels have room;
//! - of all choices within the error bound and the memory, the one with the fewest bytes of maps is taken, since the link is
//!   the bottleneck; among equal ones, the one with the least memory. Where the module accumulates the image, the one with
//!   the fewest instructions is taken, and where it detects targets, the one with the fewest maps;
//! - an image that the module accumulates is read with its own kernel ([`subaperture_core::accumulate::ChipKernel`]).
//!
//! The range gate of every patch contains its pixels in all sub-CPIs plus the kernel's `taps / 2 + 1` bins around them.
//!
//! Neglected: rounding of the fixed-point path, which is not part of this prediction.

use super::module_plan::{ModuleCapacity, ModulePlan, ModuleProduct};
use super::search::{Candidate, LONGEST_RANGE, Search};
use crate::image::kernels::Kernels;
use crate::maps::Arithmetic;
use subaperture_focus::sub_cpi::shared_band;
use subaperture_focus::{FormError, MARGIN_DB, sweep};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;
use subaperture_signal::windowed_sinc::{TAPS, WindowedSinc};

/// Requirements for a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Requirements {
    /// Bound on the relative RMS error of the image in dB (negative).
    pub error_db: f64,
    /// Memory or buffer sizes of the module.
    pub room: ModuleCapacity,
    /// Arithmetic of the module.
    pub arithmetic: Arithmetic,
    /// Product of the module.
    pub product: ModuleProduct,
}

/// Reason why no plan exists.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The recording is unsuitable.
    #[error(transparent)]
    Unsuited(#[from] FormError),
    /// A module accumulates no image on a polar grid or a surface.
    #[error(
        "grid: expected a flat Cartesian grid, found {0}: let the module send maps, and form the image of them"
    )]
    Grid(&'static str),
    /// Several channels for a product of one channel, or no channel.
    #[error("channels: expected 1, or several for detections only, found {0}")]
    Channels(usize),
    /// A channel has another band than the first.
    #[error("{0}: expected the frequencies of the first channel: choose channels of one band")]
    Bands(String),
    /// More frequencies per pulse than a module supports.
    #[error(
        "frequencies per pulse: expected at most {LONGEST_RANGE} for a module, found {0}: decimate or cut the band"
    )]
    Frequencies(usize),
    /// Every choice exceeds the error bound.
    #[error("no plan keeps the error below {error_db} dB{}", best(*.best_db))]
    Bound {
        /// Requested bound in dB.
        error_db: f64,
        /// Smallest achievable error in dB; `None` if no plan is possible at all.
        best_db: Option<f64>,
    },
    /// Intra-pulse motion is too large.
    #[error(
        "intra-pulse motion: a module treats all samples of a pulse as taken at one position (stop-and-go), which \
         leaves {residual_db:.1} dB, above {error_db} dB minus {MARGIN_DB} dB of margin"
    )]
    Swept {
        /// Requested bound in dB.
        error_db: f64,
        /// Error of the stop-and-go approximation on the grid in dB.
        residual_db: f64,
    },
    /// No plan that keeps the bound fits the module.
    #[error(
        "no plan that keeps {error_db} dB fits the module: {}",
        least(*.least_bytes)
    )]
    Room {
        /// Requested bound in dB.
        error_db: f64,
        /// Minimum sufficient memory in bytes.
        least_bytes: u64,
    },
}

fn best(best_db: Option<f64>) -> String {
    best_db.map_or_else(
        || {
            ": the Doppler extent of the patches exceeds the unambiguous Doppler of the pulses"
                .to_owned()
        },
        |best_db| {
            format!(" (with {MARGIN_DB} dB of margin): {best_db:.1} dB is the smallest achievable")
        },
    )
}

fn least(bytes: u64) -> String {
    let kibibytes = bytes.div_ceil(1024);
    format!("least memory: {bytes} bytes ({kibibytes}K)")
}

impl ModuleProduct {
    /// Check that a module can send this product of the pixels of `grid`.
    ///
    /// # Errors
    /// [`PlanError::Grid`] for an image on a polar grid or a surface.
    pub fn check_grid(self, grid: &ImageGrid) -> Result<(), PlanError> {
        match (self, grid.polar, &grid.relief) {
            (Self::Image, true, _) => Err(PlanError::Grid("a polar grid")),
            (Self::Image, false, Some(_)) => Err(PlanError::Grid("pixels on a surface")),
            _ => Ok(()),
        }
    }
}

impl ModulePlan {
    /// Create a plan for the pixels of `grid` and the channels of a recording: one, or for detections several. Sub-CPIs and patches
    /// are chosen for the first.
    ///
    /// # Errors
    /// [`PlanError`] states which requirement cannot be met.
    pub fn new(
        channels: &[&Collection],
        grid: &ImageGrid,
        requirements: &Requirements,
    ) -> Result<Self, PlanError> {
        requirements.product.check_grid(grid)?;
        let (Some(&collection), Ok(num_channels)) =
            (channels.first(), u16::try_from(channels.len()))
        else {
            return Err(PlanError::Channels(channels.len()));
        };
        if num_channels > 1 && requirements.product != ModuleProduct::Detections {
            return Err(PlanError::Channels(channels.len()));
        }
        let band = shared_band(collection)?;
        for other in channels {
            if shared_band(other)? != band {
                return Err(PlanError::Bands(other.name.clone()));
            }
        }
        if band.count > LONGEST_RANGE {
            return Err(PlanError::Frequencies(band.count));
        }
        let target = 10f64.powf((requirements.error_db - MARGIN_DB) / 20.0);
        let swept = sweep::residual(collection, grid);
        if swept > target {
            return Err(PlanError::Swept {
                error_db: requirements.error_db,
                residual_db: 20.0 * swept.log10(),
            });
        }
        let search = Search {
            collection,
            grid,
            band: &band,
            arithmetic: requirements.arithmetic,
            error_db: requirements.error_db,
            product: requirements.product,
            num_channels,
        };
        let mut candidates = search.candidates(target);
        candidates.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
        // Estimates use a sample of patches and sub-CPIs; the chosen plan is computed on all of them.
        let hopeful = candidates.iter().filter(|c| match requirements.room {
            ModuleCapacity::Ram { bytes } => 0.9 * c.ram_bytes as f64 <= bytes as f64,
            ModuleCapacity::Built(_) => true,
        });
        let mut best_db: Option<f64> = None;
        let mut sound = |candidate: &Candidate| {
            let plan = search.work_out(candidate)?;
            best_db = Some(best_db.map_or(plan.predicted_db, |best| best.min(plan.predicted_db)));
            (plan.predicted_db <= requirements.error_db - MARGIN_DB).then_some(plan)
        };
        for candidate in hopeful {
            if let Some(plan) = sound(candidate)
                && plan.fits(&requirements.room)
            {
                return Ok(plan);
            }
        }
        candidates.sort_by_key(|candidate| candidate.ram_bytes);
        let least_bytes = candidates
            .iter()
            .find_map(&mut sound)
            .map(|plan| plan.total_bytes());
        let error_db = requirements.error_db;
        Err(match least_bytes {
            Some(least_bytes) => PlanError::Room {
                error_db,
                least_bytes,
            },
            None => PlanError::Bound {
                error_db,
                best_db: best_db.or_else(|| {
                    let range_band = search.range_band();
                    let most = TAPS[TAPS.len() - 1];
                    let kernel = WindowedSinc::new(most, range_band).error(range_band);
                    (kernel > Kernels::share(requirements.error_db)).then(|| 20.0 * kernel.log10())
                }),
            },
        })
    }
}
