//! Line charts: curves, ticks, grid, legend, marked values.
//!
//! Lines are antialiased by the distance of pixel centres. A curve covers each
//! pixel once, so that dense curves are not darker. Curves are clipped to the
//! plot; a non-finite point interrupts its curve.

use super::PlotError;
use super::canvas::{Anchor, Canvas, INK, Packing, Rgb, Typeface};
use super::ticks::{ticks, ticks_apart};

/// Line chart of one or more curves.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// Title, truncated to fit.
    pub title: String,
    /// Label of the horizontal axis, with unit.
    pub across_label: String,
    /// Label of the vertical axis, with unit.
    pub up_label: String,
    /// Curves, in the order of colours and legend.
    pub curves: Vec<Curve>,
    /// Horizontal values marked by thin vertical lines.
    pub marks: Vec<f64>,
    /// Range of the horizontal axis. Default (`None`): that of the curves, with a margin if `proportional`.
    pub across: Option<(f64, f64)>,
    /// Range of the vertical axis, such as a floor in dB. Default (`None`): that of the curves with a margin.
    pub up: Option<(f64, f64)>,
    /// Whether both axes have equal scale, as on a map; one range is widened, even if given.
    pub proportional: bool,
}

/// Curve of a chart.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Name in the legend; no entry if empty.
    pub name: String,
    /// Points, joined in this order.
    pub points: Vec<(f64, f64)>,
    /// Stroke.
    pub stroke: Stroke,
}

/// Stroke of a curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stroke {
    /// Solid line. Default.
    #[default]
    Solid,
    /// Dashed line.
    Dashed,
    /// Unconnected dots.
    Dots,
}

const WIDTH: usize = 960;
const HEIGHT: usize = 560;
const TOP: usize = 48;
const RIGHT: usize = 32;
const BOTTOM: usize = 60;
const MIN_LEFT: usize = 96;
const LABEL_PX: f32 = 15.0;
const TITLE_PX: f32 = 18.0;
const TICK: usize = 6;
const TO_LABEL: usize = TICK + 6;
const GRID: Rgb = [225, 225, 225];
const MARK: Rgb = [130, 130, 130];
/// Half a line's width, and radius of a dot, pixels.
const HALF_LINE: f64 = 0.9;
const DOT: f64 = 3.0;
/// Length of a dash, and of a gap, pixels.
const DASH: f64 = 9.0;
const GAP: f64 = 6.0;

/// Colour-blind safe palette (Okabe and Ito).
const COLOURS: [Rgb; 7] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [86, 180, 233],
    [230, 159, 0],
    [90, 90, 90],
];

/// Draw a chart as PNG.
///
/// # Errors
/// [`PlotError`] if there is no finite point, or a range is empty.
pub fn lines(chart: &Chart) -> Result<Vec<u8>, PlotError> {
    drawn(chart)?.into_png(Packing::Small)
}

/// Draw several charts one below the other as PNG.
///
/// # Errors
/// As [`lines`]; also if there is no chart.
pub fn stacked(charts: &[Chart]) -> Result<Vec<u8>, PlotError> {
    let pages: Result<Vec<Canvas>, PlotError> = charts.iter().map(drawn).collect();
    let page = pages?.into_iter().reduce(Canvas::above);
    let page = page.ok_or_else(|| PlotError::Unsuited {
        title: String::new(),
        what: "expected at least one chart, found none".to_owned(),
    })?;
    page.into_png(Packing::Small)
}

fn drawn(chart: &Chart) -> Result<Canvas, PlotError> {
    let unsuited = |what: &str| PlotError::Unsuited {
        title: chart.title.clone(),
        what: what.to_owned(),
    };
    let points = || chart.curves.iter().flat_map(|curve| &curve.points);
    let finite = || points().filter(|p| p.0.is_finite() && p.1.is_finite());
    if finite().next().is_none() {
        return Err(unsuited(
            "expected at least one point, found no finite point",
        ));
    }
    // On a map, symbols at the ends are drawn whole.
    let air = if chart.proportional { 0.05 } else { 0.0 };
    let across = chart
        .across
        .unwrap_or_else(|| apart(range(finite().map(|p| p.0)), air));
    let up = chart
        .up
        .unwrap_or_else(|| apart(range(finite().map(|p| p.1)), 0.05));
    let sound = |(low, high): (f64, f64)| low < high && (high - low).is_finite();
    if !(sound(across) && sound(up)) {
        return Err(unsuited("expected an axis range with a higher upper value"));
    }
    let page = match chart.proportional {
        true => Page::proportional(chart, across, up),
        false => Page::new(chart, across, up),
    };
    Ok(page.drawn(chart))
}

