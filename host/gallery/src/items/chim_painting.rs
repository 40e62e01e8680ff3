//! Range painting: Chim 2018, Fig. 3.4.

use std::f64::consts::LN_2;

use glam::DVec3;

use super::chim_strip::{error_db, l_band, ridge};
use super::forming::{backprojection, form, grid_about, pulses_of, side_by_side};
use crate::{Check, Context, Finding, Item, ItemError};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{Image, power};
use subaperture_model::phase_history::PhaseHistory;

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "c-3-4",
    source: "Chim 2018, Fig. 3.4",
    title: "Backprojection paints arcs",
    work: 0.86,
    reproduce: painting,
}];

const RANGE_M: f64 = 10.0;
const APERTURE_M: f64 = 8.0;
const PIXEL_M: f64 = 0.05;
/// Position of the scatterer, metres.
const PLACE: DVec3 = DVec3::new(0.4, 0.5, 0.0);

fn painting(context: &Context) -> Result<Finding, ItemError> {
    let history = l_band(RANGE_M, APERTURE_M, 0.05, &[(PLACE.x, PLACE.y)])?;
    let last = history.collection().pulses.len() - 1;
    let grid = grid_about(DVec3::ZERO, 3.0, 3.0, PIXEL_M);
    let mut images = Vec::new();
    for (index, count) in [1, 2, 8, last + 1].into_iter().enumerate() {
        // Evenly over the aperture, ends included.
        let pulses: Vec<usize> = (0..count).map(|i| i * last / (count - 1).max(1)).collect();
        let part = pulses_of(&history, &pulses)?;
        images.push(form(context, [index, 4], &part, &grid, &backprojection())?);
    }

    let radar = history.collection().pulses[0].transmitter_m;
    let radius_m = radar.distance(PLACE);
    let off_m = arc_ranges_m(&images[0], &grid, radar)
        .map(|range_m| (range_m - radius_m).abs())
        .fold(0.0, f64::max);
    let crossing_m = peak_m(&images[1], &grid).distance(PLACE);
    let away: Vec<f64> = images.iter().map(|image| away_db(image, &grid)).collect();
    let peak_db = images[3]
        .peak()
        .map_or(f64::NAN, |p| 10.0 * power(p.value).log10());
    let small = grid_about(PLACE, 1.0, 1.0, PIXEL_M);
    let error_db = error_db(context, &history, &small, &backprojection())?;
    let shown: Vec<String> = away.iter().map(|db| format!("{db:.1}")).collect();
    Ok(Finding {
        thesis: "Each range profile is swept about its antenna position as about a circle's centre; pulse by \
                 pulse the image adds up where a target is and cancels where there is none."
            .to_owned(),
        method: format!(
            "A unit scatterer, 1.7 to 2.0 GHz, {} pulses over {APERTURE_M} m at {RANGE_M} m; images of the first pulse, the \
             first and the last, 8 and all pulses by Subaperture's backprojection, each divided by its number of pulses. \
             The weight by angle of arrival of 3.2.1 is not applied, because the simulated antenna is isotropic. Scale: \
             the thesis's figure is a sketch without numbers; the band is that of 4.5, range and track are ours.",
            last + 1
        ),
        checks: vec![
            Check::claim(
                &format!("radius of the first pulse's arc about its antenna, {radius_m:.3} m: largest difference"),
                "a circle about the antenna",
                format!("{off_m:.3} m"),
                off_m < 0.5 * PIXEL_M,
            ),
            Check::claim(
                "distance of the two-pulse peak from the scatterer",
                "constructive at the target",
                format!("{crossing_m:.3} m"),
                crossing_m <= PIXEL_M,
            ),
            Check::claim(
                "peak of all pulses relative to a unit scatterer",
                "constructive at the target",
                format!("{peak_db:.2} dB"),
                peak_db.abs() < 0.1,
            ),
            Check::claim(
                "mean power at 1 m and more from the scatterer with 1, 2, 8 and all pulses, dB",
                "destructive elsewhere",
                shown.join(", "),
                away.windows(2).all(|pair| pair[1] < pair[0]),
            ),
            Check::claim(
                "the final image's error against the exact matched filter",
                "focused",
                format!("{error_db:.1} dB"),
                error_db < super::forming::ERROR_DB,
            ),
        ],
        why: None,
        pictures: vec![side_by_side(
            "images",
            "1, 2, 8 and all pulses",
            &[
                ("1 pulse", &images[0], &grid),
                ("2 pulses", &images[1], &grid),
                ("8 pulses", &images[2], &grid),
                (&format!("{} pulses", last + 1), &images[3], &grid),
            ],
        )?],
    })
}

/// Distance of the brightest point of each column from `centre`, where it is inside the grid.
fn arc_ranges_m(image: &Image, grid: &ImageGrid, centre: DVec3) -> impl Iterator<Item = f64> {
    let middle = |axis: &Axis| axis.at(axis.count / 2);
    let rows = grid.rows;
    (0..image.columns)
        .filter_map(move |column| {
            let powers: Vec<f32> = (0..image.rows)
                .map(|row| image.pixels[row * image.columns + column].norm_sqr())
                .collect();
            let y = ridge(&powers, &rows, middle(&rows), rows.step * rows.count as f64);
            // Columns without the arc have a peak below half of a unit scatterer's.
            let strongest = powers.iter().copied().fold(0.0, f32::max);
            let inside = y > rows.start + 0.2 && y < rows.at(rows.count - 1) - 0.2;
            (inside && f64::from(strongest) > (-LN_2).exp())
                .then(|| DVec3::new(grid.columns.at(column), y, 0.0).distance(centre))
        })
        .collect::<Vec<_>>()
        .into_iter()
}

fn peak_m(image: &Image, grid: &ImageGrid) -> DVec3 {
    image
        .peak()
        .map_or(DVec3::NAN, |peak| grid.position_m(peak.row, peak.column))
}

/// Mean power of the pixels at least 1 m from the scatterer, dB.
fn away_db(image: &Image, grid: &ImageGrid) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (i, &z) in image.pixels.iter().enumerate() {
        let place = grid.position_m(i / image.columns, i % image.columns);
        if place.distance(PLACE) >= 1.0 {
            sum += power(z);
            count += 1.0;
        }
    }
    10.0 * (sum / f64::max(count, 1.0)).log10()
}
