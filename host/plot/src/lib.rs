//! Plots as PNG: radar images, heat maps and line charts.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `plot`.
//!
//! [`quicklook`] draws the magnitude of a complex image in decibels, `20 log10 |I|`, with a colour bar. Axes show
//! scene coordinates in metres, rows upwards; axes of a rotated plane are labelled with their direction
//! ([`subaperture_model::geometry::SceneAxis`]). A polar grid is drawn with range upwards and its angle, which is
//! counter-clockwise, to the left, so that the picture is not mirrored. Cartesian grids keep
//! their aspect. Levels above the upper level have a separate colour, shown as a cap on the colour
//! bar. Large images are reduced by averaging power, which dims a single bright pixel
//! but never drops it; small images are enlarged without interpolation. NaN and infinite pixels
//! are red.
//!
//! [`ColourSource`] selects colour composites of several images of one grid, sub-apertures or polarisations, and masks over one image. [`Dots`] are values of single points over an image.
//!
//! [`heat`] draws real values over two axes on a linear scale, [`lines`] draws curves, [`stacked`] several charts.
//!
//! Text uses the embedded font DejaVu Sans; no installed font is needed.
#![forbid(unsafe_code)]

mod canvas;
mod cells;
mod colours;
mod composite;
mod dots;
mod error;
mod heat;
mod layout;
mod lines;
mod marks;
mod orientation;
mod raster;
mod scale;
mod shades;
mod source;
mod ticks;

use canvas::Packing;
use layout::{BYTES_A_CELL, Drawn, LONGEST, Sheet, longest};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::ImageSourceError;

pub use cells::PictureCells;
pub use colours::Colours;
pub use composite::{Channel, ColourSource, MAX_HUES, Mask};
pub use dots::{Dot, Dots};
pub use heat::{HeatMap, heat};
pub use lines::{Chart, Curve, Stroke, lines, stacked};
pub use orientation::Orientation;
pub use scale::{Scale, Upper, automatic_levels_db};

pub use source::Source;

pub use error::PlotError;
pub use marks::Mark;

/// Picture of an image.
#[derive(Clone, Debug)]
pub struct Panel<'a> {
    /// Image to draw.
    pub image: Source<'a>,
    /// Grid of the image, of the same rows and columns.
    pub grid: &'a ImageGrid,
    /// Title, truncated to fit.
    pub title: String,
    /// Levels of black and white.
    pub scale: Scale,
    /// Colour map.
    pub colours: Colours,
    /// Horizontal and vertical axis.
    pub axes: [ShownAxis; 2],
    /// Meaning of 0 dB, drawn as a note; may be empty.
    pub reference: &'static str,
    /// Look direction and north, drawn as arrows.
    pub orientation: Orientation,
    /// Multilook factor, rows x columns: the mean power of that many pixels is one pixel of the picture. Incomplete boxes at the last row and column are omitted. Default: 1 x 1.
    pub looks: [usize; 2],
    /// Whether row 0 is at the top, as in SICD.
    pub rows_down: bool,
    /// Source of the colours.
    pub paint: ColourSource<'a>,
    /// Numbered marks over the image.
    pub marks: Vec<Mark>,
    /// Coloured dots over the image, whose values the colour bar shows.
    pub dots: Option<Dots>,
}

/// Axis labelling: value `offset + scale * coordinate` of the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct ShownAxis {
    /// Name and unit of the quantity.
    pub label: String,
    /// Value at coordinate 0.
    pub offset: f64,
    /// Factor of the coordinate: -1 for a reversed axis, degrees per radian for angles.
    pub scale: f64,
}

impl ShownAxis {
    /// Axis with the grid's own coordinate.
    pub fn plain(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            offset: 0.0,
            scale: 1.0,
        }
    }

    /// Horizontal and vertical axis of a grid.
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

    /// Values at the outer edges of the first and last pixel.
    pub fn edges(&self, axis: &Axis) -> (f64, f64) {
        let (first, last) = edges(axis);
        let shown = |coordinate| self.offset + self.scale * coordinate;
        (shown(first), shown(last))
    }
}

