//! Pictures of `subap pair`: coherence, phase, and change over the image.

use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::Image;
use subaperture::interferometry::ChangeMap;
use subaperture::num_complex::Complex32;
use subaperture::plot::{
    ColourSource, Colours, HeatMap, Mask, Panel, ShownAxis, Source, heat, quicklook_within,
};

use super::read::Read;
use crate::config::Session;

/// Largest side of a picture, pixels.
const SIDE: usize = 1600;

/// Draw the pictures, in the order of their names.
pub(super) fn draw(
    session: &Session,
    read: &Read,
    changes: &ChangeMap,
) -> anyhow::Result<[Vec<u8>; 3]> {
    let (grid, _) = read.grid();
    let coherence = map(
        &grid,
        &changes.interferogram.magnitude().values,
        1,
        ("coherence", "", (0.0, 1.0), Colours::Viridis),
    )?;
    let longest = grid.rows.count.max(grid.columns.count);
    let step = longest.div_ceil(SIDE);
    let degrees = reduced(&changes.interferogram.coherence, step);
    let phase = map(
        &grid,
        &degrees,
        step,
        (
            "interferometric phase",
            "deg",
            (-180.0, 180.0),
            Colours::Hue,
        ),
    )?;
    let values = changes.map.values.iter();
    let mask = Image {
        rows: read.pixels.rows,
        columns: read.pixels.columns,
        pixels: values.map(|&change| Complex32::new(change, 0.0)).collect(),
    };
    let panel = Panel {
        paint: ColourSource::Mask(Mask {
            mask: Source::Whole(&mask),
            names: ["changed", "unchanged", "not tested"].map(str::to_owned),
        }),
        ..Panel::new(
            Source::Whole(&read.pixels),
            &grid,
            "changed pixels over the reference",
        )
    };
    let change = quicklook_within(&panel, session.memory.picture_bytes)?;
    Ok([coherence, phase, change])
}

/// Phases in degrees of the mean coherence of boxes of `step` pixels, so that phases near 180 degrees do not cancel.
fn reduced(coherence: &Image, step: usize) -> Vec<f32> {
    let (rows, columns) = (coherence.rows / step, coherence.columns / step);
    let mut values = Vec::with_capacity(rows * columns);
    for row in 0..rows {
        for column in 0..columns {
            let lines = (row * step..(row + 1) * step)
                .map(|r| &coherence.pixels[r * coherence.columns + column * step..][..step]);
            let sum: Complex32 = lines.flatten().filter(|z| z.is_finite()).sum();
            values.push(match sum == Complex32::ZERO {
                true => f32::NAN,
                false => sum.arg().to_degrees(),
            });
        }
    }
    values
}

/// Heat map on a grid whose axes are decimated by `step`.
fn map(
    grid: &ImageGrid,
    values: &[f32],
    step: usize,
    (title, unit, range, colours): (&str, &str, (f64, f64), Colours),
) -> anyhow::Result<Vec<u8>> {
    let shown = |axis: &Axis, shown: &ShownAxis| {
        let ascends = shown.scale > 0.0;
        let middle = axis.start + 0.5 * (step - 1) as f64 * axis.step;
        // Values must ascend: an axis that descends is shown negated.
        let sign = if ascends { "" } else { "-" };
        let value = shown.offset + shown.scale * middle;
        let axis = Axis {
            start: if ascends { value } else { -value },
            step: axis.step * step as f64 * shown.scale.abs(),
            count: axis.count / step,
        };
        (format!("{sign}{}", shown.label), axis)
    };
    let [across, up] = ShownAxis::of_grid(grid);
    let (across_label, columns) = shown(&grid.columns, &across);
    let (up_label, rows) = shown(&grid.rows, &up);
    Ok(heat(&HeatMap {
        values,
        rows,
        columns,
        title: title.to_owned(),
        across_label,
        up_label,
        unit: unit.to_owned(),
        range,
        colours,
        proportional: !grid.polar,
    })?)
}
