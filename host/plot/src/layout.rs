//! Page layout: plots, axes, colour bars, keys and notes.

use super::PlotError;
use super::canvas::{Anchor, Canvas, INK, Rgb, Typeface};
use super::colours::Colours;
use super::dots::Dots;
use super::marks;
use super::orientation::Arrow;
use super::scale::Levels;
use super::shades::Shades;
use super::ticks::{ticks, ticks_apart};
use subaperture_model::image::ImageSourceError;

const LABEL_PX: f32 = 15.0;
const TITLE_PX: f32 = 18.0;
const TICK: usize = 6;
/// Distance from an axis or colour bar to its tick labels, pixels.
const TO_LABEL: usize = TICK + 6;
/// Smallest left margin (tick labels, axis label) and top margin (title), pixels.
const LEFT: usize = 96;
const TOP: usize = 48;
/// Bottom margin (tick labels, axis label), pixels.
const BOTTOM: usize = 60;
/// Smallest gap before the colour bar, width of the bar, smallest room for its labels, pixels.
const BAR_GAP: usize = 20;
const BAR: usize = 20;
const BAR_LABELS: usize = 64;
/// Gaps between adjacent labels, between other texts, and at the page border, pixels.
const LABEL_GAP: f32 = 8.0;
const TEXT_GAP: f32 = 12.0;
/// Font size of notes and arrow names, pixels.
const NOTE_PX: f32 = 12.0;
/// Half an arrow's length, and the distance between arrows, pixels. Arrows are below the tick labels, left of the
/// plot.
const ARROW: f64 = 11.0;
const ARROW_STEP: f64 = 52.0;
/// Height of the cap on the colour bar for levels above its top, pixels.
const CAP: usize = 10;
const BORDER: f32 = 3.0;
const MIN_SIDE: usize = 160;
/// Line spacing of a key, and the largest width of its names, pixels.
const KEY_STEP: usize = 26;
const MAX_KEY_PX: f32 = 200.0;

/// Longest side of a single picture drawn with `memory_bytes`, pixels.
pub(super) fn longest(memory_bytes: u64, bytes_a_cell: u64) -> usize {
    let side = ((memory_bytes / bytes_a_cell) as f64).sqrt() as usize;
    side.clamp(MIN_SHOWN, LONGEST)
}

/// Memory per pixel while drawing, bytes: power, a copy for automatic levels, colour, and a copy for
/// encoding.
pub(super) const BYTES_A_CELL: u64 = 24;

/// Largest side of a single picture, pixels.
pub(super) const LONGEST: usize = 1600;
/// Smallest side of a single picture where memory is limited, pixels.
const MIN_SHOWN: usize = 400;

/// Tick values and labels.
type Ticks = Vec<(f64, String)>;

