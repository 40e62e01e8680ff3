//! Image formers: phase history in, complex image out.
//!
//! Every former computes, or approximates, the matched filter of Schone 2020 (section 1.2): for a
//! pixel at `p`
//!
//! ```text
//! I(p) = sum_n sum_k w_slow[n] w_fast[k] z[n][k] exp(+j 2 pi f_k (path_n(p) - reference_path_n) / c)
//!        / (sum_n w_slow[n]  sum_k w_fast[k])
//! ```
//!
//! so that a unit scatterer on a pixel reads 1 whatever the window, and the formers differ only in
//! speed and error. [`exact`] is the sum itself and the oracle of all others.

pub mod bp;
pub mod budget;
pub mod exact;
pub mod ffbp;
pub mod maps;
pub mod monitor;
pub mod moving;
pub mod omega_k;
pub mod pfa;
mod pixels;
pub mod rda;
pub mod rdbp;
pub mod straight_track;
pub mod strip;
pub mod sweep;
pub mod weights;

use num_complex::Complex32;

use crate::geometry::ImageGrid;
use crate::image::Image;
use crate::phase_history::{PhaseHistory, ReadError};

pub use monitor::{Monitor, Silent};
pub use weights::Weights;

/// What a former plans below the error bound it is given, dB.
///
/// The bound is on the error relative to the RMS of an image of the scene's bright scatterers; on a grid
/// that leaves them out, what is there is smaller and the error hardly so. Measured on a sample of pixels that error
/// scatters, for a few bright reflectors can hold most of the image's power: by 3 dB either way on
/// random thousands of pixels of the GOTCHA scene. This margin keeps nearly all such samples within
/// the bound.
pub const MARGIN_DB: f64 = 4.0;

/// One image to form.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// Where the pulses come from.
    pub history: &'a dyn PhaseHistory,
    /// The pixels wanted.
    pub grid: &'a ImageGrid,
    /// Windows over fast and slow time.
    pub weights: &'a Weights,
    /// Bytes that the image, the samples in hand and all scratch may take together.
    pub memory_bytes: u64,
    /// Told of progress, asked whether to go on.
    pub monitor: &'a dyn Monitor,
}

impl Task<'_> {
    /// Refuses a task without pulses, samples or pixels, of which no former could say anything.
    fn check_not_empty(&self) -> Result<(), FormError> {
        let collection = self.history.collection();
        let what = if collection.pulses.is_empty() {
            "the collection holds no pulses"
        } else if collection.num_samples == 0 {
            "the collection's pulses hold no samples"
        } else if self.grid.num_pixels() == 0 {
            "the grid holds no pixels"
        } else {
            return Ok(());
        };
        Err(FormError::Unsuited(format!("{what}: there is no image")))
    }
}

/// A formed image and what it was formed with.
#[derive(Clone, Debug)]
pub struct Formed {
    /// The image, rows and columns as the grid's.
    pub image: Image,
    /// Every setting that was chosen, given or planned, for the record.
    pub settings: serde_json::Map<String, serde_json::Value>,
}

impl Formed {
    /// An image on the task's grid from its pixels, row-major; `settings` is a JSON object.
    fn new(task: &Task, pixels: Vec<Complex32>, settings: serde_json::Value) -> Self {
        Self::on(task.grid, pixels, settings)
    }

    /// [`Self::new`] without a task.
    fn on(grid: &ImageGrid, pixels: Vec<Complex32>, settings: serde_json::Value) -> Self {
        let serde_json::Value::Object(settings) = settings else {
            unreachable!("settings are an object")
        };
        let image = Image {
            rows: grid.rows.count,
            columns: grid.columns.count,
            pixels,
        };
        Self { image, settings }
    }
}

/// Why no image was formed.
#[derive(Debug, thiserror::Error)]
pub enum FormError {
    /// Pulses could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The work does not fit the budget.
    #[error("{what} needs {needed_bytes} bytes of the {budget_bytes} allowed: {advice}")]
    Memory {
        /// What asked for it.
        what: &'static str,
        /// Bytes needed at the least.
        needed_bytes: u128,
        /// Bytes allowed.
        budget_bytes: u64,
        /// What to change.
        advice: &'static str,
    },
    /// The collection or the settings do not suit this former.
    #[error("{0}")]
    Unsuited(String),
    /// The monitor asked to stop.
    #[error("interrupted")]
    Cancelled,
}

/// An algorithm that forms images.
pub trait ImageFormer: Sync {
    /// The name used on the command line and in metadata.
    fn name(&self) -> &'static str;

    /// Forms the image of `task`.
    fn form(&self, task: &Task) -> Result<Formed, FormError>;
}