impl<'a> Panel<'a> {
    /// Grey picture with automatic levels and the grid's axes.
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
            paint: ColourSource::Levels,
            marks: Vec::new(),
            dots: None,
        }
    }

    /// Grid of the picture after multilooking.
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

    /// Mean power of an image on the cells of the picture: multilooked, averaged over larger cells, or repeated for smaller cells.
    fn powers(
        &self,
        image: &Source,
        height: usize,
        width: usize,
    ) -> Result<Vec<f64>, ImageSourceError> {
        let shown = self.shown_grid();
        let count = (shown.rows.count, shown.columns.count);
        let covered = (count.0 * self.looks[0], count.1 * self.looks[1]);
        let (down, across) = (height.min(count.0), width.min(count.1));
        let cells = image.powers(covered, down, across)?;
        let mut cells = cells::enlarged(cells, (down, across), (height, width));
        // Angles increase to the left.
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
            bar_label: self.dots.as_ref().map_or("dB", |dots| &dots.unit),
            note: self.reference,
            arrows: self.orientation.arrows(&grid),
            proportions: cells::proportions(&grid),
            colours: match self.paint {
                ColourSource::Levels => self.colours,
                _ => Colours::Grey,
            },
            absent: colours::RED,
            // Without the image's powers, which only automatic levels need; their labels,
            // whole decibels of three digits, fit the smallest room.
            typical: match &self.dots {
                Some(dots) => dots.levels(),
                None => self.scale.levels(&[]),
            },
            key: self.paint.key(),
            marks: self
                .marks
                .iter()
                .map(|mark| self.placed(mark, &grid))
                .collect(),
            dots: self.dots.as_ref().map(|dots| {
                let places = dots.dots.iter().map(|dot| self.fractions(dot.at, &grid));
                (dots, places.collect())
            }),
            cells: Box::new(move |height, width| self.drawn(height, width)),
        }
    }

    /// Position of a mark as fractions of the picture, rightwards and downwards, and its label.
    fn placed<'m>(&self, mark: &'m Mark, grid: &ImageGrid) -> ([f64; 2], &'m str) {
        (self.fractions(mark.at, grid), &mark.label)
    }

    /// Coordinates of row and column as fractions of the picture, rightwards and downwards.
    fn fractions(&self, at: [f64; 2], grid: &ImageGrid) -> [f64; 2] {
        let part = |value: f64, axis: &Axis, reversed: bool| {
            let (first, last) = edges(axis);
            let part = (value - first) / (last - first);
            if reversed { 1.0 - part } else { part }
        };
        let right = part(at[1], &grid.columns, grid.polar);
        let down = part(at[0], &grid.rows, !self.rows_down);
        [right, down]
    }

    /// Values or colours of the cells.
    fn drawn(&self, height: usize, width: usize) -> Result<Drawn, ImageSourceError> {
        let powers = |image: &Source| self.powers(image, height, width);
        match &self.paint {
            ColourSource::Levels => {
                let cells = powers(&self.image)?;
                let levels = self.scale.levels(&cells);
                Ok(Drawn::Powers(cells, levels))
            }
            ColourSource::Hues(parts) => composite::hues(&self.image, parts, self.scale, powers),
            ColourSource::Channels(channels) => composite::channels(channels, self.scale, powers),
            ColourSource::Mask(mask) => composite::masked(&self.image, mask, self.scale, powers),
        }
    }
}

/// Coordinates of the outer edges of an axis' first and last pixel.
fn edges(axis: &Axis) -> (f64, f64) {
    let half = axis.step / 2.0;
    let last = axis.at(axis.count - 1);
    (axis.start - half, last + half)
}

/// Draw a picture as PNG, up to 1600 pixels per side plus margins.
///
/// # Errors
/// [`PlotError`] if image and grid differ in size, a setting is invalid, or the image cannot be read.
pub fn quicklook(panel: &Panel) -> Result<Vec<u8>, PlotError> {
    quicklook_within(panel, u64::MAX)
}

/// [`quicklook`], reduced in size such that drawing needs about `memory_bytes`, but at least 4 MiB.
///
/// # Errors
/// As [`quicklook`].
pub fn quicklook_within(panel: &Panel, memory_bytes: u64) -> Result<Vec<u8>, PlotError> {
    let a_cell = BYTES_A_CELL + panel.paint.bytes_a_cell();
    page(
        std::slice::from_ref(panel),
        1,
        longest(memory_bytes, a_cell),
    )
}

/// Draw several pictures on one page as PNG, `columns` side by side, row by row. Largest side of each: 1600 pixels for one column,
/// 800 for two, 560 for three or more.
///
/// # Errors
/// As [`quicklook`]; also if there is no picture.
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
                Source::ImageSource(_) => true,
            };
            if (height, width) != (rows, columns) || !whole {
                return Err(unsuited(format!(
                    "expected an image of its grid's size, found {height} rows x {width} columns and a grid of {rows} x {columns}"
                )));
            }
        }
        let dots = panel.dots.as_ref().and_then(Dots::fault);
        if let Some(what) = panel.paint.fault().or(dots) {
            return Err(unsuited(what));
        }
        let [down, across] = panel.looks;
        let fits = |looks: usize, count: usize| looks >= 1 && looks <= count.max(1);
        if !(fits(down, rows) && fits(across, columns)) {
            return Err(unsuited(format!(
                "{down} x {across} looks exceed the image of {rows} rows x {columns} columns, or are 0"
            )));
        }
    }
    let empty = panels
        .iter()
        .find(|p| p.image.size().0 * p.image.size().1 == 0);
    if panels.is_empty() || empty.is_some() {
        return Err(PlotError::Unsuited {
            title: empty.map_or_else(String::new, |p| p.title.clone()),
            what: "expected at least one picture, found none".to_owned(),
        });
    }
    let sheets: Vec<Sheet> = panels.iter().map(Panel::sheet).collect();
    layout::page(&sheets, columns.clamp(1, panels.len()), limit)?.into_png(Packing::Quick)
}