/// Content of a panel, independent of its source.
pub(super) struct Sheet<'a> {
    pub(super) title: &'a str,
    /// Rows and columns of source pixels.
    pub(super) count: (usize, usize),
    /// Axis values at the left and right edge, and at the lower and upper edge; either may be
    /// descending.
    pub(super) across: (f64, f64),
    pub(super) up: (f64, f64),
    pub(super) across_label: &'a str,
    pub(super) up_label: &'a str,
    pub(super) bar_label: &'a str,
    /// Note below the colour bar; omitted if there is no room.
    pub(super) note: &'a str,
    pub(super) arrows: Vec<Arrow>,
    /// Aspect: width and height in a common unit.
    pub(super) proportions: (f64, f64),
    pub(super) colours: Colours,
    /// Colour of NaN.
    pub(super) absent: [u8; 3],
    /// Levels that determine the space for colour bar labels.
    pub(super) typical: Levels,
    /// Key of colours that do not represent levels.
    pub(super) key: Vec<(String, [u8; 3])>,
    /// Marks as fractions of the plot, rightwards and downwards, and labels.
    pub(super) marks: Vec<([f64; 2], &'a str)>,
    /// Dots and their places as fractions of the plot, rightwards and downwards.
    pub(super) dots: Option<(&'a Dots, Vec<[f64; 2]>)>,
    pub(super) cells: Cells<'a>,
}

/// Function that computes `height` x `width` cells, row 0 first.
pub(super) type Cells<'a> = Box<dyn Fn(usize, usize) -> Result<Drawn, ImageSourceError> + 'a>;

/// Values or colours of cells.
pub(super) enum Drawn {
    /// Levels of cells, and the levels of the lowest and highest colour.
    Levels(Vec<f64>, Levels),
    /// Powers of cells, and the levels of the lowest and highest colour, dB.
    Powers(Vec<f64>, Levels),
    /// Colours of cells, `None` for missing ones, and the levels of black and of full brightness if common to all.
    Painted(Vec<Option<[u8; 3]>>, Option<Levels>),
}

/// Geometry of a panel, pixels.
struct Plan {
    width: usize,
    height: usize,
    across: Ticks,
    up: Ticks,
    /// Left margin.
    left: usize,
    /// Gap between plot and colour bar.
    gap: usize,
    /// Room for colour bar labels.
    bar_labels: usize,
}

impl Plan {
    fn new(sheet: &Sheet, limit: usize) -> Self {
        let font = Typeface::sans(LABEL_PX, false);
        let (width, height) = plot_size(sheet.count, sheet.proportions, limit);
        let (low, high) = sheet.across;
        let (least, most) = (low.min(high), low.max(high));
        let across = ticks_apart(least, most, (width / 60).max(2), width as f64, |label| {
            f64::from(font.width(label) + LABEL_GAP)
        });
        // Overhang of the outer labels past the plot.
        let (mut before, mut after) = (0f32, 0f32);
        for (value, label) in &across {
            let at = ((value - low) / (high - low) * width as f64) as f32;
            let half = font.width(label) / 2.0;
            before = before.max(half - at);
            after = after.max(at + half - width as f32);
        }
        let (low, high) = sheet.up;
        let up = ticks(low.min(high), low.max(high), (height / 60).max(2));
        let room = TO_LABEL as f32 + widest(&font, &up) + TEXT_GAP + LABEL_PX;
        let small = Typeface::sans(NOTE_PX, false);
        let names = sheet.key.iter().map(|(name, _)| small.width(name));
        let bar = widest(&font, &bar_ticks(sheet.typical, height));
        let bar = names.map(|width| width.min(MAX_KEY_PX)).fold(bar, f32::max);
        Self {
            width,
            height,
            across,
            up,
            left: LEFT.max((room.max(before) + BORDER).ceil() as usize),
            // "dB" below the bar has the bar's width.
            gap: BAR_GAP.max((after + TEXT_GAP).ceil() as usize),
            bar_labels: BAR_LABELS.max((TO_LABEL as f32 + bar + BORDER).ceil() as usize),
        }
    }

    /// Distance from the plot's left edge to the panel's right edge.
    fn right_of_axis(&self) -> usize {
        self.width + self.gap + BAR + self.bar_labels
    }
}

fn widest(font: &Typeface, ticks: &Ticks) -> f32 {
    ticks.iter().map(|t| font.width(&t.1)).fold(0.0, f32::max)
}

fn bar_ticks(levels: Levels, height: usize) -> Ticks {
    ticks(levels.bottom, levels.top, (height / 70).max(2))
}

/// Draw a page of all sheets, the longer side of each at most `limit` pixels.
/// # Errors
/// [`PlotError::ImageSource`] if an image cannot be read.
pub(super) fn page(sheets: &[Sheet], columns: usize, limit: usize) -> Result<Canvas, PlotError> {
    let plans: Vec<Plan> = sheets.iter().map(|s| Plan::new(s, limit)).collect();
    let rows = sheets.len().div_ceil(columns);
    let mut lefts = vec![0; columns];
    let mut rights = vec![0; columns];
    let mut heights = vec![0; rows];
    for (i, plan) in plans.iter().enumerate() {
        let (row, column) = (i / columns, i % columns);
        lefts[column] = lefts[column].max(plan.left);
        rights[column] = rights[column].max(plan.right_of_axis());
        heights[row] = heights[row].max(TOP + plan.height + BOTTOM);
    }
    let widths: Vec<usize> = lefts.iter().zip(&rights).map(|(l, r)| l + r).collect();
    let mut canvas = Canvas::new(widths.iter().sum(), heights.iter().sum());
    for (i, (sheet, plan)) in sheets.iter().zip(&plans).enumerate() {
        let (row, column) = (i / columns, i % columns);
        let x = lefts[column] + widths[..column].iter().sum::<usize>();
        let y = TOP + heights[..row].iter().sum::<usize>();
        draw(&mut canvas, sheet, plan, (x, y))?;
    }
    Ok(canvas)
}

/// Width and height of the plot, the longer side at most `limit` pixels. Small images are enlarged by
/// an integer factor, to about 60 % of the limit or more.
pub(super) fn plot_size(
    count: (usize, usize),
    (across, up): (f64, f64),
    limit: usize,
) -> (usize, usize) {
    let pixels = if across >= up { count.1 } else { count.0 };
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
        // A narrow strip keeps room for its labels rather than its aspect.
        (side as usize).clamp(MIN_SIDE, limit)
    };
    (side(across), side(up))
}

/// Integer repetition of each pixel along a side; 1 with as many cells as the side is long if there is none.
fn repeats(side: usize, pixels: usize) -> usize {
    match side.is_multiple_of(pixels) {
        true => side / pixels,
        false => 1,
    }
}

