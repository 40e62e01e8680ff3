//! `subap velocity`: image one position over a plane of velocities.

use std::time::Instant;

use glam::DVec3;
use serde_json::{Value, json};
use subaperture::focus::coverage;
use subaperture::focus::moving::{VelocityPlane, default_velocities, velocity_resolution_m_s};
use subaperture::focus::{Formed, ImageFormer, Task};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::{Image, power};
use subaperture::phase_history::{Collection, PhaseHistory, Weights};
use subaperture::planner::forecast::cost;
use subaperture::plot::{Panel, ShownAxis};
use subaperture::resolution::survey::Survey;

use crate::ahead::Ahead;
use crate::args::Velocity;
use crate::commands::forming;
use crate::config::{DEFAULT_ERROR_DB, Session, command_line, record_of_run};
use crate::{interrupt, messages, text};

/// Form the plane and write its folder, complete or not at all.
pub(crate) fn run(session: &Session, typed: &Velocity) -> anyhow::Result<()> {
    let start = Instant::now();
    let given = typed.vx.zip(typed.vy);
    let given = given.map(|(vx, vy)| ImageGrid::horizontal(vx, vy, typed.vz));
    if let Some(grid) = &given {
        session.check_grid(grid, 1)?;
    }
    let num_pixels = given.as_ref().map_or(1, ImageGrid::num_pixels);
    let _claims = forming::claim(
        session,
        &typed.writing,
        &typed.input.files,
        &typed.out,
        num_pixels,
    )?;

    let history = session.open(&typed.input)?;
    let collection = history.collection();
    let survey = forming::survey(&history)?;
    let grid = forming::grid_or(session, given, &typed.out, || {
        suited(session, typed, collection)
    })?;
    let former = VelocityPlane {
        position_m: typed.at,
        epoch_s: collection.pulses[0].time_s,
        error_db: typed.error_db.unwrap_or(DEFAULT_ERROR_DB),
    };
    let progress = session.progress("focusing");
    let task = Task {
        history: &history,
        grid: &grid,
        weights: &Weights::new(collection, typed.windows.window, typed.windows.slow_window),
        numerics: typed.numerics(),
        memory_bytes: session.memory_bytes,
        monitor: &progress,
    };
    let rehearsal = &typed.rehearsal;
    // The default axes are not needed where the plane is refused; the reason follows below.
    if let Some(cost) = cost(&former, &task) {
        let ahead = Ahead::of_image(session, rehearsal, (&former, &cost), &task, &typed.out)?;
        if ahead.announce(session, rehearsal)? {
            return Ok(());
        }
    }
    let formed = former.form(&task)?;
    progress.finish();
    if let Some(warning) = coverage::warning(&formed.settings, &grid) {
        messages::warning(warning);
    }

    let brightest = brightest(&formed.image, &grid);
    let plane = Plane {
        typed,
        history: &history,
        survey: &survey,
        former: &former,
        grid: &grid,
        formed: &formed,
        brightest,
    };
    let metadata = plane.record(session, start)?;
    interrupt::check()?;
    let DVec3 { x, y, z } = typed.at;
    let title = format!("{}, from x {x} m, y {y} m, z {z} m", survey.name);
    let panel = Panel {
        axes: ["v_x (m/s)", "v_y (m/s)"].map(ShownAxis::plain),
        ..Panel::new(&formed.image, &grid, title)
    };
    let files = forming::write(session, &typed.out, &formed.image, &panel, &metadata)?;
    if session.json() {
        let mut metadata = metadata;
        metadata["files"] = json!(files);
        return text::say_json("velocity-plane", metadata);
    }
    if !session.prints_text() {
        return Ok(());
    }
    text::say(format!(
        "{}: {} x {} velocities in {}",
        typed.out.display(),
        grid.columns.count,
        grid.rows.count,
        text::duration(start.elapsed())
    ))?;
    text::say(match brightest {
        Some((v, level_db)) => format!(
            "brightest at v_x {:.3} m/s, v_y {:.3} m/s, v_z {:.3} m/s: {}",
            v.x,
            v.y,
            v.z,
            text::decibels(level_db)
        ),
        None => "no brightest velocity: the plane is zero".to_owned(),
    })?;
    Ok(())
}

