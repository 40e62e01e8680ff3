//! Real values over two axes, on a linear scale.

use super::canvas::Packing;
use super::colours::{PALE, RED};
use super::layout::{Drawn, Sheet, page};
use super::raster::resample;
use super::scale::Levels;
use super::{Colours, PlotError, edges};
use subaperture_model::geometry::Axis;

/// Values and how to show them. Large maps are reduced by averaging; values that are NaN or infinite do not
/// count, and where there is nothing else the picture is pale, or red among greys.
#[derive(Clone, Debug)]
pub struct Heat<'a> {
    /// Values, row-major, row 0 shown lowest.
    pub values: &'a [f32],
    /// What the rows are, in the unit of their label.
    pub rows: Axis,
    /// What the columns are.
    pub columns: Axis,
    /// The line above it; cut short if it does not fit.
    pub title: String,
    /// Label across, with the unit: `Doppler (Hz)`.
    pub across_label: String,
    /// Label upwards: `range (m)`.
    pub up_label: String,
    /// Unit of the values, below the colour bar; short.
    pub unit: String,
    /// Values of the darkest and the brightest colour.
    pub range: (f64, f64),
    /// The colours between.
    pub colours: Colours,
    /// Whether both axes are lengths to be drawn alike; else every pixel is square.
    pub proportional: bool,
}

/// The picture, as the bytes of a PNG file: up to 1600 pixels a side, and its margins.
///
/// # Errors
/// [`PlotError`].
pub fn heat(heat: &Heat) -> Result<Vec<u8>, PlotError> {
    let size = (heat.rows.count, heat.columns.count);
    let unsuited = |what: String| PlotError::Unsuited {
        title: heat.title.clone(),
        what,
    };
    if size.0.checked_mul(size.1) != Some(heat.values.len()) || heat.values.is_empty() {
        return Err(unsuited(format!(
            "{} values do not fill {} rows x {} columns",
            heat.values.len(),
            size.0,
            size.1
        )));
    }
    let (bottom, top) = heat.range;
    if !(bottom.is_finite() && top.is_finite() && bottom < top) {
        return Err(unsuited(format!("no colours from {bottom} to {top}")));
    }
    let levels = Levels {
        bottom,
        top,
        marks_above: true,
    };
    let length = |axis: &Axis| match heat.proportional {
        true => axis.count as f64 * axis.step.abs(),
        false => axis.count as f64,
    };
    let sheet = Sheet {
        title: &heat.title,
        count: size,
        across: edges(&heat.columns),
        up: edges(&heat.rows),
        across_label: &heat.across_label,
        up_label: &heat.up_label,
        bar_label: &heat.unit,
        note: "",
        arrows: Vec::new(),
        proportions: (length(&heat.columns), length(&heat.rows)),
        colours: heat.colours,
        absent: match heat.colours {
            Colours::Grey => RED,
            Colours::Viridis => PALE,
        },
        typical: levels,
        key: Vec::new(),
        cells: Box::new(move |height, width| {
            let line = |row: usize| &heat.values[row * size.1..];
            let cells = resample(size, line, |&x| f64::from(x), height, width);
            Ok(Drawn::Levels(cells, levels))
        }),
    };
    page(&[sheet], 1, super::LONGEST)?.into_png(Packing::Small)
}