/// Smallest and largest value.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
        (low.min(v), high.max(v))
    })
}

/// Extend a range by the fraction `air` on both sides; never empty.
fn apart((low, high): (f64, f64), air: f64) -> (f64, f64) {
    match high > low {
        true => (low - air * (high - low), high + air * (high - low)),
        false => {
            let half = if low == 0.0 { 1.0 } else { low.abs() / 2.0 };
            (low - half, high + half)
        }
    }
}

/// Range of a given length about the centre of another.
fn about((low, high): (f64, f64), length: f64) -> (f64, f64) {
    let middle = low + 0.5 * (high - low);
    (middle - 0.5 * length, middle + 0.5 * length)
}

/// Plot box on the page, and its axis ranges.
struct Page {
    left: usize,
    width: usize,
    height: usize,
    across: (f64, f64),
    up: (f64, f64),
    up_ticks: Vec<(f64, String)>,
    font: Typeface,
}

impl Page {
    fn new(chart: &Chart, across: (f64, f64), up: (f64, f64)) -> Self {
        let font = Typeface::sans(LABEL_PX, false);
        let height = HEIGHT - TOP - BOTTOM;
        let up_ticks = ticks(up.0, up.1, height / 50);
        let label = if chart.up_label.is_empty() {
            0.0
        } else {
            LABEL_PX + 12.0
        };
        let room = TO_LABEL as f32 + widest(&font, &up_ticks) + label + 6.0;
        let left = MIN_LEFT.max(room.ceil() as usize);
        Self {
            left,
            width: WIDTH - left - RIGHT,
            height,
            across,
            up,
            up_ticks,
            font,
        }
    }

    /// Page with equal scale on both axes.
    fn proportional(chart: &Chart, across: (f64, f64), up: (f64, f64)) -> Self {
        let first = Self::new(chart, across, up);
        let of_up = (up.1 - up.0) / first.height as f64;
        let pixel = |page: &Self| of_up.max((across.1 - across.0) / page.width as f64);
        let of = |pixel: f64| Self::new(chart, across, about(up, pixel * first.height as f64));
        // Tick labels change the width available; the narrower layout fits both.
        let pixel = pixel(&first).max(pixel(&of(pixel(&first))));
        let mut page = of(pixel);
        page.across = about(across, pixel * page.width as f64);
        page
    }

