//! The image that was given: a product with its grid, or an array in pixels.

use std::path::Path;

use anyhow::bail;
use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::{Image, Parts};
use subaperture::io::npy::ImageFile;
use subaperture::io::product;
use subaperture::quality::response::{Carrier, Direction, Geometry, Response, ResponseError};
use subaperture::resolution::support::RecordedLooks;
use subaperture::signal::window::Window;

use crate::args::At;
use crate::commands::stored;
use crate::config::Session;
use crate::failure::Usage;
use crate::text;

/// An image, where its pixels lie, and what is known of its band.
pub(super) struct Source {
    /// As given.
    pub(super) name: String,
    /// In its files.
    pub(super) pixels: Box<dyn Parts>,
    pub(super) grid: ImageGrid,
    /// Those of fast and slow time.
    pub(super) windows: Option<[Window; 2]>,
    /// Where it was seen from.
    pub(super) carrier: Option<Carrier>,
    /// Pulses that stand for the recording's.
    pub(super) looks: Option<RecordedLooks>,
    /// The record of a product.
    pub(super) metadata: Option<Value>,
    /// Whether coordinates are pixels.
    in_pixels: bool,
}

impl Source {
    /// Reads a product's folder or an array.
    pub(super) fn open(path: &Path) -> anyhow::Result<Self> {
        let name = path.display().to_string();
        let Some(folder) = stored::product_folder(path) else {
            stored::check_is_array(path)?;
            let file = ImageFile::open(path)?;
            let (rows, columns) = file.size();
            if rows * columns == 0 {
                bail!("{name}: an image without pixels");
            }
            let axis = |count| Axis {
                start: 0.0,
                step: 1.0,
                count,
            };
            return Ok(Self {
                name,
                grid: ImageGrid::horizontal(axis(columns), axis(rows), 0.0),
                pixels: Box::new(file),
                windows: None,
                carrier: None,
                looks: None,
                metadata: None,
                in_pixels: true,
            });
        };
        let stored = product::open(folder)?;
        let settings = &stored.metadata["settings"];
        let window = |key: &str| settings[key].as_str().and_then(|text| text.parse().ok());
        let seen = Geometry::deserialize(&stored.metadata["collection"]);
        Ok(Self {
            name,
            carrier: seen.ok().map(|seen| Carrier::of(&seen)),
            windows: window("window").zip(window("slow_window")).map(Into::into),
            looks: RecordedLooks::deserialize(&stored.metadata["support"]).ok(),
            pixels: Box::new(stored.pixels),
            grid: stored.grid,
            metadata: Some(stored.metadata),
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
            Direction::X => self.grid.scene_axes()[0].name,
            Direction::Y => self.grid.scene_axes()[1].name,
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

    /// Grid coordinates, row's and column's, of a place as typed: in the scene frame, but degrees and range of a polar
    /// grid and column and row of an array.
    pub(super) fn coordinates(&self, at: &At) -> anyhow::Result<[f64; 2]> {
        if self.in_pixels || self.grid.polar {
            if at.z.is_some() {
                let what =
                    "--at: the third number says nothing to an array or a polar grid: leave it out";
                return Err(Usage(what.to_owned()).into());
            }
            return Ok([at.y, self.across(at.x)]);
        }
        let grid = &self.grid;
        let normal = grid.x_axis.cross(grid.y_axis);
        let z_m = match at.z {
            Some(z_m) => z_m,
            // Where the plane is above or below the place.
            None if normal.z.abs() > 1e-6 => {
                let from = DVec3::new(at.x, at.y, 0.0) - grid.origin_m.with_z(0.0);
                grid.origin_m.z - normal.dot(from) / normal.z
            }
            None => {
                let what = "--at: the image's plane stands upright, so that x and y alone are no place on it: give X,Y,Z";
                return Err(Usage(what.to_owned()).into());
            }
        };
        Ok(grid.coordinates(DVec3::new(at.x, at.y, z_m)))
    }

    /// What to do about a point that was not measured.
    pub(super) fn explain(&self, error: ResponseError) -> anyhow::Error {
        let advice = match error {
            ResponseError::TooCoarse { .. } => {
                ", or give the recording with --from, and a fine chip is formed of it"
            }
            _ => "",
        };
        anyhow::anyhow!("{error}{advice}")
    }

    /// A measured point in words: its place in the scene, or in an array.
    pub(super) fn place(&self, response: &Response) -> String {
        let (row_value, column_value) = (response.row_value, response.column_value);
        if self.in_pixels {
            return format!("column {column_value:.3}, row {row_value:.3}");
        }
        let [x, y, z] = response.position_m;
        let scene = format!("x {x:.4} m, y {y:.4} m, z {z:.4} m");
        if self.grid.polar {
            let angle = column_value.to_degrees();
            return format!("{scene} (angle {angle:.5} deg, range {row_value:.3} m)");
        }
        scene
    }

    /// The axes across and up as they are shown, each with its label: those of the scene where the grid's run along them.
    pub(super) fn shown_axes(&self) -> [(String, Axis); 2] {
        let grid = &self.grid;
        if self.in_pixels {
            return [
                ("column".to_owned(), grid.columns),
                ("row".to_owned(), grid.rows),
            ];
        }
        if grid.polar {
            let degrees = Axis {
                start: grid.columns.start.to_degrees(),
                step: grid.columns.step.to_degrees(),
                ..grid.columns
            };
            return [
                ("angle (deg)".to_owned(), degrees),
                ("range (m)".to_owned(), grid.rows),
            ];
        }
        let [across, up] = grid.scene_axes();
        [(across, grid.columns), (up, grid.rows)].map(|(scene, axis)| {
            // Values ascend: against the scene's axis they are shown negative.
            let sign = if scene.sign < 0.0 { "-" } else { "" };
            let shown = Axis {
                start: scene.sign * scene.value_m(axis.start),
                ..axis
            };
            (format!("{sign}{} (m)", scene.name), shown)
        })
    }
}

impl Source {
    /// All of the image and of another, to be set against one another, if the budget allows: at most six times their own
    /// size, of which registration takes most.
    pub(super) fn both(&self, session: &Session, other: &Self) -> anyhow::Result<[Image; 2]> {
        let whole = |source: &Self| {
            let (rows, columns) = source.pixels.size();
            [0..rows, 0..columns]
        };
        let pixels = |source: &Self| {
            let (rows, columns) = source.pixels.size();
            rows as u128 * columns as u128
        };
        let bytes = 6 * 8 * (pixels(self) + pixels(other));
        if bytes > u128::from(session.memory_bytes) {
            bail!(
                "setting them against one another needs up to {}; --memory allows {}: raise --memory, measure smaller \
                 images, or compare them (subap compare), for which size is no matter",
                text::bytes(bytes),
                text::bytes(session.memory_bytes.into())
            );
        }
        let read = |source: &Self| {
            let read = source.pixels.window(&whole(source));
            read.map_err(|error| anyhow::anyhow!(error))
        };
        Ok([read(self)?, read(other)?])
    }
}
