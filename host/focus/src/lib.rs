//! Image formers: phase history in, complex image out.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation; the crate `subaperture`
//! re-exports it as the module `focus`.
//!
//! Every former computes, or approximates, the matched filter of Schone 2020 (section 1.2): for a
//! pixel at `p`
//!
//! ```text
//! I(p) = sum_n sum_k w_slow[n] w_fast[k] z[n][k] exp(+j 2 pi f_k (path_n(p) - reference_path_n) / c)
//!        / (sum_n w_slow[n]  sum_k w_fast[k])
//! ```
//!
//! so that a unit scatterer on a pixel, seen equally by all pulses, reads 1 for any window. The formers
//! differ only in speed and error. A scatterer that the antenna pattern, spreading loss or a shadow lets pulse `n` see with amplitude
//! `g_n` reads `sum_n w_slow[n] g_n / sum_n w_slow[n]`: the sum compensates phases only. In
//! strip maps a point therefore reads less, the smaller the illuminated part of the track; a recording does not contain `g_n`, so the
//! sum cannot divide by it. [`exact`] is the sum, the reference for all images; [`accuracy`] defines the
//! error, its prediction and the check of a requested bound.
#![forbid(unsafe_code)]

pub mod accuracy;
pub mod beam;
pub mod budget;
mod calibrate;
mod compared;
pub mod cost;
pub mod dark;
mod drawn;
mod error;
mod execute;
mod fingerprint;
pub mod forecast;
pub mod former;
pub mod formers;
pub mod frequency_domain;
pub mod live;
pub mod machine;
pub mod moving;
mod numerics;
mod opened;
pub mod patch;
pub mod path_model;
mod path_tile;
mod pixels;
pub mod plan;
mod probes;
mod read_ahead;
mod rounding;
mod sampled;
mod second_look;
mod sink;
pub mod stages;
pub mod straight_track;
mod stray;
pub mod sub_cpi;
pub mod sweep;
pub mod time_model;

use num_complex::Complex32;

use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Collection, PhaseHistory, Pulse, Weights};

pub use accuracy::{BoundPolicy, ErrorGoal, Judgement, Settings};
pub use cost::{Cost, StageCost};
pub use drawn::SampledPixels;
pub use error::{FormError, Reason, Remedy};
pub use execute::{Executed, Execution};
pub use former::{Decision, Forming, ImageFormer, ImageSpec, SCRATCH_BYTES, Tile, Work};
pub use formers::{auto, bp, exact, ffbp, omega_k, pfa, rda, rdbp};
pub use numerics::{Numerics, Transforms};
pub use opened::Opened;
pub use plan::Plan;
pub use sampled::TileRecord;
pub use stray::RecordedEnergy;
pub use time_model::TimeModel;

/// Default bound on the planned relative RMS error, dB.
pub const DEFAULT_ERROR_DB: f64 = -60.0;

/// Margin of the planned error below the error bound, dB.
///
/// The effect of a plan's error depends on the scene ([`accuracy`]). The error measured on a sample of pixels
/// also varies, since a few bright reflectors can hold most of the image power: by +-3 dB on
/// random thousands of pixels of the GOTCHA scene. The margin keeps nearly all of this variation within the bound.
pub const MARGIN_DB: f64 = 4.0;

/// Instruction set used on this machine: `avx512`, `avx2`, `neon` or `portable`.
///
/// Kernels are bit-identical in all instruction sets. The fastest Fourier transforms are not; they also depend on the processor
/// ([`Transforms`]).
pub fn instructions() -> &'static str {
    subaperture_kernels::lanes::Instructions::best().name()
}

/// Image formation task.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// Phase history of the recording.
    pub history: &'a dyn PhaseHistory,
    /// Pixel grid of the image.
    pub grid: &'a ImageGrid,
    /// Windows over fast and slow time.
    pub weights: &'a Weights,
    /// Transforms and timing model.
    pub numerics: Numerics<'a>,
    /// Memory limit for image, pulses being read and all scratch, bytes.
    pub memory_bytes: u64,
    /// Receiver of progress and source of cancellation.
    pub monitor: &'a dyn Monitor,
}

impl<'a> Task<'a> {
    /// Specification of the image.
    pub fn spec(&self) -> ImageSpec<'a> {
        ImageSpec {
            collection: self.history.collection(),
            grid: self.grid,
            weights: self.weights,
            scratch_bytes: SCRATCH_BYTES,
            numerics: self.numerics,
        }
    }

    /// Source of the pulses, with limits.
    pub fn work(&self) -> Work<'a> {
        Work {
            history: self.history,
            memory_bytes: self.memory_bytes,
            monitor: self.monitor,
        }
    }
}

/// Maximum pixels along one side, and in total (35 TB). Planning iterates over the sides of a grid.
const MAX_SIDE: usize = 1 << 26;
const MAX_PIXELS: u64 = 1 << 42;

/// Refuse a grid larger than any storable image before planning.
///
/// # Errors
/// [`FormError::Unsuited`].
fn check_size(grid: &ImageGrid) -> Result<(), FormError> {
    let (rows, columns) = (grid.rows.count, grid.columns.count);
    let pixels = rows as u128 * columns as u128;
    if rows.max(columns) <= MAX_SIDE && pixels <= u128::from(MAX_PIXELS) {
        return Ok(());
    }
    let why = format!(
        "the grid has {rows} x {columns} pixels, an image of {}: at most {MAX_SIDE} a side and {MAX_PIXELS} in all are formed",
        subaperture_model::quantity::bytes(pixels.saturating_mul(8)),
    );
    Err(FormError::Unsuited(
        Reason::new(why).helped_by(&[Remedy::FewerPixels]),
    ))
}

/// Refuse a collection without pulses or samples, a grid without pixels, and geometry with non-finite
/// values.
fn check(collection: &Collection, grid: &ImageGrid) -> Result<(), FormError> {
    check_not_empty(collection, grid)?;
    check_size(grid)?;
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

/// Refuse pixels on a surface for a former that requires a plane.
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

/// Formed image with its predicted error and settings.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Formed {
    /// Image with the rows and columns of the grid.
    pub image: Image,
    /// Predicted relative RMS error, dB, as [`accuracy`] defines it.
    pub predicted_error_db: f64,
    /// Whether the predicted error exceeds the requested bound.
    pub bound_missed: bool,
    /// Chosen, given and planned settings for the record, including the prediction and its
    /// bound.
    pub settings: Settings,
}

impl Formed {
    /// Make an image on `grid` from row-major pixels with planned error `planned_db`; `settings` is a JSON object.
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

    /// Image of `plan` with its measured error.
    pub(crate) fn judged(image: Image, plan: &Plan, judgement: &Judgement) -> Self {
        let mut settings = plan.summary.as_object().cloned().unwrap_or_default();
        if let Some(error_db) = plan.planned_for_db {
            settings.insert("planned_for_db".to_owned(), error_db.into());
        }
        let bound_missed = judgement.note(plan.bound_db, &mut settings);
        Self {
            image,
            predicted_error_db: judgement.predicted_db(),
            bound_missed,
            settings,
        }
    }

    /// Record the predicted error and the error bound.
    pub fn expect(&mut self, bound_db: Option<f64>, predicted_db: f64) {
        self.predicted_error_db = predicted_db;
        self.bound_missed = accuracy::note_error(bound_db, predicted_db, &mut self.settings);
    }
}
