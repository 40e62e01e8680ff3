//! `subap quality`: measure an image, or its difference from another.

mod from;
mod pictures;
mod report;
mod source;
mod theory;

use std::path::Path;

use anyhow::Context;
use serde_json::{Value, json};
use subaperture::geometry::Extent;
use subaperture::image::Comparison;
use subaperture::io::claim::OutputClaims;
use subaperture::io::written::WrittenFile;
use subaperture::quality::PairError;
use subaperture::quality::coherence::coherence;
use subaperture::quality::difference::percent_difference;
use subaperture::quality::registration::offset;
use subaperture::quality::response::{Cut, ResponseError, Settings, Target, measure_in, strongest};
use subaperture::quality::statistics::{Region, Statistics};

use crate::args::Quality;
use crate::config::Session;
use crate::failure::Usage;
use crate::{interrupt, messages, text};
use from::From;
use report::{Against, Point, Report};
use source::{Both, Source};
use theory::{Basis, Theory};

/// Measure an image and print the results.
pub(crate) fn run(session: &Session, typed: &Quality) -> anyhow::Result<()> {
    let measuring = session.progress("measuring");
    let source = Source::open(session, &typed.image)?;
    if let Some(why) = source.without_phase()
        && (!typed.points.at.is_empty() || !typed.from.is_empty())
    {
        anyhow::bail!("{why}");
    }
    if typed.measuring.line_of_sight.is_some() && source.grid.polar {
        let fault = "--line-of-sight does not apply to a polar grid: leave it out";
        return Err(Usage(fault.to_owned()).into());
    }
    let basis = Basis::new(&source, typed.measuring.window);
    let (settings, targets) = targets(session, typed, &source, &basis)?;
    let from = match typed.from.is_empty() {
        true => None,
        false => Some(From::open(session, typed, &source)?),
    };
    if let (Some(from), true) = (&from, typed.rehearsal.dry_run) {
        measuring.finish();
        from.ahead(&targets, &settings)?
            .announce(session, &typed.rehearsal)?;
        return Ok(());
    }
    let statistics = statistics(typed, &source)?;
    let points = points(from.as_ref(), &source, &basis, targets, &settings)?;
    interrupt::check()?;
    let against = match &typed.against {
        None => None,
        Some(path) => Some(against(
            session,
            typed,
            &source,
            &Source::open(session, path)?,
        )?),
    };
    interrupt::check()?;
    let report = Report {
        image: source.name.clone(),
        window: basis.name(),
        points,
        statistics,
        against,
    };
    measuring.finish();
    if !session.json() {
        print(&report, &source)?;
    }
    let files = match &typed.plots {
        Some(folder) => {
            let mut claims = session.claims(
                &typed.writing,
                &[Some(&typed.image), typed.against.as_ref()]
                    .into_iter()
                    .flatten()
                    .chain(&typed.from)
                    .collect::<Vec<_>>(),
            );
            pictures::write(
                &mut claims,
                folder,
                &report,
                &source,
                session.memory.picture_bytes,
            )?
        }
        None => Vec::new(),
    };
    if session.json() {
        let mut report = serde_json::to_value(&report)?;
        report["files"] = json!(files);
        text::say_json("quality", report)?;
    }
    Ok(())
}

/// Measure the given or the strongest points and draw them into the folder `plots` without printing. Returns the JSON report
/// and the pictures.
pub(crate) fn of_job(
    session: &Session,
    typed: &Quality,
    strongest: usize,
    plots: &Path,
    claims: &mut OutputClaims,
) -> anyhow::Result<(Value, Vec<WrittenFile>)> {
    let measuring = session.progress("measuring");
    let source = Source::open(session, &typed.image)?;
    let basis = Basis::new(&source, typed.measuring.window);
    let (settings, targets) = targets(session, typed, &source, &basis)?;
    let points = match typed.points.at.is_empty() {
        true => strongest_points(&source, &basis, strongest, &settings)?,
        false => points(None, &source, &basis, targets, &settings)?,
    };
    interrupt::check()?;
    let report = Report {
        image: source.name.clone(),
        window: basis.name(),
        points,
        statistics: statistics(typed, &source)?,
        against: None,
    };
    let drawn = match report.points.is_empty() {
        true => Vec::new(),
        false => pictures::write(
            claims,
            plots,
            &report,
            &source,
            session.memory.picture_bytes,
        )?,
    };
    measuring.finish();
    Ok((serde_json::to_value(&report)?, drawn))
}