/// Rows and columns of a plot of `height` x `width` without repeated ones.
pub(super) fn distinct(count: (usize, usize), (height, width): (usize, usize)) -> (usize, usize) {
    (
        height / repeats(height, count.0),
        width / repeats(width, count.1),
    )
}

fn draw(
    canvas: &mut Canvas,
    sheet: &Sheet,
    plan: &Plan,
    (x, y): (usize, usize),
) -> Result<(), PlotError> {
    let (width, height) = (plan.width, plan.height);
    // Repeated pixels are evaluated once.
    let [down, along] = [
        repeats(height, sheet.count.0),
        repeats(width, sheet.count.1),
    ];
    let drawn = (sheet.cells)(height / down, width / along).map_err(PlotError::ImageSource)?;
    let mut capped = false;
    let mut painter = Painter {
        canvas: &mut *canvas,
        // Last row of the page, first row of the cells.
        corner: (x, y + height - 1),
        repeats: [down, along],
        line: vec![[0; 3]; width],
    };
    let mut shaded = |(colour, above): ([u8; 3], bool)| {
        capped |= above;
        colour
    };
    let levels = match &drawn {
        Drawn::Levels(cells, levels) => {
            painter.paint(cells, |&cell| {
                shaded(levels.colour(cell, sheet.colours, sheet.absent))
            });
            Some(*levels)
        }
        Drawn::Powers(cells, levels) => {
            let shades = Shades::new(*levels, sheet.colours, sheet.absent, cells.len());
            painter.paint(cells, |&cell| shaded(shades.of(cell)));
            Some(*levels)
        }
        Drawn::Painted(cells, levels) => {
            painter.paint(cells, |cell| cell.unwrap_or(sheet.absent));
            *levels
        }
    };
    if let Some((dots, places)) = &sheet.dots {
        dots.draw(canvas, places, (x, y), (width, height));
    }
    marks::draw(canvas, &sheet.marks, (x, y), (width, height));
    canvas.frame(x, y, width, height);

    let title = Typeface::sans(TITLE_PX, true);
    let room = (width + plan.gap) as f32 - TEXT_GAP;
    canvas.text(
        x as f32,
        y as f32 - 16.0,
        Anchor::Left,
        &title,
        &title.fitted(sheet.title, room),
    );
    axes(canvas, sheet, plan, (x, y));
    let bar_x = x + width + plan.gap;
    let keys = (KEY_STEP * sheet.key.len()).min(height / 2);
    let bar = match &sheet.dots {
        Some((dots, _)) => Some((dots.levels(), dots.colours)),
        None => levels.map(|levels| (levels, sheet.colours)),
    };
    if let Some(levels) = bar {
        // Unit below the bar.
        let above = if keys > 0 { keys + KEY_STEP } else { 0 };
        let bar = height.saturating_sub(above).max(height / 3);
        colour_bar(canvas, sheet, levels, (bar_x, y), bar);
    }
    key(canvas, sheet, (bar_x, y + height - keys), keys);
    if capped && sheet.dots.is_none() {
        // Triangle on top of the bar.
        for row in 0..CAP {
            let inset = BAR * (CAP - row) / (2 * CAP + 2);
            let colour = sheet.colours.above();
            canvas.fill(bar_x + inset, y - 2 - CAP + row, BAR - 2 * inset, 1, colour);
        }
    }
    note(canvas, sheet, plan, (x, y));
    for (i, arrow) in sheet.arrows.iter().enumerate() {
        let at = (
            x as f64 - LEFT as f64 + f64::from(BORDER) + ARROW + 2.0 + i as f64 * ARROW_STEP,
            (y + height) as f64 + 44.0,
        );
        draw_arrow(canvas, arrow, at);
    }
    Ok(())
}

/// Painter of repeated cells, from the lowest row of a plot upwards.
struct Painter<'c> {
    canvas: &'c mut Canvas,
    /// Page position of the left end of the lowest row.
    corner: (usize, usize),
    repeats: [usize; 2],
    /// Colours of one row.
    line: Vec<Rgb>,
}

impl Painter<'_> {
    fn paint<T>(&mut self, cells: &[T], mut colour: impl FnMut(&T) -> Rgb) {
        let [down, along] = self.repeats;
        let (x, lowest) = self.corner;
        let width = self.line.len() / along;
        for (row, cells) in cells.chunks_exact(width).enumerate() {
            for (cell, pixels) in cells.iter().zip(self.line.chunks_exact_mut(along)) {
                pixels.fill(colour(cell));
            }
            let upper = lowest + 1 - (row + 1) * down;
            self.canvas.put(x, upper, down, &self.line);
        }
    }
}

