//! Pictures where people would rather look than read.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `plot`.
//!
//! A picture of a complex image: its magnitude in decibels, `20 log10 |I|`, with a colour bar. Axes show the
//! scene's coordinates in metres, rows upwards; those of a turned plane say which way they run
//! ([`subaperture_model::geometry::SceneAxis`]). A polar grid shows range upwards and its angle, which grows
//! counter-clockwise, to the left, so that the picture is no mirror image of the scene. Cartesian grids keep
//! their proportions. Levels above the scale's top are drawn in a colour of their own, which caps the
//! bar. Large images are reduced by averaging power, so that a lone bright pixel is dimmed
//! but never dropped; small ones are enlarged without interpolation. Pixels that are NaN or infinite
//! are red.
//!
//! Colour tells of other images of the same grid, if asked ([`Paint`]): which part of the aperture saw a place, or how its polarisations differ.
//!
//! [`heat`] shows any real values over any two axes on a linear scale, [`lines`] draws curves, [`stacked`] several charts of them.
//!
//! Text is set in DejaVu Sans, which the program carries: no font need be installed.
#![forbid(unsafe_code)]

mod canvas;
mod colours;
mod composite;
mod heat;
mod layout;
mod lines;
mod orientation;
mod raster;
mod scale;
mod shades;
mod ticks;

use canvas::Packing;
use layout::{Drawn, Sheet};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{Image, Parts, PartsError, power};

pub use colours::Colours;
pub use composite::{Channel, MOST_HUES, Paint};
pub use heat::{Heat, heat};
pub use lines::{Chart, Curve, Stroke, lines, stacked};
pub use orientation::Orientation;
pub use scale::Scale;

/// Where the pixels of a picture come from.
#[derive(Clone, Copy, Debug)]
pub enum Source<'a> {
    /// An image in memory.
    Whole(&'a Image),
    /// One that need not fit there.
    Parts(&'a dyn Parts),
}

impl<'a> From<&'a Image> for Source<'a> {
    fn from(image: &'a Image) -> Self {
        Self::Whole(image)
    }
}

impl Source<'_> {
    fn size(&self) -> (usize, usize) {
        match self {
            Self::Whole(image) => (image.rows, image.columns),
            Self::Parts(parts) => parts.size(),
        }
    }

    /// Mean powers on `height x width` cells that cover the first `rows` and `columns`.
    fn powers(
        &self,
        (rows, columns): (usize, usize),
        height: usize,
        width: usize,
    ) -> Result<Vec<f64>, PartsError> {
        match self {
            Self::Whole(image) => {
                let line = |row: usize| &image.pixels[row * image.columns..];
                let size = (rows, columns);
                Ok(raster::resample(size, line, |&z| power(z), height, width))
            }
            Self::Parts(parts) => {
                let mut reduced = raster::Reduced::new((rows, columns), height, width);
                for place in parts.places() {
                    if place[0].start >= rows || place[1].start >= columns {
                        continue;
                    }
                    let window = parts.window(&place)?;
                    let [down, across] = place;
                    let lines = window.pixels.chunks_exact(across.len());
                    for (row, values) in (down.start..down.end.min(rows)).zip(lines) {
                        let powers = values.iter().map(|&z| power(z));
                        reduced.add(row, across.start, powers);
                    }
                }
                Ok(reduced.finish())
            }
        }
    }
}

/// An image and how to show it.
#[derive(Clone, Debug)]
pub struct Panel<'a> {
    /// The image.
    pub image: Source<'a>,
    /// Its grid: rows and columns as the image's.
    pub grid: &'a ImageGrid,
    /// The line above it; cut short if it does not fit.
    pub title: String,
    /// Which levels are black and white.
    pub scale: Scale,
    /// The colours between.
    pub colours: Colours,
    /// What the axes across and up show.
    pub axes: [ShownAxis; 2],
    /// What 0 dB is; empty where the title says it.
    pub reference: &'static str,
    /// Directions to mark beside the picture.
    pub orientation: Orientation,
    /// Rows and columns of pixels whose mean power is one pixel of what is shown, as many looks; what is left at the last row and column is not shown.
    pub looks: [usize; 2],
    /// Whether row 0 is the uppermost, as in SICD.
    pub rows_down: bool,
    /// What colours are of, if not of levels.
    pub paint: Paint<'a>,
}

/// What is written along an axis: `offset + scale * coordinate` of the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct ShownAxis {
    /// Its name and unit.
    pub label: String,
    /// Value shown at coordinate 0.
    pub offset: f64,
    /// What a coordinate is multiplied by: -1 where the axis runs backwards, degrees a radian.
    pub scale: f64,
}

