//! Results of `subap displacement` as GeoTIFF and Zarr.

use serde_json::json;
use subaperture::image::ImageSource;
use subaperture::interferometry::displacement::{DisplacementSeries, Point};
use subaperture::io::stack::{Measure, Stack};
use subaperture::io::together::FileSet;
use subaperture::io::written::WrittenFile;
use subaperture::maps::cog;

use super::rate::Rate;
use super::read::Read;
use crate::args::Displacement;
use crate::commands::export::stack_attributes;
use crate::commands::rasters::{self, Map};
use crate::config::Session;

/// Name of the Zarr group.
pub(super) const STACK: &str = "displacement.zarr";

/// Names of the maps.
pub(super) const MAPS: [&str; 2] = ["displacement.tif", "velocity.tif"];

/// Add the maps of the last displacement and of velocity: a point has its value on its own and the 8 neighbouring pixels, so that it shows; all others have none.
pub(super) fn add_maps(
    session: &Session,
    typed: &Displacement,
    read: &Read,
    series: &DisplacementSeries,
    rate: &Rate,
    files: &mut FileSet,
) -> anyhow::Result<()> {
    let last = read.times_s.len() - 1;
    let displacement = widened(read, series, |point| 1e3 * point.displacement_m[last]);
    let velocity = widened(read, series, |point| rate.of(point.velocity_m_s));
    let titles = [
        "displacement in the last pass, mm, positive away from the radar".to_owned(),
        format!("velocity, {}, positive away from the radar", rate.text),
    ];
    let [rows, columns] = [read.grid.rows.count, read.grid.columns.count];
    let images = [displacement, velocity].map(|values| rasters::real(rows, columns, &values));
    let measures = [("displacement", "mm"), ("velocity", rate.text)];
    let maps = MAPS.iter().zip(&titles).zip(images.iter().zip(measures));
    let maps = maps.map(|((name, title), (image, (measure, unit)))| Map {
        name,
        title,
        image,
        layout: cog::Layout::Real {
            name: measure,
            unit,
        },
    });
    let maps: Vec<Map> = maps.collect();
    rasters::add_maps(session, &typed.out, (&read.grid, &read.frame), &maps, files)
}

/// Values on the pixels of the points and on their neighbours; those of a point itself come last.
fn widened(read: &Read, series: &DisplacementSeries, value: impl Fn(&Point) -> f64) -> Vec<f32> {
    let [rows, columns] = [read.grid.rows.count, read.grid.columns.count];
    let mut values = vec![f32::NAN; rows * columns];
    let certain = || {
        series
            .points
            .iter()
            .filter(|point| point.doubtful_from.is_none())
    };
    for reach in [1, 0] {
        for point in certain() {
            let around =
                |at: usize, count: usize| at.saturating_sub(reach)..=(at + reach).min(count - 1);
            for row in around(point.row, rows) {
                for column in around(point.column, columns) {
                    values[row * columns + column] = value(point) as f32;
                }
            }
        }
    }
    values
}

/// Write the Zarr group of all passes with displacement and quality on the pixels of the points.
pub(super) fn write_stack(
    session: &Session,
    typed: &Displacement,
    read: &Read,
    series: &DisplacementSeries,
    rate: &Rate,
) -> anyhow::Result<WrittenFile> {
    let passes = read.times_s.len();
    let displacement = on_grid(
        read,
        series,
        &|point, pass| 1e3 * point.displacement_m[pass],
        passes,
    );
    let deviation = on_grid(
        read,
        series,
        &|point, pass| 1e3 * point.deviation_m[pass],
        passes,
    );
    let velocity = on_grid(read, series, &|point, _| rate.of(point.velocity_m_s), 1);
    let coherence = on_grid(read, series, &|point, _| point.coherence, 1);
    let doubtful = on_grid(
        read,
        series,
        &|point, _| {
            point
                .doubtful_from
                .map_or(f64::INFINITY, |pass| pass as f64)
        },
        1,
    );
    let measure = |name, long_name, units, values| Measure {
        name,
        long_name,
        units,
        values,
    };
    let units = rate.text.replace('/', " ") + "-1";
    let measures = [
        measure(
            "displacement",
            "displacement along the line of sight relative to the first pass, positive away from the radar",
            "mm",
            &displacement,
        ),
        measure(
            "deviation",
            "standard deviation of the displacement",
            "mm",
            &deviation,
        ),
        measure(
            "velocity",
            "slope of the displacement over time",
            &units,
            &velocity,
        ),
        measure("temporal_coherence", "temporal coherence", "1", &coherence),
        measure(
            "doubtful_from",
            "pass from which on half-wavelength slips are possible, infinite if in no pass",
            "1",
            &doubtful,
        ),
    ];
    let opened: Vec<_> = read.opened.iter().collect();
    let mut attributes = stack_attributes(&opened, &read.grid, &read.frame);
    attributes["displacement"] = json!({
        "times_s": read.times_s,
        "wavelength_m": read.wavelength_m,
        "screens": series.screens,
    });
    let images = read.images.iter().map(|image| image as &dyn ImageSource);
    let images: Vec<&dyn ImageSource> = images.collect();
    let stack = Stack {
        images: &images,
        grid: &read.grid,
        start_ns: &read.start_ns,
        measures: &measures,
        attributes: &attributes,
    };
    rasters::write_stack(session, &stack, &typed.out.join(STACK))
}

/// Values of the points in as many passes, pass after pass; NaN on all other pixels.
fn on_grid(
    read: &Read,
    series: &DisplacementSeries,
    value: &dyn Fn(&Point, usize) -> f64,
    passes: usize,
) -> Vec<f32> {
    let [rows, columns] = [read.grid.rows.count, read.grid.columns.count];
    let mut values = vec![f32::NAN; rows * columns * passes];
    for point in &series.points {
        for pass in 0..passes {
            let at = (pass * rows + point.row) * columns + point.column;
            values[at] = value(point, pass) as f32;
        }
    }
    values
}
