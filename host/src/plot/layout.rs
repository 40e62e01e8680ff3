//! Where everything on a page lies.

use super::Panel;
use super::canvas::{Anchor, Canvas, INK, Typeface};
use super::raster::resample;
use super::scale::Levels;
use super::ticks::ticks;
use crate::geometry::Axis;

const LABEL_PX: f32 = 15.0;
const TITLE_PX: f32 = 18.0;
const TICK: usize = 6;
/// Room left of the plot for tick labels and the axis label, and above it for the title.
const LEFT: usize = 96;
const TOP: usize = 48;
/// Room below for tick labels and the axis label.
const BOTTOM: usize = 60;
/// Gap, colour bar and its labels.
const BAR_GAP: usize = 20;
const BAR: usize = 20;
const RIGHT: usize = BAR_GAP + BAR + 64;
const LEAST_SIDE: usize = 160;
const BAD: [u8; 3] = [214, 40, 40];

/// The page with all panels drawn.
pub(super) fn page(panels: &[Panel], columns: usize) -> Canvas {
    let limit = match columns {
        1 => 1600,
        2 => 800,
        _ => 560,
    };
    let sizes: Vec<(usize, usize)> = panels.iter().map(|p| plot_size(p, limit)).collect();
    let rows = panels.len().div_ceil(columns);
    let mut widths = vec![0; columns];
    let mut heights = vec![0; rows];
    for (i, &(width, height)) in sizes.iter().enumerate() {
        let (row, column) = (i / columns, i % columns);
        widths[column] = widths[column].max(LEFT + width + RIGHT);
        heights[row] = heights[row].max(TOP + height + BOTTOM);
    }
    let mut canvas = Canvas::new(widths.iter().sum(), heights.iter().sum());
    for (i, (panel, &size)) in panels.iter().zip(&sizes).enumerate() {
        let (row, column) = (i / columns, i % columns);
        let x = LEFT + widths[..column].iter().sum::<usize>();
        let y = TOP + heights[..row].iter().sum::<usize>();
        draw(&mut canvas, panel, (x, y), size);
    }
    canvas
}

/// Width and height of the plot, its longer side at most `limit` pixels. Small images are enlarged by
/// a whole number, to some 60 % of the limit or more.
fn plot_size(panel: &Panel, limit: usize) -> (usize, usize) {
    let grid = panel.grid;
    let (across, up) = if grid.polar {
        (grid.columns.count as f64, grid.rows.count as f64)
    } else {
        let length = |axis: &Axis| axis.count as f64 * axis.step.abs();
        (length(&grid.columns), length(&grid.rows))
    };
    let pixels = if across >= up {
        grid.columns.count
    } else {
        grid.rows.count
    };
    let longer = if pixels > limit {
        limit
    } else {
        pixels
            * (limit * 3 / 5)
                .div_ceil(pixels)
                .min((limit / pixels).max(1))
    };
    let side = |part: f64| {
        let side = (longer as f64 * part / across.max(up)).round();
        // A strip keeps room for its labels rather than its proportions.
        (side as usize).clamp(LEAST_SIDE, limit)
    };
    (side(across), side(up))
}

fn draw(
    canvas: &mut Canvas,
    panel: &Panel,
    (x, y): (usize, usize),
    (width, height): (usize, usize),
) {
    let powers = resample(panel.image, height, width);
    let levels = panel.scale.levels(&powers);
    for (row, cells) in powers.chunks_exact(width).enumerate() {
        for (column, &power) in cells.iter().enumerate() {
            let level =
                (10.0 * power.log10() - levels.bottom_db) / (levels.top_db - levels.bottom_db);
            // Zero power is minus infinity, and dark; only NaN is bad.
            let colour = match level.is_nan() {
                true => BAD,
                false => panel.colours.at(level),
            };
            canvas.fill(x + column, y + height - 1 - row, 1, 1, colour);
        }
    }
    canvas.frame(x, y, width, height);

    let title = Typeface::sans(TITLE_PX, true);
    let room = (width + BAR_GAP + BAR) as f32;
    canvas.text(
        x as f32,
        y as f32 - 16.0,
        Anchor::Left,
        &title,
        &title.fitted(&panel.title, room),
    );
    axes(canvas, panel, (x, y), (width, height));
    colour_bar(canvas, panel, levels, (x + width + BAR_GAP, y), height);
}