    /// Position in pixels from the box's left and top edge.
    fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (
            (x - self.across.0) / (self.across.1 - self.across.0) * self.width as f64,
            (self.up.1 - y) / (self.up.1 - self.up.0) * self.height as f64,
        )
    }

    fn drawn(&self, chart: &Chart) -> Canvas {
        let mut canvas = Canvas::new(WIDTH, HEIGHT);
        self.axes(&mut canvas, chart);
        for &mark in &chart.marks {
            let (x, _) = self.place((mark, 0.0));
            if (0.0..=self.width as f64).contains(&x) {
                let x = (x as usize).min(self.width - 1);
                for y in (0..self.height).step_by(6) {
                    let long = 3.min(self.height - y);
                    canvas.fill(self.left + x, TOP + y, 1, long, MARK);
                }
            }
        }
        for (curve, colour) in chart.curves.iter().zip(COLOURS.iter().cycle()) {
            let mut cover = Cover::new(self.width, self.height);
            cover.stroke(curve.points.iter().map(|&p| self.place(p)), curve.stroke);
            cover.onto(&mut canvas, (self.left, TOP), *colour);
        }
        canvas.frame(self.left, TOP, self.width, self.height);
        self.legend(&mut canvas, chart);
        let title = Typeface::sans(TITLE_PX, true);
        let text = title.fitted(&chart.title, self.width as f32);
        canvas.text(
            self.left as f32,
            TOP as f32 - 16.0,
            Anchor::Left,
            &title,
            &text,
        );
        canvas
    }

    fn axes(&self, canvas: &mut Canvas, chart: &Chart) {
        let (width, height, bottom) = (self.width, self.height, TOP + self.height);
        let (low, high) = self.across;
        let marks = ticks_apart(low, high, width / 80, width as f64, |label| {
            f64::from(self.font.width(label) + 12.0)
        });
        for (value, label) in marks {
            let (x, _) = self.place((value, 0.0));
            let pixel = self.left + (x as usize).min(width - 1);
            canvas.fill(pixel, TOP, 1, height, GRID);
            canvas.fill(pixel, bottom + 1, 1, TICK, INK);
            let (x, y) = ((self.left as f64 + x) as f32, bottom as f32 + 23.0);
            canvas.text(x, y, Anchor::Middle, &self.font, &label);
        }
        for (value, label) in &self.up_ticks {
            let (_, y) = self.place((0.0, *value));
            let pixel = TOP + (y as usize).min(height - 1);
            canvas.fill(self.left, pixel, width, 1, GRID);
            canvas.fill(self.left - 1 - TICK, pixel, TICK, 1, INK);
            let (x, y) = ((self.left - TO_LABEL) as f32, (TOP as f64 + y) as f32 + 5.0);
            canvas.text(x, y, Anchor::Right, &self.font, label);
        }
        let middle = self.left as f32 + width as f32 / 2.0;
        let base = bottom as f32 + 47.0;
        canvas.text(
            middle,
            base,
            Anchor::Middle,
            &self.font,
            &chart.across_label,
        );
        let base = (self.left - TO_LABEL) as f32 - widest(&self.font, &self.up_ticks) - 12.0;
        let middle = TOP as f32 + height as f32 / 2.0;
        canvas.text_upwards(base, middle, &self.font, &chart.up_label);
    }

    /// Draw the legend in a corner.
    fn legend(&self, canvas: &mut Canvas, chart: &Chart) {
        const LINE: usize = 22;
        const SAMPLE: usize = 34;
        let named: Vec<_> = chart
            .curves
            .iter()
            .zip(COLOURS.iter().cycle())
            .filter(|(curve, _)| !curve.name.is_empty())
            .collect();
        let most = self.width as f32 / 2.0;
        let names: Vec<String> = named
            .iter()
            .map(|(curve, _)| self.font.fitted(&curve.name, most))
            .collect();
        let Some(widest) = names.iter().map(|n| self.font.width(n)).reduce(f32::max) else {
            return;
        };
        let (width, height) = (
            SAMPLE + widest.ceil() as usize + 26,
            named.len() * LINE + 10,
        );
        // Corner with the fewest curve pixels, upper corners first.
        let [left, top] = [self.left + 10, TOP + 10];
        let [right, bottom] = [
            (self.left + self.width)
                .saturating_sub(width + 10)
                .max(left),
            (TOP + self.height).saturating_sub(height + 10).max(top),
        ];
        let corners = [(right, top), (left, top), (right, bottom), (left, bottom)];
        let hidden = |&(x, y): &(usize, usize)| {
            let [x, y] = [x - self.left, y - TOP].map(|from| from as f64);
            let within = |(px, py): (f64, f64)| {
                (x..x + width as f64).contains(&px) && (y..y + height as f64).contains(&py)
            };
            let points = chart.curves.iter().flat_map(|curve| &curve.points);
            let places = points.map(|&point| self.place(point));
            places.filter(|&place| within(place)).count()
        };
        let (x, y) = corners
            .into_iter()
            .min_by_key(hidden)
            .unwrap_or((right, top));
        canvas.fill(x, y, width, height, GRID);
        canvas.fill(x + 1, y + 1, width - 2, height - 2, [255; 3]);
        for (i, ((curve, colour), name)) in named.iter().zip(&names).enumerate() {
            let mut cover = Cover::new(SAMPLE, LINE);
            let middle = LINE as f64 / 2.0;
            let ends = match curve.stroke {
                Stroke::Dots => vec![(SAMPLE as f64 / 2.0, middle)],
                _ => vec![(1.0, middle), (SAMPLE as f64 - 1.0, middle)],
            };
            cover.stroke(ends.into_iter(), curve.stroke);
            let top = y + 5 + i * LINE;
            cover.onto(canvas, (x + 8, top), **colour);
            let (x, y) = ((x + 8 + SAMPLE + 8) as f32, top as f32 + 16.0);
            canvas.text(x, y, Anchor::Left, &self.font, name);
        }
    }
}

