//! `subap displacement`: displacement of persistent points over repeat passes.

mod pictures;
mod points;
mod products;
mod rate;
mod read;

use std::time::Instant;

use anyhow::anyhow;
use serde_json::{Value, json};
use subaperture::interferometry::displacement::{
    DisplacementError, DisplacementSeries, Passes, Settings, measure,
};
use subaperture::io::ours::Kind;
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;

use super::rasters;
use crate::args::{Displacement, PairFormat};
use crate::config::{Session, record_of_run};
use crate::{interrupt, messages, text};
use rate::Rate;
use read::Read;

/// File names of the pictures.
const PICTURES: [&str; 3] = ["displacement.png", "velocity.png", "series.png"];

/// Name of the record.
const RECORD: &str = "displacement.json";

/// Name of the table of points.
const POINTS: &str = "points.csv";

/// Measure displacement and write all results.
pub(crate) fn run(session: &Session, typed: &Displacement) -> anyhow::Result<()> {
    let start = Instant::now();
    let has = |format| typed.formats.contains(&format);
    let mut claims = session.claims(&typed.writing, &typed.passes);
    claims.folder(&typed.out, PICTURES.into_iter().chain([RECORD, POINTS]))?;
    if has(PairFormat::Cog) {
        for name in products::MAPS {
            claims.file(&typed.out.join(name), Kind::Map)?;
        }
    }
    if has(PairFormat::Zarr) {
        claims.store(&typed.out.join(products::STACK))?;
    }

    let progress = session.progress("reading");
    let read = Read::new(session, typed)?;
    if has(PairFormat::Cog) {
        rasters::check_place(&read.opened[0])?;
    }
    interrupt::check()?;
    progress.finish();
    let progress = session.progress("measuring");
    let series = measured(typed, &read)?;
    progress.finish();
    interrupt::check()?;
    warn(&series);

    let rate = Rate::of_span(read.times_s.last().copied().unwrap_or_default());
    let mut about = about(&read, &series, &rate);
    let mut files = FileSet::new();
    for (name, bytes) in PICTURES
        .iter()
        .zip(pictures::draw(session, &read, &series, &rate)?)
    {
        interrupt::check()?;
        files.write_bytes(&typed.out.join(name), FileKind::Picture, &bytes)?;
    }
    let table = points::csv(&series, &read.frame, &rate);
    files.write_bytes(
        &typed.out.join(POINTS),
        FileKind::Displacement,
        table.as_bytes(),
    )?;
    if has(PairFormat::Cog) {
        products::add_maps(session, typed, &read, &series, &rate, &mut files)?;
    }
    let mut record = record_of_run(session, start.elapsed());
    record["schema"] = "subaperture-displacement-record".into();
    record["schema_version"] = 1.into();
    record["displacement"] = about.clone();
    let bytes = serde_json::to_vec_pretty(&record)?;
    files.write_bytes(&typed.out.join(RECORD), FileKind::Record, &bytes)?;
    let mut files = files.commit()?;
    if has(PairFormat::Zarr) {
        files.push(products::write_stack(
            session, typed, &read, &series, &rate,
        )?);
    }
    if session.json() {
        about["files"] = json!(files);
        return text::say_json("displacement", about);
    }
    if session.prints_text() {
        text::say(describe(typed, &read, &series, &rate))?;
    }
    Ok(())
}

fn measured(typed: &Displacement, read: &Read) -> anyhow::Result<DisplacementSeries> {
    let passes = Passes {
        images: &read.images,
        times_s: &read.times_s,
        grid: &read.grid,
        radar_m: read.radar_m,
        wavelength_m: read.wavelength_m,
    };
    let settings = Settings {
        dispersion: typed.dispersion,
        floor_db: typed.floor,
        choice: typed.points.into(),
        screen: typed.screen.into(),
        stable: typed.stable.clone(),
        most_points: read.most_points,
    };
    measure(&passes, &settings).map_err(|error| match error {
        DisplacementError::TooManyPoints { .. } => {
            anyhow!("{error}: --floor, --dispersion, --points maxima, --memory")
        }
        _ => error.into(),
    })
}

fn warn(series: &DisplacementSeries) {
    let counts = &series.counts;
    let first = series
        .points
        .iter()
        .filter_map(|point| point.doubtful_from)
        .min();
    if let Some(pass) = first {
        messages::warning(format!(
            "displacement: {} of {} points move by more than an eighth of a wavelength relative to their neighbours between two passes; half-wavelength slips are possible from \
             pass {pass} on (counted from 0); column doubtful_from of {POINTS}",
            counts.doubtful, counts.points
        ));
    }
}

/// Extremes of a quantity over the points that are not doubtful.
fn extremes(series: &DisplacementSeries, of: impl Fn(usize) -> f64) -> Option<[f64; 2]> {
    let certain = (0..series.points.len()).filter(|&n| series.points[n].doubtful_from.is_none());
    certain.map(of).fold(None, |range, value| match range {
        None => Some([value, value]),
        Some([low, high]) => Some([low.min(value), high.max(value)]),
    })
}

/// Figures of the measurement.
fn about(read: &Read, series: &DisplacementSeries, rate: &Rate) -> Value {
    let last = read.times_s.len() - 1;
    let pass = |n: usize| {
        json!({
            "image": read.opened[n].path.display().to_string(),
            "time_s": read.times_s[n],
            "start_ns": read.start_ns.get(n),
            "screen": series.screens[n],
        })
    };
    json!({
        "passes": (0..=last).map(pass).collect::<Vec<_>>(),
        "wavelength_m": read.wavelength_m,
        "radar_m": read.radar_m,
        "screen_range_m": series.screen_range_m,
        "counts": series.counts,
        "sign": "positive away from the radar, relative to the first pass",
        "displacement_mm": extremes(series, |n| 1e3 * series.points[n].displacement_m[last]),
        "velocity_unit": rate.text,
        "velocity": extremes(series, |n| rate.of(series.points[n].velocity_m_s)),
    })
}

fn describe(typed: &Displacement, read: &Read, series: &DisplacementSeries, rate: &Rate) -> String {
    let counts = &series.counts;
    let last = read.times_s.len() - 1;
    let range = |extremes: Option<[f64; 2]>, unit: &str| match extremes {
        Some([low, high]) => format!("{low:.3} to {high:.3} {unit}, positive away from the radar"),
        None => "not known: all points are doubtful".to_owned(),
    };
    let deviations = series.points.iter().map(|point| point.deviation_m[last]);
    let mut deviations: Vec<f64> = deviations.collect();
    deviations.sort_by(f64::total_cmp);
    let reference = match typed.stable.is_empty() {
        true => format!("{} points that agree", counts.screen),
        false => format!("{} points in stable areas", counts.stable),
    };
    [
        format!(
            "passes               {} over {:.4} {}s",
            read.times_s.len(),
            rate.time(read.times_s[last]),
            rate.unit()
        ),
        format!(
            "points               {} of {} pixels above the floor, {} doubtful",
            counts.points, counts.above_floor, counts.doubtful
        ),
        format!("reference            {reference}"),
        format!(
            "displacement         {}",
            range(
                extremes(series, |n| 1e3 * series.points[n].displacement_m[last]),
                "mm"
            )
        ),
        format!(
            "standard deviation   {:.4} mm (median)",
            1e3 * deviations[deviations.len() / 2]
        ),
        format!(
            "velocity             {}",
            range(
                extremes(series, |n| rate.of(series.points[n].velocity_m_s)),
                rate.text
            )
        ),
        typed.out.display().to_string(),
    ]
    .join("\n")
}
