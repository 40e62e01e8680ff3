//! The image that was given: a product with its grid, or an array in pixels.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::bail;
use serde::Deserialize;
use serde_json::Value;
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::Image;
use subaperture::io::{npy, product};
use subaperture::quality::response::{Carrier, Direction, Geometry};
use subaperture::signal::window::Window;

use crate::commands::stored;
use crate::config::Session;
use crate::text;

/// An image, where its pixels lie, and what is known of its band.
pub(super) struct Source {
    /// As given.
    pub(super) name: String,
    pub(super) image: Image,
    pub(super) grid: ImageGrid,
    /// That of fast and slow time, if they are the same.
    pub(super) window: Option<Window>,
    /// Where it was seen from.
    pub(super) carrier: Option<Carrier>,
    /// Resolution cells along x and y of a Cartesian product, metres.
    cells_m: [Option<f64>; 2],
    /// Whether coordinates are pixels.
    in_pixels: bool,
}

impl Source {
    /// Reads a product's folder or an array.
    pub(super) fn open(path: &Path) -> anyhow::Result<Self> {
        let name = path.display().to_string();
        let Some(folder) = stored::product_folder(path) else {
            stored::check_is_array(path)?;
            let image = npy::read(path)?;
            if image.pixels.is_empty() {
                bail!("{name}: an image without pixels");
            }
            let axis = |count| Axis {
                start: 0.0,
                step: 1.0,
                count,
            };
            return Ok(Self {
                name,
                grid: ImageGrid::horizontal(axis(image.columns), axis(image.rows), 0.0),
                image,
                window: None,
                carrier: None,
                cells_m: [None; 2],
                in_pixels: true,
            });
        };
        let stored = product::read(folder)?;
        let settings = &stored.metadata["settings"];
        let window = |key: &str| settings[key].as_str().and_then(|text| text.parse().ok());
        let fast: Option<Window> = window("window");
        let flat = !stored.grid.polar && stored.grid.x_axis.x > 1.0 - 1e-9;
        let cell = |i: usize| {
            let cells: &Value = &stored.metadata["collection"]["axis_resolution_m"];
            cells[i].as_f64().filter(|_| flat)
        };
        let seen = Geometry::deserialize(&stored.metadata["collection"]);
        Ok(Self {
            name,
            carrier: seen.ok().map(|seen| Carrier::of(&seen)),
            window: fast.filter(|fast| window("slow_window") == Some(*fast)),
            cells_m: [cell(0), cell(1)],
            image: stored.image,
            grid: stored.grid,
            in_pixels: false,
        })
    }

    /// A coordinate across as typed, degrees of a polar grid, as the grid's own.
    pub(super) fn across(&self, typed: f64) -> f64 {
        match self.grid.polar {
            true => typed.to_radians(),
            false => typed,
        }
    }

    /// What a cut runs along, in the words of the grid.
    pub(super) fn along(&self, along: Direction) -> &'static str {
        match along {
            Direction::X if self.in_pixels => "column",
            Direction::Y if self.in_pixels => "row",
            Direction::X if self.grid.polar => "angle",
            Direction::Y if self.grid.polar => "range",
            _ => along.name(),
        }
    }

    /// The unit in which lengths along a cut are shown, and by what they are multiplied.
    pub(super) fn unit(&self, along: Direction) -> (&'static str, f64) {
        match along {
            _ if self.in_pixels => ("px", 1.0),
            Direction::X if self.grid.polar => ("deg", 1f64.to_degrees()),
            _ => ("m", 1.0),
        }
    }

    /// A point in words.
    pub(super) fn place(&self, column_value: f64, row_value: f64) -> String {
        match (self.in_pixels, self.grid.polar) {
            (true, _) => format!("column {column_value:.3}, row {row_value:.3}"),
            (_, true) => format!(
                "angle {:.5} deg, range {row_value:.3} m",
                column_value.to_degrees()
            ),
            _ => format!("x {column_value:.4} m, y {row_value:.4} m"),
        }
    }

    /// Labels of the axes across and up, and what values across are multiplied by to be shown.
    pub(super) fn labels(&self) -> (&'static str, &'static str, f64) {
        match (self.in_pixels, self.grid.polar) {
            (true, _) => ("column", "row", 1.0),
            (_, true) => ("angle (deg)", "range (m)", 1f64.to_degrees()),
            _ => ("x (m)", "y (m)", 1.0),
        }
    }

    /// The resolution cell along a cut, metres.
    pub(super) fn cell(&self, along: Direction) -> Option<f64> {
        match along {
            Direction::X => self.cells_m[0],
            Direction::Y => self.cells_m[1],
            _ => None,
        }
    }
}

/// Refuses images whose measures would take more than the budget: at most six times their own size, of which
/// registration takes most.
pub(super) fn check_memory(session: &Session, paths: &[Option<&PathBuf>]) -> anyhow::Result<()> {
    // A file that cannot be asked for its size cannot be read either, and reading says why.
    let size = |path: &&PathBuf| {
        let folder = stored::product_folder(path);
        let file = folder.map_or_else(|| path.to_path_buf(), |folder| folder.join("image.npy"));
        fs::metadata(file).map_or(0, |about| u128::from(about.len()))
    };
    let bytes = 6 * paths.iter().flatten().map(size).sum::<u128>();
    if bytes > u128::from(session.memory_bytes) {
        bail!(
            "measuring needs up to {}; --memory allows {}: raise --memory, or measure smaller images",
            text::bytes(bytes),
            text::bytes(session.memory_bytes.into())
        );
    }
    Ok(())
}