fn widest(font: &Typeface, ticks: &[(f64, String)]) -> f32 {
    ticks.iter().map(|t| font.width(&t.1)).fold(0.0, f32::max)
}

/// Coverage of each pixel of the box by a curve.
struct Cover {
    width: usize,
    height: usize,
    parts: Vec<f32>,
}

impl Cover {
    fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            parts: vec![0.0; width * height],
        }
    }

    /// Draw through points in pixels.
    fn stroke(&mut self, points: impl Iterator<Item = (f64, f64)>, stroke: Stroke) {
        let mut last: Option<(f64, f64)> = None;
        let mut walked = 0.0;
        for point in points {
            if !(point.0.is_finite() && point.1.is_finite()) {
                last = None;
                continue;
            }
            match (stroke, last) {
                (Stroke::Dots, _) => self.segment(point, point, DOT),
                (_, None) => {}
                (Stroke::Solid, Some(before)) => self.segment(before, point, HALF_LINE),
                (Stroke::Dashed, Some(before)) => walked = self.dashes(before, point, walked),
            }
            last = Some(point);
        }
    }

    /// Draw dashes from `a` to `b`, starting `walked` pixels into the pattern; returns the position in the pattern at `b`.
    fn dashes(&mut self, a: (f64, f64), b: (f64, f64), walked: f64) -> f64 {
        let Some((a, b)) = self.clipped(a, b) else {
            return walked;
        };
        let length = (b.0 - a.0).hypot(b.1 - a.1);
        let at = |s: f64| {
            let part = if length > 0.0 { s / length } else { 0.0 };
            (a.0 + part * (b.0 - a.0), a.1 + part * (b.1 - a.1))
        };
        let mut s = -walked;
        while s < length {
            let (from, to) = (s.max(0.0), (s + DASH).min(length));
            if from < to {
                self.segment(at(from), at(to), HALF_LINE);
            }
            s += DASH + GAP;
        }
        (walked + length) % (DASH + GAP)
    }

    /// Draw a line with round ends.
    fn segment(&mut self, a: (f64, f64), b: (f64, f64), half_width: f64) {
        let Some((a, b)) = self.clipped(a, b) else {
            return;
        };
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let square = dx * dx + dy * dy;
        let reach = half_width + 1.0;
        let span = |u: f64, v: f64, size: usize| {
            let low = (u.min(v) - reach).floor().max(0.0) as usize;
            let high = (u.max(v) + reach).ceil().max(0.0) as usize;
            low.min(size)..high.min(size)
        };
        for y in span(a.1, b.1, self.height) {
            for x in span(a.0, b.0, self.width) {
                let (px, py) = (x as f64 + 0.5 - a.0, y as f64 + 0.5 - a.1);
                let along = if square > 0.0 {
                    ((px * dx + py * dy) / square).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let distance = (px - along * dx).hypot(py - along * dy);
                let part = (half_width + 0.5 - distance).clamp(0.0, 1.0) as f32;
                let cell = &mut self.parts[y * self.width + x];
                *cell = cell.max(part);
            }
        }
    }

    /// Clip a segment to a few pixels around the box (Liang and Barsky 1984).
    fn clipped(&self, a: (f64, f64), b: (f64, f64)) -> Option<((f64, f64), (f64, f64))> {
        let air = DOT + 2.0;
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let (mut first, mut last) = (0.0f64, 1.0f64);
        for (step, room) in [
            (-dx, a.0 + air),
            (dx, self.width as f64 + air - a.0),
            (-dy, a.1 + air),
            (dy, self.height as f64 + air - a.1),
        ] {
            if step == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if step < 0.0 {
                first = first.max(room / step);
            } else {
                last = last.min(room / step);
            }
        }
        let at = |t: f64| (a.0 + t * dx, a.1 + t * dy);
        (first <= last).then(|| (at(first), at(last)))
    }

    fn onto(&self, canvas: &mut Canvas, (left, top): (usize, usize), colour: Rgb) {
        for (i, &part) in self.parts.iter().enumerate().filter(|(_, p)| **p > 0.0) {
            let (x, y) = (left + i % self.width, top + i / self.width);
            canvas.mix(x as i64, y as i64, colour, part);
        }
    }
}
