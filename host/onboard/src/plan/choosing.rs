//! Choosing sub-CPI, patches and kernel for a module.
//!
//! As the host's own planner ([`subaperture_focus::rdbp::plan`]), by the same measure of the path's model on
//! the recorded track: predicted error is the root sum square of the model's and the kernels'
//! ([`crate::image::kernels`]), and [`MARGIN_DB`] is kept. What differs:
//! - sub-CPIs are as long as one another, and neither end at gaps in the track nor are halved where it is
//!   rough: a module counts pulses. The prediction is the worst of all of them, so a gap that falls
//!   within one makes all shorter, or leaves no plan at all;
//! - maps have `R`, the power of two from `2F` (4096 at most), and `D`, twice Nyquist's at the highest
//!   frequency, so that kernels have room;
//! - of all choices within the bound and the room, the one with the fewest bytes of maps is taken, since
//!   the link is the narrowest place; of equals, that with the least memory.
//!
//! Every patch's gate holds its pixels in all sub-CPIs, and the kernel's `taps / 2 + 1` bins around.
//!
//! Neglected: the fixed-point path's rounding, which this prediction does not know.

use super::onboard_plan::{OnboardPlan, Room};
use super::search::{Candidate, LONGEST_RANGE, Search};
use crate::image::kernels::Kernels;
use crate::maps::Arithmetic;
use subaperture_focus::sub_cpi::shared_band;
use subaperture_focus::{FormError, MARGIN_DB, sweep};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;
use subaperture_signal::windowed_sinc::{TAPS, WindowedSinc};

/// What is wanted of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Requirements {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
    /// Room in the module.
    pub room: Room,
    /// Its arithmetic.
    pub arithmetic: Arithmetic,
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The recording does not suit.
    #[error(transparent)]
    Unsuited(#[from] FormError),
    /// More frequencies than a module takes.
    #[error(
        "a pulse has {0} frequencies, and a module takes at most {LONGEST_RANGE}: thin or cut the band"
    )]
    Frequencies(usize),
    /// Whatever is chosen, the error is larger.
    #[error("no choice keeps the error below {error_db} dB{}", best(*.best_db))]
    Bound {
        /// The bound asked for, dB.
        error_db: f64,
        /// The least that was found, dB; `None` where nothing at all is possible.
        best_db: Option<f64>,
    },
    /// The radar moves too far while the samples of a pulse are taken.
    #[error(
        "the antennas move from sample to sample of a pulse, and a module takes all samples of one at one place: that \
         leaves {residual_db:.1} dB, above {error_db} dB less {MARGIN_DB} dB of reserve"
    )]
    Swept {
        /// The bound asked for, dB.
        error_db: f64,
        /// What taking them at one place leaves on the grid, dB.
        residual_db: f64,
    },
    /// Nothing that keeps the bound fits.
    #[error(
        "nothing that keeps {error_db} dB fits: {}",
        least(*.least_bytes)
    )]
    Room {
        /// The bound asked for, dB.
        error_db: f64,
        /// Least memory that would do, bytes.
        least_bytes: u64,
    },
}

fn best(best_db: Option<f64>) -> String {
    best_db.map_or_else(
        || ": its patches' Doppler is wider than the pulses tell apart".to_owned(),
        |best_db| {
            format!(" ({MARGIN_DB} dB of it are kept in reserve); {best_db:.1} dB is the best")
        },
    )
}

fn least(bytes: u64) -> String {
    let kibibytes = bytes.div_ceil(1024);
    format!("the least memory that would is {bytes} bytes ({kibibytes}K)")
}

impl OnboardPlan {
    /// Plans for the pixels of `grid`.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn new(
        collection: &Collection,
        grid: &ImageGrid,
        requirements: &Requirements,
    ) -> Result<Self, PlanError> {
        let band = shared_band(collection)?;
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
        };
        let mut candidates = search.candidates(target);
        candidates.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
        // Estimates look at some patches and sub-CPIs; what is taken is worked out on all of them.
        let hopeful = candidates.iter().filter(|c| match requirements.room {
            Room::Ram { bytes } => 0.9 * c.ram_bytes as f64 <= bytes as f64,
            Room::Built(_) => true,
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
            .map(|plan| plan.ram.total_bytes);
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
