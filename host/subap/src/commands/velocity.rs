//! `subap velocity`: recordings in, one place at many velocities out.

use std::time::Instant;

use anyhow::Context;
use glam::DVec3;
use serde_json::json;
use subaperture::focus::moving::{VelocityPlane, velocity_resolution_m_s};
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::power;
use subaperture::io::product::{self, Product};
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::planner::forecast::Settings;
use subaperture::plot::{self, Panel, ShownAxis};
use subaperture::resolution::survey::Survey;

use crate::ahead::Ahead;
use crate::args::Velocity;
use crate::config::{DEFAULT_ERROR_DB, Session, command_line, record_of_run};
use crate::{interrupt, messages, text};

/// Forms the plane and writes its folder, complete or not at all.
pub(crate) fn run(session: &Session, typed: &Velocity) -> anyhow::Result<()> {
    let start = Instant::now();
    let grid = ImageGrid::horizontal(typed.vx, typed.vy, typed.vz);
    session.check_grid(&grid, 1)?;
    let mut claims = session.claims(&typed.writing, &typed.input.paths);
    claims.folder(&typed.out, product::NAMES)?;
    Product::prepare(&typed.out, grid.num_pixels())?;

    let history = session.open(&typed.input)?;
    let collection = history.collection();
    let survey = Survey::of(collection).context("the input holds no pulses")?;
    let former = VelocityPlane {
        position_m: typed.at,
        epoch_s: collection.pulses[0].time_s,
        error_db: typed.error_db.unwrap_or(DEFAULT_ERROR_DB),
    };
    let weights = Weights::new(collection, typed.window, typed.slow_window);
    let progress = session.progress("focusing");
    let task = Task {
        history: &history,
        grid: &grid,
        weights: &weights,
        memory_bytes: session.memory_bytes,
        monitor: &progress,
    };
    let settings = Settings::within(former.error_db);
    let ahead = Ahead::of_image(
        session,
        &typed.rehearsal,
        &former,
        &task,
        &settings,
        &typed.out,
    )?;
    if ahead.announce(session, &typed.rehearsal)? {
        return Ok(());
    }
    let formed = former.form(&task)?;
    progress.finish();

    let peak = formed.image.peak().filter(|peak| power(peak.value) > 0.0);
    let brightest = peak.map(|peak| {
        let velocity = grid.position_m(peak.row, peak.column);
        (velocity, 10.0 * power(peak.value).log10())
    });
    let resolution = |direction| {
        let value = velocity_resolution_m_s(collection, typed.at, former.epoch_s, direction);
        value.is_finite().then_some(value)
    };
    let axis = |name: &str, axis: &Axis| json!({ "axis": name, "start": axis.start, "step": axis.step, "count": axis.count });
    let metadata = json!({
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
            "columns": axis("v_x in m/s", &grid.columns),
            "rows": axis("v_y in m/s", &grid.rows),
            "v_z_m_s": typed.vz,
        },
        "position_m": typed.at.to_array(),
        "epoch_s": former.epoch_s,
        "resolution_m_s": { "v_x": resolution(DVec3::X), "v_y": resolution(DVec3::Y) },
        "settings": {
            "window": typed.window.to_string(),
            "slow_window": typed.slow_window.to_string(),
            "resolved": formed.settings,
        },
        "collection": serde_json::to_value(&survey)?,
        "inputs": history.inputs()?,
        "brightest": brightest.map(|(velocity, level_db)| {
            json!({ "velocity_m_s": velocity.to_array(), "level_db": level_db })
        }),
        "warnings": messages::warnings(),
    });
    interrupt::check()?;
    let DVec3 { x, y, z } = typed.at;
    let title = format!("{}, from x {x} m, y {y} m, z {z} m", survey.name);
    let quicklook = plot::quicklook_within(
        &Panel {
            axes: ["v_x (m/s)", "v_y (m/s)"].map(ShownAxis::plain),
            ..Panel::new(&formed.image, &grid, title)
        },
        session.memory.picture_bytes,
    )?;
    Product {
        image: &formed.image,
        metadata: &metadata,
        quicklook: &quicklook,
    }
    .write(&typed.out)?;
    if session.json() {
        return text::say_json("velocity-plane", metadata);
    }
    if !session.tells() {
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