/// Draw the key; entries without room are omitted.
fn key(canvas: &mut Canvas, sheet: &Sheet, (x, y): (usize, usize), height: usize) {
    let small = Typeface::sans(NOTE_PX, false);
    let side = BAR - 4;
    for (i, (name, colour)) in sheet.key.iter().enumerate().take(height / KEY_STEP) {
        let top = y + i * KEY_STEP + (KEY_STEP - side) / 2;
        canvas.fill(x, top, BAR, side, *colour);
        canvas.frame(x, top, BAR, side);
        let name = small.fitted(name, MAX_KEY_PX);
        let at = ((x + BAR + TO_LABEL) as f32, (top + side) as f32 - 4.0);
        canvas.text(at.0, at.1, Anchor::Left, &small, &name);
    }
}

/// Draw the note, right of the horizontal axis label if it fits there.
fn note(canvas: &mut Canvas, sheet: &Sheet, plan: &Plan, (x, y): (usize, usize)) {
    let small = Typeface::sans(NOTE_PX, false);
    let label = Typeface::sans(LABEL_PX, false).width(sheet.across_label);
    let taken = x as f32 + (plan.width as f32 + label) / 2.0 + TEXT_GAP;
    let end = (x + plan.right_of_axis()) as f32 - BORDER;
    if end - small.width(sheet.note) >= taken {
        let base = (y + plan.height) as f32 + 47.0;
        canvas.text(end, base, Anchor::Right, &small, sheet.note);
    }
}

/// Draw an arrow centred on a point, its name to the right.
fn draw_arrow(canvas: &mut Canvas, arrow: &Arrow, (x, y): (f64, f64)) {
    let (dx, dy) = (ARROW * arrow.right, -ARROW * arrow.up);
    let head = (x + dx, y + dy);
    canvas.line((x - dx, y - dy), head);
    let length = arrow.right.hypot(arrow.up);
    let (ux, uy) = (arrow.right / length, -arrow.up / length);
    for side in [-1.0, 1.0] {
        let barb = (
            head.0 - 6.0 * ux - side * 3.5 * uy,
            head.1 - 6.0 * uy + side * 3.5 * ux,
        );
        canvas.line(barb, head);
    }
    let small = Typeface::sans(NOTE_PX, false);
    let base = (x + ARROW + 3.0) as f32;
    canvas.text(base, y as f32 + 4.0, Anchor::Left, &small, arrow.name);
}

fn axes(canvas: &mut Canvas, sheet: &Sheet, plan: &Plan, (x, y): (usize, usize)) {
    let (width, height) = (plan.width, plan.height);
    let font = Typeface::sans(LABEL_PX, false);
    let bottom = y + height;

    let (low, high) = sheet.across;
    for (value, label) in &plan.across {
        let at = x as f64 + (value - low) / (high - low) * width as f64;
        let pixel = (at as usize).clamp(x, x + width - 1);
        canvas.fill(pixel, bottom + 1, 1, TICK, INK);
        canvas.text(
            at as f32,
            bottom as f32 + 23.0,
            Anchor::Middle,
            &font,
            label,
        );
    }
    let middle = x as f32 + width as f32 / 2.0;
    canvas.text(
        middle,
        bottom as f32 + 47.0,
        Anchor::Middle,
        &font,
        sheet.across_label,
    );

    let (low, high) = sheet.up;
    for (value, label) in &plan.up {
        let at = bottom as f64 - (value - low) / (high - low) * height as f64;
        let pixel = (at as usize).clamp(y, bottom - 1);
        canvas.fill(x - 1 - TICK, pixel, TICK, 1, INK);
        let end = (x - TO_LABEL) as f32;
        canvas.text(end, at as f32 + 5.0, Anchor::Right, &font, label);
    }
    let base = (x - TO_LABEL) as f32 - widest(&font, &plan.up) - TEXT_GAP;
    canvas.text_upwards(base, y as f32 + height as f32 / 2.0, &font, sheet.up_label);
}

fn colour_bar(
    canvas: &mut Canvas,
    sheet: &Sheet,
    (levels, colours): (Levels, Colours),
    (x, y): (usize, usize),
    height: usize,
) {
    let font = Typeface::sans(LABEL_PX, false);
    for row in 0..height {
        let level = 1.0 - (row as f64 + 0.5) / height as f64;
        canvas.fill(x, y + row, BAR, 1, colours.at(level));
    }
    canvas.frame(x, y, BAR, height);
    let (low, high) = (levels.bottom, levels.top);
    for (value, label) in bar_ticks(levels, height) {
        let at = (y + height) as f64 - (value - low) / (high - low) * height as f64;
        let pixel = (at as usize).clamp(y, y + height - 1);
        canvas.fill(x + BAR + 1, pixel, TICK, 1, INK);
        canvas.text(
            (x + BAR + TO_LABEL) as f32,
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
        sheet.bar_label,
    );
}