impl ShownAxis {
    /// An axis that shows the grid's own coordinate.
    pub fn plain(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            offset: 0.0,
            scale: 1.0,
        }
    }

    /// The axes across and up of an image's grid.
    pub fn of_grid(grid: &ImageGrid) -> [Self; 2] {
        let axes = grid.scene_axes();
        if grid.polar {
            let [zero, quarter] = &axes;
            let turned =
                match (zero.name, quarter.name) == ("x", "y") && zero.sign + quarter.sign == 2.0 {
                    true => String::new(),
                    false => {
                        let [x, y, z] = grid
                            .x_axis
                            .to_array()
                            .map(|v| (v * 100.0).round() / 100.0 + 0.0);
                        format!(" from ({x:.2}, {y:.2}, {z:.2})")
                    }
                };
            let range = Self::plain(format!("range (m){}", grid.pole_note()));
            let angle = Self {
                scale: 1f64.to_degrees(),
                ..Self::plain(format!("angle (deg){turned}"))
            };
            return [angle, range];
        }
        axes.map(|axis| {
            let note = match axis.note.as_str() {
                "" => String::new(),
                note => format!(", {note}"),
            };
            Self {
                label: format!("{} (m){note}", axis.name),
                offset: axis.offset_m,
                scale: axis.sign,
            }
        })
    }

    /// Values at the outer edges of the first and the last pixel.
    pub fn edges(&self, axis: &Axis) -> (f64, f64) {
        let (first, last) = edges(axis);
        let shown = |coordinate| self.offset + self.scale * coordinate;
        (shown(first), shown(last))
    }
}

impl<'a> Panel<'a> {
    /// A grey picture with a scale of its own, its axes those of an image.
    pub fn new(
        image: impl Into<Source<'a>>,
        grid: &'a ImageGrid,
        title: impl Into<String>,
    ) -> Self {
        Self {
            image: image.into(),
            grid,
            title: title.into(),
            scale: Scale::default(),
            colours: Colours::Grey,
            axes: ShownAxis::of_grid(grid),
            reference: "0 dB: a unit scatterer",
            orientation: Orientation::default(),
            looks: [1, 1],
            rows_down: false,
            paint: Paint::Levels,
        }
    }

    /// The grid of what is shown: that of boxes of so many looks.
    pub fn shown_grid(&self) -> ImageGrid {
        let boxes = |axis: &Axis, looks: usize| Axis {
            start: axis.start + axis.step * (looks as f64 - 1.0) / 2.0,
            step: axis.step * looks as f64,
            count: axis.count / looks.max(1),
        };
        ImageGrid {
            rows: boxes(&self.grid.rows, self.looks[0]),
            columns: boxes(&self.grid.columns, self.looks[1]),
            ..self.grid.clone()
        }
    }

    /// Mean powers of an image on the panel's grid, on cells of what is shown: first of boxes, or of cells that are larger than they, then as often as cells repeat them.
    fn powers(&self, image: &Source, height: usize, width: usize) -> Result<Vec<f64>, PartsError> {
        let shown = self.shown_grid();
        let count = (shown.rows.count, shown.columns.count);
        let covered = (count.0 * self.looks[0], count.1 * self.looks[1]);
        let (down, across) = (height.min(count.0), width.min(count.1));
        let mut cells = image.powers(covered, down, across)?;
        if (down, across) != (height, width) {
            let line = |row: usize| &cells[row * across..];
            cells = raster::resample((down, across), line, |&x| x, height, width);
        }
        // Angles grow to the left.
        if self.grid.polar {
            cells.chunks_exact_mut(width).for_each(<[f64]>::reverse);
        }
        if self.rows_down {
            let lines = cells.chunks_exact(width).rev();
            cells = lines.flatten().copied().collect();
        }
        Ok(cells)
    }

    fn sheet(&self) -> Sheet<'_> {
        let grid = self.shown_grid();
        let [across, up] = &self.axes;
        let length = |axis: &Axis| axis.count as f64 * axis.step.abs();
        let (first, last) = across.edges(&grid.columns);
        let (lowest, highest) = up.edges(&grid.rows);
        Sheet {
            title: &self.title,
            count: (grid.rows.count, grid.columns.count),
            across: match grid.polar {
                true => (last, first),
                false => (first, last),
            },
            up: match self.rows_down {
                true => (highest, lowest),
                false => (lowest, highest),
            },
            across_label: &across.label,
            up_label: &up.label,
            bar_label: "dB",
            note: self.reference,
            arrows: self.orientation.arrows(&grid),
            proportions: match grid.polar {
                true => (grid.columns.count as f64, grid.rows.count as f64),
                false => (length(&grid.columns), length(&grid.rows)),
            },
            colours: match self.paint {
                Paint::Levels => self.colours,
                _ => Colours::Grey,
            },
            absent: colours::RED,
            // Without the image's powers, which only matter to a scale from the data, whose labels,
            // whole decibels of three digits, fit the least room anyhow.
            typical: self.scale.levels(&[]),
            key: self.paint.key(),
            cells: Box::new(move |height, width| self.drawn(height, width)),
        }
    }

    /// What cells show.
    fn drawn(&self, height: usize, width: usize) -> Result<Drawn, PartsError> {
        let powers = |image: &Source| self.powers(image, height, width);
        match &self.paint {
            Paint::Levels => {
                let cells = powers(&self.image)?;
                let levels = self.scale.levels(&cells);
                Ok(Drawn::Powers(cells, levels))
            }
            Paint::Hues(parts) => composite::hues(&self.image, parts, self.scale, powers),
            Paint::Channels(channels) => composite::channels(channels, self.scale, powers),
        }
    }
}