/// Values at an axis' two ends: the outer edges of its first and last pixel.
fn edges(axis: &Axis, unit: f64) -> (f64, f64) {
    let half = axis.step / 2.0;
    let last = axis.at(axis.count - 1);
    ((axis.start - half) * unit, (last + half) * unit)
}

fn axes(
    canvas: &mut Canvas,
    panel: &Panel,
    (x, y): (usize, usize),
    (width, height): (usize, usize),
) {
    let font = Typeface::sans(LABEL_PX, false);
    let grid = panel.grid;
    let (across_label, up_label, across_unit) = match grid.polar {
        true => ("angle (deg)", "range (m)", 1f64.to_degrees()),
        false => ("x (m)", "y (m)", 1.0),
    };
    let bottom = y + height;

    let (low, high) = edges(&grid.columns, across_unit);
    for (value, label) in ticks(low, high, (width / 60).max(2)) {
        let at = x as f64 + (value - low) / (high - low) * width as f64;
        let pixel = (at as usize).clamp(x, x + width - 1);
        canvas.fill(pixel, bottom + 1, 1, TICK, INK);
        canvas.text(
            at as f32,
            bottom as f32 + 23.0,
            Anchor::Middle,
            &font,
            &label,
        );
    }
    let middle = x as f32 + width as f32 / 2.0;
    canvas.text(
        middle,
        bottom as f32 + 47.0,
        Anchor::Middle,
        &font,
        across_label,
    );

    let (low, high) = edges(&grid.rows, 1.0);
    let mut widest = 0f32;
    for (value, label) in ticks(low, high, (height / 60).max(2)) {
        let at = bottom as f64 - (value - low) / (high - low) * height as f64;
        let pixel = (at as usize).clamp(y, bottom - 1);
        canvas.fill(x - 1 - TICK, pixel, TICK, 1, INK);
        let end = (x - TICK - 6) as f32;
        canvas.text(end, at as f32 + 5.0, Anchor::Right, &font, &label);
        widest = widest.max(font.width(&label));
    }
    let base = (x - TICK) as f32 - 6.0 - widest - 12.0;
    canvas.text_upwards(base, y as f32 + height as f32 / 2.0, &font, up_label);
}

fn colour_bar(
    canvas: &mut Canvas,
    panel: &Panel,
    levels: Levels,
    (x, y): (usize, usize),
    height: usize,
) {
    let font = Typeface::sans(LABEL_PX, false);
    for row in 0..height {
        let level = 1.0 - (row as f64 + 0.5) / height as f64;
        canvas.fill(x, y + row, BAR, 1, panel.colours.at(level));
    }
    canvas.frame(x, y, BAR, height);
    let (low, high) = (levels.bottom_db, levels.top_db);
    for (value, label) in ticks(low, high, (height / 70).max(2)) {
        let at = (y + height) as f64 - (value - low) / (high - low) * height as f64;
        let pixel = (at as usize).clamp(y, y + height - 1);
        canvas.fill(x + BAR + 1, pixel, TICK, 1, INK);
        canvas.text(
            (x + BAR + TICK + 6) as f32,
            at as f32 + 5.0,
            Anchor::Left,
            &font,
            &label,
        );
    }
    let middle = x as f32 + BAR as f32 / 2.0;
    canvas.text(
        middle,
        (y + height) as f32 + 23.0,
        Anchor::Middle,
        &font,
        "dB",
    );
}
