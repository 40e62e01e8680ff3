//! Formed image for the page.

use serde::Serialize;
use subaperture::focus::auto::selected;
use subaperture::image::power;
use subaperture::io::npy;
use subaperture::monitor::Monitor;
use subaperture::phase_history::PhaseHistory;
use subaperture::{FocusedImage, Focusing};

use crate::memory::MEMORY_BYTES;
use crate::request::Request;

/// Memory of copies of a pixel: `.npy`, levels and powers, the first two in WebAssembly and in JavaScript.
const COPIES_BYTES: u64 = 8 + 1 + 4;

/// Share of pixels brighter than the upper level.
const BRIGHTER: f64 = 0.001;

/// Formed image with its record.
pub struct Focused {
    /// Pixels, grid, settings and warnings.
    pub image: FocusedImage,
}

/// Facts of an image for the page.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Facts {
    /// Name of the former; of [`Auto`](subaperture::focus::auto::Auto) that of the selected former.
    pub former: String,
    /// Predicted relative RMS error against the exact sum, dB.
    pub predicted_error_db: f64,
    /// Whether the predicted error exceeds the requested bound.
    pub bound_missed: bool,
    /// Upper level of the picture, dB.
    pub upper_db: f64,
    /// Warnings for the user, one sentence each.
    pub warnings: Vec<String>,
}

impl Focused {
    pub(crate) fn form(
        history: &dyn PhaseHistory,
        request: &Request,
        monitor: &dyn Monitor,
    ) -> Result<Self, String> {
        let grid = request.grid.image_grid()?;
        let former = request.former()?;
        let copies_bytes = grid.num_pixels().saturating_mul(COPIES_BYTES);
        let focusing = Focusing::new(history, &grid)
            .memory_bytes(MEMORY_BYTES.saturating_sub(copies_bytes))
            .monitor(monitor)
            .allow_error();
        let focusing = match request.portable {
            true => focusing.portable(),
            false => focusing,
        };
        let image = focusing.by(&*former).map_err(|error| error.to_string())?;
        Ok(Self { image })
    }

    /// Facts of the image.
    pub fn facts(&self) -> Facts {
        let image = &self.image;
        Facts {
            former: selected(&image.settings, image.former).to_owned(),
            predicted_error_db: image.predicted_error_db,
            bound_missed: image.bound_missed,
            upper_db: decibels(self.upper()),
            warnings: image.warnings.clone(),
        }
    }

    /// Complex pixels as a NumPy file: complex64, rows (y ascending) x columns (x ascending).
    ///
    /// # Errors
    /// Memory cannot be allocated.
    pub fn npy(&self) -> Result<Vec<u8>, String> {
        let image = &self.image.image;
        let mut bytes = Vec::new();
        let size = npy::file_bytes(image.pixels.len() as u64) as usize;
        bytes
            .try_reserve_exact(size)
            .map_err(|error| error.to_string())?;
        npy::write_to(&mut bytes, image).map_err(|error| error.to_string())?;
        Ok(bytes)
    }

    /// Levels of a picture, 0 to 255 over `range_db` up to the upper level, row by row from the largest y down.
    pub fn levels(&self, range_db: f64) -> Vec<u8> {
        let image = &self.image.image;
        let upper_db = decibels(self.upper());
        let rows = image.pixels.chunks_exact(image.columns.max(1)).rev();
        rows.flatten()
            .map(|&pixel| {
                let below_db = decibels(power(pixel)) - upper_db;
                // The conversion saturates, and black is the level of zeros.
                (255.0 * (1.0 + below_db / range_db) + 0.5) as u8
            })
            .collect()
    }

    /// Power that one of a thousand pixels exceeds.
    fn upper(&self) -> f64 {
        let pixels = &self.image.image.pixels;
        let mut powers: Vec<f32> = pixels.iter().map(|&pixel| power(pixel) as f32).collect();
        if powers.is_empty() {
            return 0.0;
        }
        let place = ((1.0 - BRIGHTER) * (powers.len() - 1) as f64) as usize;
        let (_, upper, _) = powers.select_nth_unstable_by(place, f32::total_cmp);
        f64::from(*upper)
    }
}

/// Level of a power, dB; that of zero is far below every other.
fn decibels(power: f64) -> f64 {
    10.0 * power.max(1e-60).log10()
}
