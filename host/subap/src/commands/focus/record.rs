//! `image.json`: everything needed to say how an image came about, and to make it again.

use std::time::Duration;

use serde_json::{Map, Value, json};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::phase_history::InputFile;
use subaperture::plot::Orientation;
use subaperture::resolution::support::RecordedLooks;

use super::Peak;
use super::check::Check;
use crate::args::Focus;
use crate::config::{Session, command_line, record_of_run};
use crate::messages;

/// Version of the record's layout; it grows when a reader would have to change.
const SCHEMA_VERSION: u32 = 1;

/// What goes into the record.
pub(super) struct Record<'a> {
    pub(super) session: &'a Session,
    /// What was given and what it came to.
    pub(super) settings: Value,
    pub(super) grid: &'a ImageGrid,
    pub(super) frame: &'a SceneFrame,
    /// What is known of the recording or the maps.
    pub(super) collection: Value,
    /// Pulses that stand for the recording's; of maps there are none.
    pub(super) support: Option<RecordedLooks>,
    pub(super) inputs: &'a [InputFile],
    pub(super) check: Option<&'a Check>,
    /// `None` of an image of zeros.
    pub(super) peak: Option<Peak>,
    /// What the picture shows beside it.
    pub(super) orientation: Orientation,
    pub(super) taken: Duration,
}

impl Record<'_> {
    /// The record as JSON; `title` is the picture's.
    pub(super) fn to_json(&self, title: &str) -> Value {
        json!({
            "schema": "subaperture-image",
            "schema_version": SCHEMA_VERSION,
            "run": record_of_run(self.session, self.taken),
            "command_line": command_line(),
            "image": {
                "file": "image.npy",
                "type": "complex64, C order, [rows, columns]",
                "scale": "a unit scatterer on a pixel, seen alike by all pulses, reads 1; under a beam the weighted \
                          mean of its amplitude over the pulses; phase refers to the pixel's own path",
            },
            "grid": grid(self.grid),
            "frame": frame(self.frame),
            "settings": self.settings,
            "collection": self.collection,
            "support": self.support,
            "inputs": self.inputs,
            "brightest": self.peak,
            "picture": {
                "file": "image.png",
                "title": title,
                "look": self.orientation.look.map(|v| v.to_array()),
                "north": self.orientation.north.map(|v| v.to_array()),
            },
            "check": self.check,
            "warnings": messages::warnings(),
        })
    }
}

/// What was given (`null` where it was left to the program) and what it came to.
pub(super) fn settings(typed: &Focus, former: &str, resolved: &Map<String, Value>) -> Value {
    json!({
        "algorithm": former,
        "window": typed.window.to_string(),
        "slow_window": typed.slow_window.to_string(),
        "given": {
            "grid": typed.grid.is_some(),
            "mode": typed.mode.map(|mode| format!("{mode:?}").to_lowercase()),
            "error_db": typed.error_db,
            "allow_error": typed.allow_error,
            "sub_cpi": typed.sub_cpi,
            "patch_m": typed.patch,
            "velocity_m_s": typed.velocity.map(|v| v.to_array()),
            "channel": typed.input.channel,
            "set": typed.input.set.iter().map(|(key, value)| format!("{key}={value}")).collect::<Vec<_>>(),
            "check": typed.check,
            "no_keystone": typed.no_keystone,
            "no_src": typed.no_src,
            "top_db": typed.look.top,
            "span_db": typed.look.span,
        },
        "resolved": resolved,
    })
}

/// A grid's axes and plane.
pub(crate) fn grid(grid: &ImageGrid) -> Value {
    let (columns, rows) = if grid.polar {
        ("angle in radians", "range in metres")
    } else {
        ("x in metres", "y in metres")
    };
    json!({
        "kind": if grid.polar { "polar" } else { "cartesian" },
        "columns": { "axis": columns, "start": grid.columns.start, "step": grid.columns.step, "count": grid.columns.count },
        "rows": { "axis": rows, "start": grid.rows.start, "step": grid.rows.step, "count": grid.rows.count },
        "origin_m": grid.origin_m.to_array(),
        "x_axis": grid.x_axis.to_array(),
        "y_axis": grid.y_axis.to_array(),
    })
}

/// The scene frame.
fn frame(frame: &SceneFrame) -> Value {
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
