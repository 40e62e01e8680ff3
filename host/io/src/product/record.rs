//! Content of `image.json`: everything needed to understand and reproduce an image.

use glam::DVec3;
use serde_json::{Value, json};

use super::{IMAGE, QUICKLOOK};
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::{Image, power};
use subaperture_model::phase_history::InputFile;

/// Version of the record's layout, incremented when readers have to change.
pub const SCHEMA_VERSION: u32 = 1;

/// Content of the record of an image. JSON values are `null` where unknown.
#[derive(Clone, Debug)]
pub struct Record<'a> {
    /// Program, version, run time.
    pub run: Value,
    /// Command line, if any.
    pub command_line: Value,
    /// Pixel grid.
    pub grid: &'a ImageGrid,
    /// Scene frame.
    pub frame: &'a SceneFrame,
    /// Settings as given and as resolved: `algorithm`, `window`, `slow_window`, `resolved`.
    pub settings: Value,
    /// Survey of the recording.
    pub collection: Value,
    /// Pulses that represent the recording.
    pub support: Value,
    /// Antenna positions over time ([`super::Antennas::to_json`]).
    pub antennas: Value,
    /// Input files of the image.
    pub inputs: &'a [InputFile],
    /// Brightest pixel. `None` if all pixels are zero.
    pub brightest: Option<Brightest>,
    /// Annotations of the picture. `None` without a picture.
    pub picture: Option<Picture<'a>>,
    /// Measured error of the image.
    pub check: Value,
    /// Warnings, a list of sentences.
    pub warnings: Value,
}

/// Annotations of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    /// Title.
    pub title: &'a str,
    /// Look direction from radar to scene, a unit vector in the scene frame.
    pub look: Option<DVec3>,
    /// North, a unit vector in the scene frame.
    pub north: Option<DVec3>,
}

/// Brightest pixel of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brightest {
    /// Position in metres in the scene frame.
    pub position_m: [f64; 3],
    /// Magnitude in dB relative to a unit scatterer.
    pub level_db: f64,
    /// Row index from 0.
    pub row: usize,
    /// Column index from 0.
    pub column: usize,
}

impl Brightest {
    /// Find the brightest pixel. `None` if all pixels are zero.
    pub fn of(image: &Image, grid: &ImageGrid) -> Option<Self> {
        let peak = image.peak()?;
        Self::at(grid, [peak.row, peak.column], power(peak.value))
    }

    /// Brightest pixel from its row, column and power `|z|^2`. `None` if the power is zero.
    pub fn at(grid: &ImageGrid, [row, column]: [usize; 2], power: f64) -> Option<Self> {
        (power > 0.0).then(|| Self {
            position_m: grid.position_m(row, column).to_array(),
            level_db: 10.0 * power.log10(),
            row,
            column,
        })
    }

    fn to_json(self) -> Value {
        json!({
            "position_m": self.position_m,
            "level_db": self.level_db,
            "row": self.row,
            "column": self.column,
        })
    }
}

impl Record<'_> {
    /// Convert the record to JSON.
    pub fn to_json(&self) -> Value {
        json!({
            "schema": "subaperture-image",
            "schema_version": SCHEMA_VERSION,
            "run": self.run,
            "command_line": self.command_line,
            "image": {
                "file": IMAGE,
                "type": "complex64, C order, [rows, columns]",
                "scale": "a unit scatterer on a pixel, seen alike by all pulses, reads 1; under a beam the weighted \
                          mean of its amplitude over the pulses; phase refers to the pixel's own path",
            },
            "grid": grid(self.grid),
            "frame": frame(self.frame),
            "settings": self.settings,
            "collection": self.collection,
            "support": self.support,
            "antennas": self.antennas,
            "inputs": self.inputs,
            "brightest": self.brightest.map(Brightest::to_json),
            "picture": self.picture.map(|picture| json!({
                "file": QUICKLOOK,
                "title": picture.title,
                "look": picture.look.map(|v| v.to_array()),
                "north": picture.north.map(|v| v.to_array()),
            })),
            "check": self.check,
            "warnings": self.warnings,
        })
    }
}

/// Axes, plane and surface of a grid, as read by [`super::read()`].
pub fn grid(grid: &ImageGrid) -> Value {
    let (columns, rows) = if grid.polar {
        ("angle in radians", "range in metres")
    } else {
        ("x in metres", "y in metres")
    };
    let mut record = json!({
        "kind": if grid.polar { "polar" } else { "cartesian" },
        "columns": { "axis": columns, "start": grid.columns.start, "step": grid.columns.step, "count": grid.columns.count },
        "rows": { "axis": rows, "start": grid.rows.start, "step": grid.rows.step, "count": grid.rows.count },
        "origin_m": grid.origin_m.to_array(),
        "x_axis": grid.x_axis.to_array(),
        "y_axis": grid.y_axis.to_array(),
    });
    // Omitted for pixels in the plane.
    if let Some(relief) = &grid.relief {
        record["relief"] = json!(relief);
    }
    record
}

/// Scene frame in JSON.
pub fn frame(frame: &SceneFrame) -> Value {
    match frame {
        SceneFrame::Local => json!({ "kind": "local" }),
        SceneFrame::Earth {
            origin_ecf_m,
            x_axis_ecf,
            y_axis_ecf,
        } => json!({
            "kind": "earth",
            "origin_ecf_m": origin_ecf_m.to_array(),
            "x_axis_ecf": x_axis_ecf.to_array(),
            "y_axis_ecf": y_axis_ecf.to_array(),
        }),
    }
}
