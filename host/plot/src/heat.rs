//! Heat map of real values over two axes, linear scale.

use super::canvas::Packing;
use super::colours::{PALE, RED};
use super::layout::{Drawn, LONGEST, Sheet, page};
use super::raster::resample;
use super::scale::Levels;
use super::{Colours, PlotError, edges};
use subaperture_model::geometry::Axis;

/// Heat map. Large maps are reduced by averaging the finite values; cells without finite values are pale, or red
/// in grey maps.
#[derive(Clone, Debug)]
pub struct HeatMap<'a> {
    /// Values, row-major; row 0 is drawn lowest.
    pub values: &'a [f32],
    /// Axis of the rows, in the unit of its label.
    pub rows: Axis,
    /// Axis of the columns, in the unit of its label.
    pub columns: Axis,
    /// Title, truncated to fit.
    pub title: String,
    /// Label of the horizontal axis with unit, such as `Doppler (Hz)`.
    pub across_label: String,
    /// Label of the vertical axis with unit, such as `range (m)`.
    pub up_label: String,
    /// Short unit of the values, drawn below the colour bar.
    pub unit: String,
    /// Values of the lowest and highest colour.
    pub range: (f64, f64),
    /// Colour map.
    pub colours: Colours,
    /// Whether both axes have equal scale; otherwise pixels are square.
    pub proportional: bool,
}

/// Draw a heat map as PNG, up to 1600 pixels per side plus margins.
///
/// # Errors
/// [`PlotError`] if the number of values or the range is invalid, or encoding fails.
pub fn heat(heat: &HeatMap) -> Result<Vec<u8>, PlotError> {
    let size = (heat.rows.count, heat.columns.count);
    let unsuited = |what: String| PlotError::Unsuited {
        title: heat.title.clone(),
        what,
    };
    if size.0.checked_mul(size.1) != Some(heat.values.len()) || heat.values.is_empty() {
        return Err(unsuited(format!(
            "{} values do not fill {} rows x {} columns: expected one value per pixel",
            heat.values.len(),
            size.0,
            size.1
        )));
    }
    let (bottom, top) = heat.range;
    if !(bottom.is_finite() && top.is_finite() && bottom < top) {
        return Err(unsuited(format!(
            "expected a finite range with top above bottom, found {bottom} to {top}"
        )));
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
            Colours::Viridis | Colours::Hue => PALE,
        },
        typical: levels,
        key: Vec::new(),
        marks: Vec::new(),
        dots: None,
        cells: Box::new(move |height, width| {
            let line = |row: usize| &heat.values[row * size.1..];
            let cells = resample(size, line, |&x| f64::from(x), height, width);
            Ok(Drawn::Levels(cells, levels))
        }),
    };
    page(&[sheet], 1, LONGEST)?.into_png(Packing::Small)
}