/// Coordinates at an axis' two ends: the outer edges of its first and last pixel.
fn edges(axis: &Axis) -> (f64, f64) {
    let half = axis.step / 2.0;
    let last = axis.at(axis.count - 1);
    (axis.start - half, last + half)
}

/// Why no picture was drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// The image is not on this grid, or there is none.
    #[error("cannot draw {title:?}: {what}")]
    Unsuited {
        /// The panel's title.
        title: String,
        /// What is wrong.
        what: String,
    },
    /// A part of an image could not be read.
    #[error(transparent)]
    Parts(PartsError),
    /// The picture could not be encoded.
    #[error("cannot encode the picture: {0}")]
    Encoding(#[from] png::EncodingError),
}

/// One picture, as the bytes of a PNG file: up to 1600 pixels a side, and its margins.
///
/// # Errors
/// [`PlotError`].
pub fn quicklook(panel: &Panel) -> Result<Vec<u8>, PlotError> {
    quicklook_within(panel, u64::MAX)
}

/// [`quicklook`], so much smaller that drawing it takes about `memory_bytes`, or 4 MiB if that is more.
///
/// # Errors
/// [`PlotError`].
pub fn quicklook_within(panel: &Panel, memory_bytes: u64) -> Result<Vec<u8>, PlotError> {
    let a_cell = BYTES_A_CELL + panel.paint.bytes_a_cell();
    let side = ((memory_bytes / a_cell) as f64).sqrt() as usize;
    page(
        std::slice::from_ref(panel),
        1,
        side.clamp(LEAST_SHOWN, LONGEST),
    )
}

/// What a pixel of a picture takes while it is drawn: its power, that once more to find the scale, its colour, and that
/// on the way into a PNG file.
const BYTES_A_CELL: u64 = 24;

/// Pixels a side of a lone picture, at most, and at least where memory is short.
const LONGEST: usize = 1600;
const LEAST_SHOWN: usize = 400;

/// Several pictures on one page, `columns` side by side, row by row, as the bytes of a PNG file. The
/// more columns, the smaller each: up to 800 pixels a side for two, 560 for three or more.
///
/// # Errors
/// [`PlotError`].
pub fn panels(panels: &[Panel], columns: usize) -> Result<Vec<u8>, PlotError> {
    let limit = match columns.min(panels.len()) {
        0 | 1 => LONGEST,
        2 => 800,
        _ => 560,
    };
    page(panels, columns, limit)
}

fn page(panels: &[Panel], columns: usize, limit: usize) -> Result<Vec<u8>, PlotError> {
    for panel in panels {
        let unsuited = |what: String| PlotError::Unsuited {
            title: panel.title.clone(),
            what,
        };
        let (rows, columns) = (panel.grid.rows.count, panel.grid.columns.count);
        for image in std::iter::once(&panel.image).chain(panel.paint.images()) {
            let (height, width) = image.size();
            let whole = match image {
                Source::Whole(image) => height.checked_mul(width) == Some(image.pixels.len()),
                Source::Parts(_) => true,
            };
            if (height, width) != (rows, columns) || !whole {
                return Err(unsuited(format!(
                    "the image has {height} rows x {width} columns, the grid {rows} x {columns}"
                )));
            }
        }
        if let Some(what) = panel.paint.fault() {
            return Err(unsuited(what));
        }
        let [down, across] = panel.looks;
        let fits = |looks: usize, count: usize| looks >= 1 && looks <= count.max(1);
        if !(fits(down, rows) && fits(across, columns)) {
            return Err(unsuited(format!(
                "{down} x {across} looks are no part of {rows} rows x {columns} columns"
            )));
        }
    }
    let empty = panels
        .iter()
        .find(|p| p.image.size().0 * p.image.size().1 == 0);
    if panels.is_empty() || empty.is_some() {
        return Err(PlotError::Unsuited {
            title: empty.map_or_else(String::new, |p| p.title.clone()),
            what: "there is nothing to draw".to_owned(),
        });
    }
    let sheets: Vec<Sheet> = panels.iter().map(Panel::sheet).collect();
    layout::page(&sheets, columns.clamp(1, panels.len()), limit)?.into_png(Packing::Quick)
}
