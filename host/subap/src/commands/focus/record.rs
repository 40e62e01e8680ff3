//! Record of an image, `image.json`: its provenance and all settings needed to reproduce it.

use std::time::Duration;

use glam::DVec3;
use serde_json::{Map, Value, json};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::io::product::Antennas;
use subaperture::io::product::record::{self, Brightest};
use subaperture::phase_history::{Collection, InputFile};
use subaperture::plot::Orientation;
use subaperture::resolution::support::RecordedLooks;

use super::check::Check;
use super::job::Job;
use crate::args::AntennaWeighting;
use crate::commands::forming;
use crate::config::{Session, command_line, record_of_run};
use crate::messages;

/// Contents of the record.
pub(super) struct Record<'a> {
    pub(super) session: &'a Session,
    /// Given options and resolved settings.
    pub(super) settings: Value,
    pub(super) grid: &'a ImageGrid,
    pub(super) frame: &'a SceneFrame,
    /// Metadata of the recording or the maps.
    pub(super) collection: Value,
    /// Recording, represented by a few pulses, and the centre of the grid; `None` for maps.
    pub(super) seen: Option<(&'a Collection, DVec3)>,
    /// Times and positions of the antennas; `None` for maps.
    pub(super) antennas: Option<Antennas>,
    pub(super) inputs: &'a [InputFile],
    pub(super) check: Option<Check>,
    /// Brightest pixel; `None` if all pixels are zero.
    pub(super) peak: Option<Brightest>,
    /// North arrow and look direction drawn in the picture.
    pub(super) orientation: Orientation,
    pub(super) taken: Duration,
}

/// Results of image formation that go into the record.
pub(super) struct About {
    pub(super) settings: Value,
    pub(super) check: Option<Check>,
    pub(super) peak: Option<Brightest>,
}

impl<'a> Record<'a> {
    /// Record of an image formed from a recording.
    pub(super) fn of(
        job: &Job<'a>,
        grid: &'a ImageGrid,
        about: About,
        inputs: &'a [InputFile],
    ) -> anyhow::Result<Self> {
        let collection = job.history.collection();
        let middle_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
        Ok(Self {
            session: job.session,
            settings: about.settings,
            grid,
            frame: &collection.frame,
            collection: forming::about(job.survey.get(), job.history)?,
            seen: Some((collection, middle_m)),
            antennas: Some(Antennas::of(job.history)),
            inputs,
            check: about.check,
            peak: about.peak,
            orientation: Orientation::of(collection, grid),
            taken: job.start.elapsed(),
        })
    }

    /// Format as JSON; `title` is the picture's. Representative pulses are chosen here, in parallel with drawing the picture.
    pub(super) fn to_json(&self, title: &str) -> Value {
        let axes = [self.grid.x_axis, self.grid.y_axis];
        let seen = self.seen;
        let support = seen.and_then(|(all, middle_m)| RecordedLooks::of(all, middle_m, axes));
        record::Record {
            run: record_of_run(self.session, self.taken),
            command_line: json!(command_line()),
            grid: self.grid,
            frame: self.frame,
            settings: self.settings.clone(),
            collection: self.collection.clone(),
            support: json!(support),
            antennas: json!(self.antennas.as_ref().map(Antennas::to_json)),
            inputs: self.inputs,
            brightest: self.peak,
            picture: Some(record::Picture {
                title,
                look: self.orientation.look,
                north: self.orientation.north,
            }),
            check: json!(self.check),
            warnings: json!(messages::warnings()),
        }
        .to_json()
    }
}

/// Given options (`null` where left to the program) and resolved settings.
pub(super) fn settings(job: &Job, former: &str, resolved: &Map<String, Value>) -> Value {
    let typed = job.typed;
    let image = &typed.image;
    let mut given = image.forming.former.record();
    let is_matched = image.forming.antenna_weights == AntennaWeighting::Matched;
    let others = [
        ("grid", json!(image.grid.pixels.is_some())),
        ("surface", json!(image.grid.surface.to_string())),
        ("geoid", {
            let geoid = image.grid.geoid.as_ref();
            json!(geoid.map(ToString::to_string))
        }),
        ("troposphere", json!(image.grid.troposphere.to_string())),
        ("allow_error", json!(image.forming.allow_error)),
        (
            "beam",
            json!(image.forming.beam.map(|beam| beam.to_string())),
        ),
        ("squint_deg", json!(image.forming.squint)),
        ("doppler_band_hz", json!(image.forming.doppler_band)),
        ("doppler_centroid_hz", json!(image.forming.doppler_centroid)),
        ("antenna_weights", json!(is_matched.then_some("matched"))),
        (
            "velocity_m_s",
            json!(typed.target.velocity.map(|v| v.to_array())),
        ),
        ("motion", {
            let file = typed.target.motion.as_ref();
            json!(file.map(|path| path.to_string_lossy()))
        }),
        ("track", {
            let track = typed.track.as_ref();
            json!(track.map(ToString::to_string))
        }),
        ("navigation", {
            let logs = typed.logs.navigation.iter();
            json!(logs.map(|path| path.to_string_lossy()).collect::<Vec<_>>())
        }),
        ("navigation_start", {
            let start = typed.logs.navigation_start;
            // In the syntax of the option, without loss of digits.
            json!(start.map(|start| match start.week {
                0 => start.seconds.to_string(),
                week => format!("{week}:{}", start.seconds),
            }))
        }),
        (
            "lever_arm_m",
            json!(typed.logs.lever_arm.map(|arm| arm.to_array())),
        ),
        ("phase", {
            let file = typed.phase.as_ref();
            json!(file.map(|path| path.to_string_lossy()))
        }),
        ("channel", json!(typed.input.channel)),
        ("channels", {
            let several = typed.input.channels.as_ref();
            json!(several.map(ToString::to_string))
        }),
        ("set", {
            let set = typed.input.set.iter();
            json!(
                set.map(|(key, value)| format!("{key}={value}"))
                    .collect::<Vec<_>>()
            )
        }),
        ("gmti", {
            let file = typed.gmti.as_ref();
            json!(file.map(|path| path.to_string_lossy()))
        }),
        ("check", json!(typed.check)),
        ("top_db", typed.look.recorded_top()),
        ("span_db", json!(typed.look.span)),
        ("remap", json!(typed.look.remap.name())),
    ];
    given.extend(others.map(|(key, value)| (key.to_owned(), value)));
    let mut settings = json!({
        "algorithm": former,
        "window": image.forming.windows.window.to_string(),
        "slow_window": image.forming.windows.slow_window.to_string(),
        "given": given,
        "resolved": resolved,
    });
    if !job.movers.is_null() {
        settings["movers"] = job.movers.clone();
    }
    settings
}

/// Report the former's settings and its warnings.
pub(super) fn report_settings(settings: &Map<String, Value>) {
    let report = settings.get("warnings").and_then(Value::as_array);
    for warning in report.into_iter().flatten().filter_map(Value::as_str) {
        messages::warning(warning);
    }
    for (key, value) in settings {
        messages::setting(key, value);
    }
}