/// Velocities given by options, with defaults for the other axes.
fn suited(
    session: &Session,
    typed: &Velocity,
    collection: &Collection,
) -> anyhow::Result<ImageGrid> {
    let axis = |option: &str, typed_axis: Option<Axis>, direction: DVec3| match typed_axis {
        Some(axis) => Ok(axis),
        None => default_velocities(collection, typed.at, direction)
            .map_err(|error| anyhow::anyhow!("{error}: give --{option} START:STOP:STEP")),
    };
    let vx = axis("vx", typed.vx, DVec3::X)?;
    let vy = axis("vy", typed.vy, DVec3::Y)?;
    for (name, axis) in [("v_x", &vx), ("v_y", &vy)] {
        session.note(1, || {
            format!(
                "{name} from {} to {} m/s by {}",
                text::significant(axis.start, 4),
                text::significant(axis.at(axis.count - 1), 4),
                text::significant(axis.step, 4)
            )
        });
    }
    Ok(ImageGrid::horizontal(vx, vy, typed.vz))
}

/// Velocity of the brightest pixel and its level, dB; `None` if all pixels are zero.
fn brightest(image: &Image, grid: &ImageGrid) -> Option<(DVec3, f64)> {
    let peak = image.peak().filter(|peak| power(peak.value) > 0.0)?;
    let velocity = grid.position_m(peak.row, peak.column);
    Some((velocity, 10.0 * power(peak.value).log10()))
}

/// Velocity plane with its inputs.
struct Plane<'p> {
    typed: &'p Velocity,
    history: &'p dyn PhaseHistory,
    survey: &'p Survey,
    former: &'p VelocityPlane,
    grid: &'p ImageGrid,
    formed: &'p Formed,
    brightest: Option<(DVec3, f64)>,
}

impl Plane<'_> {
    /// Record of the plane as JSON.
    fn record(&self, session: &Session, start: Instant) -> anyhow::Result<Value> {
        let resolution = |direction| {
            let value = velocity_resolution_m_s(
                self.history.collection(),
                self.typed.at,
                self.former.epoch_s,
                direction,
            );
            value.is_finite().then_some(value)
        };
        let axis = |name: &str, axis: &Axis| json!({ "axis": name, "start": axis.start, "step": axis.step, "count": axis.count });
        Ok(json!({
            "schema": "subaperture-velocity-plane",
            "schema_version": 1,
            "run": record_of_run(session, start.elapsed()),
            "command_line": command_line(),
            "image": {
                "file": "image.npy",
                "type": "complex64, C order, [rows, columns]",
                "scale": "a unit scatterer at this place and a pixel's velocity reads 1",
            },
            "velocities": {
                "columns": axis("v_x in m/s", &self.grid.columns),
                "rows": axis("v_y in m/s", &self.grid.rows),
                "v_z_m_s": self.typed.vz,
            },
            "position_m": self.typed.at.to_array(),
            "epoch_s": self.former.epoch_s,
            "resolution_m_s": { "v_x": resolution(DVec3::X), "v_y": resolution(DVec3::Y) },
            "settings": {
                "window": self.typed.windows.window.to_string(),
                "slow_window": self.typed.windows.slow_window.to_string(),
                "resolved": self.formed.settings,
            },
            "collection": forming::about(self.survey, self.history)?,
            "inputs": self.history.inputs()?,
            "brightest": self.brightest.map(|(velocity, level_db)| {
                json!({ "velocity_m_s": velocity.to_array(), "level_db": level_db })
            }),
            "warnings": messages::warnings(),
        }))
    }
}