/// At most the requested number of strongest points.
fn strongest_points(
    source: &Source,
    basis: &Basis,
    count: usize,
    settings: &Settings,
) -> anyhow::Result<Vec<Point>> {
    if source.without_phase().is_some() {
        return Ok(Vec::new());
    }
    let found = match strongest(source.pixels(), &source.grid, count, settings) {
        Ok(found) => found.points,
        // The rest of the report is useful even if no points can be measured.
        Err(error @ (ResponseError::TooCoarse { .. } | ResponseError::Unsuited(_))) => {
            messages::warning(format!("no points are measured: {error}"));
            Vec::new()
        }
        Err(error) => return Err(source.explain(error)),
    };
    let points = found.into_iter().map(|response| Point {
        theory: theory::of_cuts(basis, &response, &source.grid, basis.looks()),
        theory_with_gain: Vec::new(),
        formed: None,
        response,
    });
    Ok(points.collect())
}

fn statistics(typed: &Quality, source: &Source) -> anyhow::Result<Statistics> {
    let region = match typed.measuring.extent {
        None => Region {
            rows: 0..source.grid.rows.count,
            columns: 0..source.grid.columns.count,
        },
        Some(Extent {
            x_m: (low, high),
            y_m,
        }) => {
            let x_m = (source.across(low), source.across(high));
            Region::within(&Extent { x_m, y_m }, &source.grid).context("--extent")?
        }
    };
    let statistics = Statistics::by_parts(source.pixels(), &region);
    statistics.map_err(|error| anyhow::anyhow!(error))
}

/// Measurement settings and targets.
fn targets<'a>(
    session: &Session,
    typed: &Quality,
    source: &Source,
    basis: &'a Basis,
) -> anyhow::Result<(Settings<'a>, Vec<Target>)> {
    // If chips are formed from the recording, the image is only needed for positions.
    let settings = Settings {
        line_of_sight_rad: typed.measuring.line_of_sight.map(f64::to_radians),
        carrier: source.carrier,
        looks: basis.looks().filter(|_| typed.from.is_empty()),
        memory_bytes: session.memory_bytes,
        ..Settings::default()
    };
    let near = typed.points.at.iter().map(|at| {
        let [row_value, column_value] = source.coordinates(at)?;
        anyhow::Ok(Target::Near {
            column_value,
            row_value,
        })
    });
    let mut targets: Vec<Target> = near.collect::<Result<_, _>>()?;
    match source.without_phase() {
        Some(why) => messages::warning(format!("no point is measured: {why}")),
        None if targets.is_empty() => targets.push(Target::Brightest),
        None => {}
    }
    Ok((settings, targets))
}

fn points(
    from: Option<&From>,
    source: &Source,
    basis: &Basis,
    targets: Vec<Target>,
    settings: &Settings,
) -> anyhow::Result<Vec<Point>> {
    let mut measured = Vec::with_capacity(targets.len());
    for target in targets {
        if let Some(from) = from {
            measured.push(from.point(target, settings)?);
            continue;
        }
        match measure_in(source.pixels(), &source.grid, target, settings) {
            Ok(response) => measured.push(Point {
                theory: theory::of_cuts(basis, &response, &source.grid, basis.looks()),
                theory_with_gain: Vec::new(),
                formed: None,
                response,
            }),
            // The default point may lie in a missing part; the rest of the report is still useful.
            Err(error @ ResponseError::NotFinite { .. })
                if source.is_partial() && matches!(target, Target::Brightest) =>
            {
                messages::warning(format!(
                    "no point is measured: {error}, because {} has missing pixels there",
                    source.name
                ));
            }
            Err(error) => return Err(source.explain(error)),
        }
    }
    Ok(measured)
}

fn against(
    session: &Session,
    typed: &Quality,
    source: &Source,
    other: &Source,
) -> anyhow::Result<Against> {
    let Both {
        image,
        reference,
        complex,
        notes,
    } = source.both(session, other)?;
    let mut comparison = Comparison::between(&image, &reference)?;
    if !complex {
        comparison.scale_deg = None;
        comparison.peak_phase_error_deg = None;
    }
    let difference = percent_difference(&image, &reference, typed.measuring.floor)?;
    let coherence = coherence(&image, &reference, typed.measuring.coherence)?;
    let offset_pixels = match offset(&image, &reference) {
        Ok(offset) => Some(offset),
        Err(PairError::Unsuited(_)) => None,
        Err(error) => return Err(error.into()),
    };
    Ok(Against {
        image: other.name.clone(),
        values: if complex { "complex" } else { "amplitudes" },
        pixels: [image.rows, image.columns],
        notes,
        comparison,
        percent_difference: difference.summary,
        mean_coherence: coherence.mean(),
        offset_pixels,
        difference,
        coherence,
    })
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "none".to_owned(), |v| format!("{v:.digits$}"))
}

