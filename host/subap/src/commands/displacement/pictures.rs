//! Pictures of `subap displacement`: points over the image, and time series.

use subaperture::image::Image;
use subaperture::interferometry::displacement::{DisplacementSeries, Point};
use subaperture::plot::{
    Chart, Colours, Curve, Dot, Dots, Panel, PlotError, Source, Stroke, lines, quicklook_within,
};

use super::rate::Rate;
use super::read::Read;
use crate::config::Session;

/// Number of curves of the time series.
const CURVES: usize = 6;

/// Half-width of the bars of a curve, standard deviations: 95 %.
const BAR: f64 = 1.96;

/// Draw displacement in the last pass, velocity, and time series of the largest movers.
pub(super) fn draw(
    session: &Session,
    read: &Read,
    series: &DisplacementSeries,
    rate: &Rate,
) -> anyhow::Result<[Vec<u8>; 3]> {
    let last = read.times_s.len() - 1;
    let image = &read.images[last];
    let span = format!("{:.4} {}s", rate.time(read.times_s[last]), rate.unit());
    let displacement = over(
        session,
        read,
        image,
        series,
        (&format!("displacement over {span}"), "mm"),
        |point| 1e3 * point.displacement_m[last],
    )?;
    let velocity = over(
        session,
        read,
        image,
        series,
        ("velocity", rate.text),
        |point| rate.of(point.velocity_m_s),
    )?;
    Ok([displacement, velocity, curves(read, series, rate)?])
}

/// Values of the points over an image, doubtful ones as rings.
fn over(
    session: &Session,
    read: &Read,
    image: &Image,
    series: &DisplacementSeries,
    (title, unit): (&str, &str),
    value: impl Fn(&Point) -> f64,
) -> Result<Vec<u8>, PlotError> {
    let grid = &read.grid;
    let dot = |point: &Point| Dot {
        at: [grid.rows.at(point.row), grid.columns.at(point.column)],
        value: match point.doubtful_from {
            Some(_) => f64::NAN,
            None => value(point),
        },
    };
    let dots: Vec<Dot> = series.points.iter().map(dot).collect();
    // From zero; comparisons with NaN leave the range unchanged.
    let (low, high) = dots
        .iter()
        .fold((0.0, 0.0), |(low, high): (f64, f64), dot| {
            (low.min(dot.value), high.max(dot.value))
        });
    let range = match low < high {
        true => (low, high),
        false => (-1.0, 1.0),
    };
    let doubtful = match series.counts.doubtful {
        0 => String::new(),
        count => format!("; {count} doubtful points as rings"),
    };
    let panel = Panel {
        dots: Some(Dots {
            dots,
            range,
            unit: unit.to_owned(),
            colours: Colours::Viridis,
        }),
        reference: "",
        ..Panel::new(
            Source::Whole(image),
            grid,
            format!("{title} ({unit}), positive away from the radar{doubtful}"),
        )
    };
    quicklook_within(&panel, session.memory.picture_bytes)
}

/// Curves with bars of the points with the largest displacement in any pass; doubtful points only if there are no others.
fn curves(read: &Read, series: &DisplacementSeries, rate: &Rate) -> Result<Vec<u8>, PlotError> {
    let size = |point: &Point| {
        point
            .displacement_m
            .iter()
            .map(|d| d.abs())
            .fold(0.0, f64::max)
    };
    let mut movers: Vec<(usize, &Point)> = series.points.iter().enumerate().collect();
    movers.sort_by(|(_, a), (_, b)| {
        let doubtful = |point: &Point| point.doubtful_from.is_some();
        (doubtful(a).cmp(&doubtful(b))).then(size(b).total_cmp(&size(a)))
    });
    let curve = |&(n, point): &(usize, &Point)| {
        let [x, y, _] = point.position_m;
        let values = read.times_s.iter().zip(&point.displacement_m);
        let values = values.zip(&point.deviation_m);
        let bars = values.flat_map(|((&t, d), s)| {
            let t = rate.time(t);
            // The bar is a part of the curve: to its lower and upper end and back.
            [0.0, -BAR, BAR, 0.0].map(|k| (t, 1e3 * (d + k * s)))
        });
        Curve {
            name: format!("point {n} at {x:.1}, {y:.1} m"),
            points: bars.collect(),
            stroke: Stroke::Solid,
        }
    };
    let end = rate.time(read.times_s.last().copied().unwrap_or_default());
    lines(&Chart {
        title: "points with the largest displacement, 95 % bars".to_owned(),
        across_label: format!("time after the first pass ({}s)", rate.unit()),
        up_label: "displacement away from the radar (mm)".to_owned(),
        // Bars at both ends are drawn whole.
        across: Some((-0.03 * end, 1.03 * end)),
        curves: movers.iter().take(CURVES).map(curve).collect(),
        ..Chart::default()
    })
}
