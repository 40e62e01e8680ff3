//! What `image.json` says: everything needed to know how an image came about, and to make it again.

use glam::DVec3;
use serde_json::{Value, json};

use super::{IMAGE, QUICKLOOK};
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::{Image, power};
use subaperture_model::phase_history::InputFile;

/// Version of the record's layout; it grows when a reader would have to change.
pub const SCHEMA_VERSION: u32 = 1;

/// What goes into the record of an image. Values are JSON, `null` where there is nothing to say.
#[derive(Clone, Debug)]
pub struct Record<'a> {
    /// Program, version, time taken.
    pub run: Value,
    /// The command line, if there was one.
    pub command_line: Value,
    /// Where the pixels lie.
    pub grid: &'a ImageGrid,
    /// Where the scene lies.
    pub frame: &'a SceneFrame,
    /// What was given and what it came to: `algorithm`, `window`, `slow_window`, `resolved`.
    pub settings: Value,
    /// What is known of the recording: its survey.
    pub collection: Value,
    /// Pulses that stand for the recording's.
    pub support: Value,
    /// When and where the antennas were ([`super::Antennas::to_json`]).
    pub antennas: Value,
    /// The files behind the image.
    pub inputs: &'a [InputFile],
    /// `None` of an image of zeros.
    pub brightest: Option<Brightest>,
    /// What the picture shows; `None` if there is none.
    pub picture: Option<Picture<'a>>,
    /// The image's error, measured.
    pub check: Value,
    /// What its user has to know: a list of sentences.
    pub warnings: Value,
}

/// What a picture shows beside the image.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    /// Its title.
    pub title: &'a str,
    /// From the radar to the scene, a unit vector of the scene frame.
    pub look: Option<DVec3>,
    /// North, likewise.
    pub north: Option<DVec3>,
}

/// The brightest pixel of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brightest {
    /// Where it is, metres in the scene frame.
    pub position_m: [f64; 3],
    /// Its magnitude, dB; 0 is a unit scatterer.
    pub level_db: f64,
    /// Its row, from 0.
    pub row: usize,
    /// Its column, from 0.
    pub column: usize,
}

impl Brightest {
    /// `None` of an image of zeros.
    pub fn of(image: &Image, grid: &ImageGrid) -> Option<Self> {
        let peak = image.peak()?;
        Self::at(grid, [peak.row, peak.column], power(peak.value))
    }

    /// The pixel at this row and column, of which `|z|^2` is `power`. `None` if that is zero.
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
    /// The record as JSON.
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

/// A grid's axes and plane, and the surface over it, as [`super::read()`] reads them.
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
    // Where pixels lie in the plane nothing is said.
    if let Some(relief) = &grid.relief {
        record["relief"] = json!(relief);
    }
    record
}

/// The scene frame.
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
