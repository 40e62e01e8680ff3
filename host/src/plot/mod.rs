//! Pictures where people would rather look than read.
//!
//! A picture of a complex image: its magnitude in decibels, `20 log10 |I|`, over axes in metres (range
//! in metres and angle in degrees of a polar grid), y upwards, with a colour bar. Cartesian grids keep
//! their proportions. Large images are reduced by averaging power, so that a lone bright pixel is dimmed
//! but never dropped; small ones are enlarged without interpolation. Pixels that are NaN or infinite
//! are red.
//!
//! [`heat`] shows any real values over any two axes on a linear scale, [`lines`] draws curves.
//!
//! Text is set in DejaVu Sans, which the program carries: no font need be installed.

mod canvas;
mod colours;
mod heat;
mod layout;
mod lines;
mod raster;
mod scale;
mod ticks;

use crate::geometry::{Axis, ImageGrid};
use crate::image::{Image, power};
use layout::Sheet;

pub use colours::Colours;
pub use heat::{Heat, heat};
pub use lines::{Chart, Curve, Stroke, lines};
pub use scale::Scale;

/// An image and how to show it.
#[derive(Clone, Debug)]
pub struct Panel<'a> {
    /// The image.
    pub image: &'a Image,
    /// Its grid: rows and columns as the image's.
    pub grid: &'a ImageGrid,
    /// The line above it; cut short if it does not fit.
    pub title: String,
    /// Which levels are black and white.
    pub scale: Scale,
    /// The colours between.
    pub colours: Colours,
    /// What the axes across and up show, with their units.
    pub labels: [&'static str; 2],
}

impl<'a> Panel<'a> {
    /// A grey picture with a scale of its own, its axes those of an image.
    pub fn new(image: &'a Image, grid: &'a ImageGrid, title: impl Into<String>) -> Self {
        Self {
            image,
            grid,
            title: title.into(),
            scale: Scale::FromData,
            colours: Colours::Grey,
            labels: match grid.polar {
                true => ["angle (deg)", "range (m)"],
                false => ["x (m)", "y (m)"],
            },
        }
    }

    fn sheet(&self) -> Sheet<'_> {
        let (image, grid) = (self.image, self.grid);
        let [across_label, up_label] = self.labels;
        let unit = match grid.polar {
            true => 1f64.to_degrees(),
            false => 1.0,
        };
        let length = |axis: &Axis| axis.count as f64 * axis.step.abs();
        Sheet {
            title: &self.title,
            count: (grid.rows.count, grid.columns.count),
            across: edges(&grid.columns, unit),
            up: edges(&grid.rows, 1.0),
            across_label,
            up_label,
            bar_label: "dB",
            proportions: match grid.polar {
                true => (grid.columns.count as f64, grid.rows.count as f64),
                false => (length(&grid.columns), length(&grid.rows)),
            },
            colours: self.colours,
            absent: colours::RED,
            // Without the image's powers, which only matter to a scale from the data, whose labels,
            // whole decibels of three digits, fit the least room anyhow.
            typical: self.scale.levels(&[]),
            cells: Box::new(move |height, width| {
                let size = (image.rows, image.columns);
                let mut cells = raster::resample(size, |i| power(image.pixels[i]), height, width);
                let levels = self.scale.levels(&cells);
                for cell in &mut cells {
                    *cell = 10.0 * cell.log10();
                }
                (cells, levels)
            }),
        }
    }
}

/// Values at an axis' two ends: the outer edges of its first and last pixel.
fn edges(axis: &Axis, unit: f64) -> (f64, f64) {
    let half = axis.step / 2.0;
    let last = axis.at(axis.count - 1);
    ((axis.start - half) * unit, (last + half) * unit)
}

/// Why no picture was drawn.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// The image is not on this grid, or there is none.
    #[error("cannot draw {title:?}: {what}")]
    Unsuited {
        /// The panel's title.
        title: String,
        /// What is wrong.
        what: String,
    },
    /// The picture could not be encoded.
    #[error("cannot encode the picture: {0}")]
    Encoding(#[from] png::EncodingError),
}

/// One picture, as the bytes of a PNG file: up to 1600 pixels a side, and its margins.
///
/// # Errors
/// [`PlotError`].
pub fn quicklook(panel: &Panel) -> Result<Vec<u8>, PlotError> {
    panels(std::slice::from_ref(panel), 1)
}

/// Several pictures on one page, `columns` side by side, row by row, as the bytes of a PNG file. The
/// more columns, the smaller each: up to 800 pixels a side for two, 560 for three or more.
///
/// # Errors
/// [`PlotError`].
pub fn panels(panels: &[Panel], columns: usize) -> Result<Vec<u8>, PlotError> {
    for panel in panels {
        let (rows, columns) = (panel.grid.rows.count, panel.grid.columns.count);
        let image = panel.image;
        let pixels = image.rows.checked_mul(image.columns);
        if (image.rows, image.columns) != (rows, columns) || pixels != Some(image.pixels.len()) {
            return Err(PlotError::Unsuited {
                title: panel.title.clone(),
                what: format!(
                    "the image has {} rows x {} columns, the grid {rows} x {columns}",
                    image.rows, image.columns
                ),
            });
        }
    }
    let empty = panels.iter().find(|p| p.image.pixels.is_empty());
    if panels.is_empty() || empty.is_some() {
        return Err(PlotError::Unsuited {
            title: empty.map_or_else(String::new, |p| p.title.clone()),
            what: "there is nothing to draw".to_owned(),
        });
    }
    let sheets: Vec<Sheet> = panels.iter().map(Panel::sheet).collect();
    layout::page(&sheets, columns.clamp(1, panels.len())).into_png()
}
