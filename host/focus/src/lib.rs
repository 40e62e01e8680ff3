//! Image formers: phase history in, complex image out.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `focus`.
//!
//! Every former computes, or approximates, the matched filter of Schone 2020 (section 1.2): for a
//! pixel at `p`
//!
//! ```text
//! I(p) = sum_n sum_k w_slow[n] w_fast[k] z[n][k] exp(+j 2 pi f_k (path_n(p) - reference_path_n) / c)
//!        / (sum_n w_slow[n]  sum_k w_fast[k])
//! ```
//!
//! so that a unit scatterer on a pixel, seen alike by all pulses, reads 1 whatever the window, and the formers
//! differ only in speed and error. One that an antenna's beam, spreading or a shadow lets pulse `n` see with amplitude
//! `g_n` reads `sum_n w_slow[n] g_n / sum_n w_slow[n]`: insert its samples, whose phases the sum takes away. So in
//! strip maps a point reads less the less of the track lights it; a recording does not tell `g_n`, so the
//! sum cannot divide by it. [`exact`] is the sum itself and the oracle of all others; [`accuracy`] says what error
//! means, and sees that it is predicted and that a bound asked for is kept.
#![forbid(unsafe_code)]

pub mod accuracy;
pub mod budget;
mod calibrate;
pub mod cost;
mod decided;
mod error;
pub mod forecast;
pub mod former;
pub mod formers;
pub mod live;
pub mod machine;
mod means;
pub mod moving;
pub mod patch;
pub mod path_model;
mod path_tile;
mod pixels;
pub mod plan;
mod probes;
mod read_ahead;
mod rounding;
mod sampled;
pub mod stages;
pub mod straight_track;
pub mod strip;
pub mod sub_cpi;
pub mod sweep;
pub mod time_model;

use num_complex::Complex32;

use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Collection, PhaseHistory, Pulse, Weights};

pub use accuracy::{Asked, Judgement, Misses, Settings};
pub use cost::{Cost, StageCost};
pub use decided::DecidedOnce;
pub use error::{FormError, Reason, Remedy};
pub use former::{Aim, Decision, Forming, ImageFormer, SCRATCH_BYTES, Tile, Work};
pub use formers::{auto, bp, exact, ffbp, omega_k, pfa, rda, rdbp};
pub use means::{Means, Transforms};
pub use plan::Plan;
pub use sampled::TileRecord;
pub use time_model::TimeModel;

/// The bound on the relative RMS error that formers plan for unless told otherwise, dB.
pub const DEFAULT_ERROR_DB: f64 = -60.0;

/// What a former plans below the error bound it is given, dB.
///
/// What a grid holds decides how a plan's error shows in its image ([`accuracy`]). Measured on a sample of pixels
/// it scatters besides, for a few bright reflectors can hold most of the image's power: by 3 dB either way on
/// random thousands of pixels of the GOTCHA scene. This margin keeps nearly all of it within the bound.
pub const MARGIN_DB: f64 = 4.0;

/// The instructions that images are formed in on this machine: `avx512`, `avx2`, `neon` or `portable`.
///
/// Kernels give the same bits in all of them; the fastest Fourier transforms do not, and follow the processor too
/// ([`Transforms`]).
pub fn instructions() -> &'static str {
    subaperture_kernels::lanes::Instructions::best().name()
}

/// One image to form.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// Where the pulses come from.
    pub history: &'a dyn PhaseHistory,
    /// The pixels wanted.
    pub grid: &'a ImageGrid,
    /// Windows over fast and slow time.
    pub weights: &'a Weights,
    /// By what means.
    pub means: Means<'a>,
    /// Bytes that the image, the samples in hand and all scratch may take together.
    pub memory_bytes: u64,
    /// Told of progress, asked whether to go on.
    pub monitor: &'a dyn Monitor,
}

impl<'a> Task<'a> {
    /// What is to be formed.
    pub fn aim(&self) -> Aim<'a> {
        Aim {
            collection: self.history.collection(),
            grid: self.grid,
            weights: self.weights,
            scratch_bytes: SCRATCH_BYTES,
            means: self.means,
        }
    }

    /// As [`check`].
    fn check(&self) -> Result<(), FormError> {
        check(self.history.collection(), self.grid)
    }
}

/// Refuses what has no pulses, samples or pixels, of which no former could say anything, and geometry that is not of
/// numbers.
fn check(collection: &Collection, grid: &ImageGrid) -> Result<(), FormError> {
    check_not_empty(collection, grid)?;
    let is_number = |p: &Pulse| {
        let places = p.transmitter_m.is_finite() && p.receiver_m.is_finite();
        let numbers = [p.reference_path_m, p.start_hz, p.step_hz];
        places && numbers.iter().all(|x| x.is_finite()) && p.sweep.is_finite()
    };
    match collection.pulses.iter().position(|p| !is_number(p)) {
        None => Ok(()),
        Some(n) => Err(FormError::unsuited(format!(
            "pulse {n} (from 0) has an antenna, a reference path or a frequency that is not a finite number: \
             repair or drop it"
        ))),
    }
}

/// Refuses pixels on a surface for a former that takes planes.
///
/// # Errors
/// [`FormError::Unsuited`].
fn check_surface<F: ImageFormer + ?Sized>(former: &F, grid: &ImageGrid) -> Result<(), FormError> {
    match &grid.relief {
        Some(relief) if !former.follows_relief() => {
            let why = format!(
                "pixels lie on {}, and {} forms those of a plane",
                relief.surface(),
                former.name()
            );
            let remedies = [Remedy::OtherFormer(&["auto", "bp", "ffbp"])];
            Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)))
        }
        _ => Ok(()),
    }
}

fn check_not_empty(collection: &Collection, grid: &ImageGrid) -> Result<(), FormError> {
    let what = if collection.pulses.is_empty() {
        "the collection holds no pulses"
    } else if collection.num_samples == 0 {
        "the collection's pulses hold no samples"
    } else if grid.num_pixels() == 0 {
        "the grid holds no pixels"
    } else {
        return Ok(());
    };
    Err(FormError::unsuited(format!("{what}: there is no image")))
}

/// A formed image and what it was formed with.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Formed {
    /// The image, rows and columns as the grid's.
    pub image: Image,
    /// Predicted relative RMS error, dB, as [`accuracy`] defines it.
    pub predicted_error_db: f64,
    /// Whether that is above the bound asked.
    pub bound_missed: bool,
    /// Every setting that was chosen, given or planned, for the record; the prediction and its bound
    /// among them.
    pub settings: Settings,
}

impl Formed {
    /// An image on `grid` from its pixels, row-major, planned to err by `planned_db`; `settings` is a JSON object.
    pub fn on(
        grid: &ImageGrid,
        pixels: Vec<Complex32>,
        planned_db: f64,
        settings: serde_json::Value,
    ) -> Self {
        let serde_json::Value::Object(settings) = settings else {
            unreachable!("settings are an object")
        };
        let image = Image {
            rows: grid.rows.count,
            columns: grid.columns.count,
            pixels,
        };
        let mut formed = Self {
            image,
            predicted_error_db: planned_db,
            bound_missed: false,
            settings,
        };
        formed.expect(None, planned_db);
        formed
    }

    /// Notes the error to expect, and the bound it is to keep.
    pub fn expect(&mut self, bound_db: Option<f64>, predicted_db: f64) {
        self.predicted_error_db = predicted_db;
        self.bound_missed = accuracy::note_error(bound_db, predicted_db, &mut self.settings);
    }
}
