//! `subap quality`: measures an image, and how it differs from another.

mod pictures;
mod source;

use anyhow::Context;
use serde::Serialize;
use subaperture::geometry::Extent;
use subaperture::image::Comparison;
use subaperture::quality::coherence::coherence;
use subaperture::quality::difference::{PercentDifference, PercentSummary, percent_difference};
use subaperture::quality::registration::{Offset, offset};
use subaperture::quality::response::{Cut, Response, Settings, Target, measure};
use subaperture::quality::statistics::{Region, Statistics};
use subaperture::quality::theory::{Expected, expected};
use subaperture::quality::{PairError, PixelMap};
use subaperture::signal::window::Window;

use crate::args::Quality;
use crate::config::Session;
use crate::failure::Usage;
use crate::interrupt;
use crate::text;
use source::Source;

/// Samples of the band in theory: many, for a window's response hardly depends on them.
const THEORY_SAMPLES: usize = 512;

/// All that was measured.
#[derive(Serialize)]
struct Report {
    image: String,
    window: Option<String>,
    points: Vec<Point>,
    statistics: Statistics,
    against: Option<Against>,
}

/// A point and what theory says of each of its cuts.
#[derive(Serialize)]
struct Point {
    response: Response,
    /// Lengths in cells; multiplied by a cell's they are metres.
    theory: Vec<Option<Expected>>,
}

/// How the image differs from another.
#[derive(Serialize)]
struct Against {
    image: String,
    comparison: Comparison,
    percent_difference: PercentSummary,
    mean_coherence: Option<f64>,
    /// `None` where an image has no contrast.
    offset_pixels: Option<Offset>,
    #[serde(skip)]
    difference: PercentDifference,
    #[serde(skip)]
    coherence: PixelMap,
}

/// Measures and prints.
pub(crate) fn run(session: &Session, typed: &Quality) -> anyhow::Result<()> {
    source::check_memory(session, &[Some(&typed.image), typed.against.as_ref()])?;
    let source = Source::open(&typed.image)?;
    if typed.line_of_sight.is_some() && source.grid.polar {
        let what = "--line-of-sight says nothing to a polar grid: leave it out";
        return Err(Usage(what.to_owned()).into());
    }
    let window = typed.window.or(source.window);
    let statistics = statistics(typed, &source)?;
    let points = points(typed, &source, window)?;
    interrupt::check()?;
    let against = match &typed.against {
        None => None,
        Some(path) => Some(against(typed, &source, &Source::open(path)?)?),
    };
    interrupt::check()?;
    let report = Report {
        image: source.name.clone(),
        window: window.map(|window| window.to_string()),
        points,
        statistics,
        against,
    };
    if typed.json {
        text::say(serde_json::to_string_pretty(&report)?)?;
    } else {
        print(&report, &source)?;
    }
    match &typed.plots {
        Some(folder) => {
            let mut claims = session.claims(
                &typed.writing,
                &[Some(&typed.image), typed.against.as_ref()]
                    .into_iter()
                    .flatten()
                    .collect::<Vec<_>>(),
            );
            pictures::write(&mut claims, folder, &report, &source, window)
        }
        None => Ok(()),
    }
}

fn statistics(typed: &Quality, source: &Source) -> anyhow::Result<Statistics> {
    let region = match typed.extent {
        None => Region::whole(&source.image),
        Some(Extent {
            x_m: (low, high),
            y_m,
        }) => {
            let x_m = (source.across(low), source.across(high));
            Region::within(&Extent { x_m, y_m }, &source.grid).context("--extent")?
        }
    };
    Ok(Statistics::of(&source.image, &region))
}

fn points(typed: &Quality, source: &Source, window: Option<Window>) -> anyhow::Result<Vec<Point>> {
    let settings = Settings {
        line_of_sight_rad: typed.line_of_sight.map(f64::to_radians),
        carrier: source.carrier,
        ..Settings::default()
    };
    let near = typed.at.iter().map(|&(x, y)| Target::Near {
        column_value: source.across(x),
        row_value: y,
    });
    let mut targets: Vec<Target> = near.collect();
    if targets.is_empty() {
        targets.push(Target::Brightest);
    }
    let measured = targets.into_iter().map(|target| {
        let response = measure(&source.image, &source.grid, target, &settings)?;
        let weights = window.map(|window| window.weights(THEORY_SAMPLES));
        let theory = response.cuts.iter().map(|cut| {
            // The span in widths, taken to cells by the width of the window itself.
            let weights = weights.as_ref()?;
            let widths = (cut.span[1] - cut.span[0]) / 2.0 / cut.width_3db?;
            let cells = expected(weights, 8.0, settings.main_lobe_widths)?.width_3db;
            expected(weights, widths * cells, settings.main_lobe_widths)
        });
        anyhow::Ok(Point {
            theory: theory.collect(),
            response,
        })
    });
    measured.collect()
}

fn against(typed: &Quality, source: &Source, other: &Source) -> anyhow::Result<Against> {
    let comparison = Comparison::between(&source.image, &other.image)?;
    let difference = percent_difference(&source.image, &other.image, typed.floor)?;
    let coherence = coherence(&source.image, &other.image, typed.coherence)?;
    let offset_pixels = match offset(&source.image, &other.image) {
        Ok(offset) => Some(offset),
        Err(PairError::Unsuited(_)) => None,
        Err(error) => return Err(error.into()),
    };
    Ok(Against {
        image: other.name.clone(),
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
        text::say(format!("\nagainst {}\n{}", a.image, a.comparison))?;
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
    }
    Ok(())
}

fn print_point(point: &Point, source: &Source) -> anyhow::Result<()> {
    let r = &point.response;
    text::say(format!(
        "point at {}: {:.2} dB, phase {}{}",
        source.place(r.column_value, r.row_value),
        r.level_db,
        text::degrees(r.phase_rad.to_degrees()),
        match r.turn_is_known {
            true => "",
            false => " if it turns by less than half a turn a pixel",
        }
    ))?;
    let mut rows = Vec::new();
    for (cut, theory) in r.cuts.iter().zip(&point.theory) {
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
        if let Some(t) = theory {
            rows.push(vec![
                "  theory".to_owned(),
                lengths(theory_width(source, cut, t)),
                number(t.null_rule.pslr_db, 2),
                number(t.null_rule.islr_db, 2),
                number(t.fixed_rule.pslr_db, 2),
                number(t.fixed_rule.islr_db, 2),
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
    text::say(format!(
        "ISLR of both dimensions {} dB",
        number(r.islr_2d_db, 2)
    ))?;
    Ok(())
}

/// The width in theory, where the recording's resolution along the cut is known.
fn theory_width(source: &Source, cut: &Cut, theory: &Expected) -> Option<f64> {
    source.cell(cut.along).map(|cell| cell * theory.width_3db)
}