fn print(report: &Report, source: &Source) -> anyhow::Result<()> {
    for point in &report.points {
        print_point(point, source)?;
        text::say("")?;
    }
    let s = &report.statistics;
    text::say(format!(
        "{} pixels, {} not finite\n\
         level               mean {} dB, median {} dB, peak {} dB\n\
         entropy             {} nats\n\
         contrast            {} of power, {} of amplitude\n\
         sharpness           {}",
        s.num_pixels,
        s.num_not_finite,
        number(s.mean_level_db, 2),
        number(s.median_level_db, 2),
        number(s.peak_level_db, 2),
        number(s.entropy, 4),
        number(s.power_contrast, 4),
        number(s.amplitude_contrast, 4),
        s.sharpness
            .map_or_else(|| "none".to_owned(), |v| format!("{v:.4e}")),
    ))?;
    if let Some(a) = &report.against {
        let p = &a.percent_difference;
        text::say(format!("\nagainst {}", a.image))?;
        let figures = a.comparison.to_string();
        for line in figures.lines() {
            if a.values == "complex" || !line.starts_with("peak phase error") {
                text::say(line)?;
            }
        }
        text::say(format!(
            "percent difference   median {}, mean {}, 95 of 100 below {}, largest {} ({} pixels, {} \
             too dark)\n\
             mean coherence       {}",
            number(p.median, 3),
            number(p.mean, 3),
            number(p.percentile_95, 3),
            number(p.largest, 3),
            p.num_pixels,
            p.num_excluded,
            number(a.mean_coherence, 6),
        ))?;
        if let Some(o) = &a.offset_pixels {
            text::say(format!(
                "shift                {:.3} columns, {:.3} rows (correlation of magnitudes {:.6})",
                o.columns, o.rows, o.correlation
            ))?;
        }
        for note in &a.notes {
            text::say(format!("note                 {note}"))?;
        }
    }
    Ok(())
}

fn print_point(point: &Point, source: &Source) -> anyhow::Result<()> {
    let r = &point.response;
    text::say(format!(
        "point at {}: {:.2} dB, phase {}{}",
        source.place(r),
        r.level_db,
        text::degrees(r.phase_rad.to_degrees()),
        match r.turn_is_known {
            true => "",
            false => " (if the phase changes by less than pi per pixel)",
        }
    ))?;
    if let Some(about) = &point.formed {
        text::say(about.to_string())?;
    }
    let mut rows = Vec::new();
    for (i, cut) in r.cuts.iter().enumerate() {
        let (unit, factor) = source.unit(cut.along);
        let lengths = |v: Option<f64>| number(v.map(|v| v * factor), 4);
        rows.push(vec![
            format!("{} ({unit})", source.along(cut.along)),
            lengths(cut.width_3db),
            number(cut.null_rule.pslr_db, 2),
            number(cut.null_rule.islr_db, 2),
            number(cut.fixed_rule.pslr_db, 2),
            number(cut.fixed_rule.islr_db, 2),
        ]);
        for (name, theory) in [
            ("  theory", &point.theory),
            ("  theory, with gain", &point.theory_with_gain),
        ] {
            let Some(Some(t)) = theory.get(i) else {
                continue;
            };
            rows.push(vec![
                name.to_owned(),
                lengths(t.width()),
                number(t.expected.null_rule.pslr_db, 2),
                number(t.expected.null_rule.islr_db, 2),
                number(t.expected.fixed_rule.pslr_db, 2),
                number(t.expected.fixed_rule.islr_db, 2),
            ]);
        }
    }
    let header = [
        "along",
        "3 dB width",
        "PSLR dB (nulls)",
        "ISLR dB (nulls)",
        "PSLR dB (1.5 widths)",
        "ISLR dB (1.5 widths)",
    ];
    text::say(text::table(&header, &rows))?;
    // Theory without the recording does not include the beam, which attenuates some pulses.
    let wider = |(cut, theory): (&Cut, &Option<Theory>)| {
        let width = theory.as_ref()?.width()?;
        Some(cut.width_3db? > 1.05 * width)
    };
    let any_wider = r
        .cuts
        .iter()
        .zip(&point.theory)
        .filter_map(wider)
        .any(|wider| wider);
    if any_wider && point.theory_with_gain.is_empty() {
        text::say(
            "wider than theory for pulses of equal strength: --from RECORDING shows whether the antenna beam is the reason",
        )?;
    }
    text::say(format!(
        "two-dimensional ISLR   {} dB",
        number(r.islr_2d_db, 2)
    ))?;
    Ok(())
}
