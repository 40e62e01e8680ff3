//! Formed images.

use num_complex::Complex32;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;

use super::goal::{Settings, note_error};

/// Formed image with its predicted error and settings.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Formed {
    /// Image with the rows and columns of the grid.
    pub image: Image,
    /// Predicted relative RMS error, dB, as [`crate::accuracy`] defines it.
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

    /// Record the predicted error and the error bound.
    pub fn expect(&mut self, bound_db: Option<f64>, predicted_db: f64) {
        self.predicted_error_db = predicted_db;
        self.bound_missed = note_error(bound_db, predicted_db, &mut self.settings);
    }
}
