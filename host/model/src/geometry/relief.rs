//! Relief of a focusing surface: heights above the plane of an image grid.
//!
//! A grid is a plane. With a relief its pixels are on a surface above that plane, displaced along the plane's normal
//! by the height of the relief there. The pixel of a surface point is therefore found as in a plane, from the foot of
//! its normal ([`super::ImageGrid::coordinates`]). The normal of a horizontal plane is the vertical at the scene's
//! origin.
//!
//! Heights are given at nodes, on a lattice of the plane's coordinates in metres, with bilinear interpolation in
//! between and constant extrapolation. The nodes define the surface: they determine the pixel positions to the last
//! bit, and an image focused on them is exact there. [`Relief::error_m`] states their distance from the source
//! surface (terrain model, ellipsoid).

use std::fmt::Write;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{Axis, GridError};

/// Unit of node heights in metres, so that they have few digits in text. Far below the accuracy of any terrain model.
const UNIT_M: f64 = 1e-4;

/// Maximum number of nodes: 2 MiB, and at most 3.5 MB of text in records and plans.
const MAX_NODES: u64 = Relief::MAX_NODES as u64;

/// Maximum height of the surface above or below its plane in metres.
const HIGHEST_M: f64 = 1e6;

/// Heights above a plane. Copies share the nodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Text", into = "Text")]
pub struct Relief(Arc<Nodes>);

#[derive(Debug, PartialEq)]
struct Nodes {
    surface: String,
    columns: Axis,
    rows: Axis,
    error_m: f64,
    /// Heights row by row.
    heights_m: Vec<f64>,
}

impl Relief {
    /// Maximum number of nodes.
    pub const MAX_NODES: usize = 1 << 18;

    /// Create a relief from heights at nodes, row by row: `columns` along the plane's x axis, `rows` along its y
    /// axis, metres from the grid's origin, at least two of each. `surface` describes the source surface and
    /// `error_m` bounds the distance from it. Heights are rounded to 0.1 mm.
    ///
    /// # Errors
    /// [`GridError`] for too few or too many nodes, or heights that are not finite or exceed 1e6 m.
    pub fn new(
        surface: impl Into<String>,
        [rows, columns]: [Axis; 2],
        mut heights_m: Vec<f64>,
        error_m: f64,
    ) -> Result<Self, GridError> {
        for (name, axis) in [("rows", rows), ("columns", columns)] {
            let sound = axis.count >= 2
                && axis.step > 0.0
                && axis.step.is_finite()
                && [axis.start, axis.at(axis.count)]
                    .iter()
                    .all(|end| end.abs() <= 1e9);
            if !sound {
                return Err(GridError(format!(
                    "relief: {name} of nodes from {} m in steps of {} m, {} in number: expected at least two, a positive step, and no \
                     end beyond 1e9 m are possible",
                    axis.start, axis.step, axis.count
                )));
            }
        }
        let count = rows.count as u64 * columns.count as u64;
        if count > MAX_NODES || count != heights_m.len() as u64 {
            return Err(GridError(format!(
                "relief of {} x {} nodes with {} heights: expected one height per node and at most {MAX_NODES} nodes",
                rows.count,
                columns.count,
                heights_m.len()
            )));
        }
        if let Some(at) = heights_m
            .iter()
            .position(|h| h.is_nan() || h.abs() > HIGHEST_M)
        {
            return Err(GridError(format!(
                "relief: height at node {} of row {} is {}: expected a number of at most {HIGHEST_M:e} m",
                at % columns.count,
                at / columns.count,
                heights_m[at]
            )));
        }
        if !(error_m >= 0.0 && error_m.is_finite()) {
            return Err(GridError(format!(
                "relief: expected an error of 0 m or more, found {error_m} m"
            )));
        }
        for height in &mut heights_m {
            *height = rounded(*height);
        }
        Ok(Self(Arc::new(Nodes {
            surface: surface.into(),
            columns,
            rows,
            error_m,
            heights_m,
        })))
    }

    /// Description of the surface.
    pub fn surface(&self) -> &str {
        &self.0.surface
    }

    /// Maximum distance from the source surface along the plane's normal, metres.
    pub fn error_m(&self) -> f64 {
        self.0.error_m
    }

    /// Nodes along the plane's x axis, metres from the grid's origin.
    pub fn columns(&self) -> Axis {
        self.0.columns
    }

    /// Nodes along the plane's y axis, metres from the grid's origin.
    pub fn rows(&self) -> Axis {
        self.0.rows
    }

    /// Heights above the plane at the nodes, metres, row by row.
    pub fn heights_m(&self) -> &[f64] {
        &self.0.heights_m
    }

    /// Minimum and maximum height above the plane, metres.
    pub fn range_m(&self) -> [f64; 2] {
        let heights = self.0.heights_m.iter();
        heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &h| {
            [low.min(h), high.max(h)]
        })
    }

    /// Bounds on the height over a rectangle of the plane, metres: minimum and maximum of all nodes that affect it.
    pub fn range_over_m(&self, x_m: [f64; 2], y_m: [f64; 2]) -> [f64; 2] {
        let nodes = &*self.0;
        let ends = |axis: &Axis, values: [f64; 2]| {
            let node = |value: f64| {
                let at = (value - axis.start) / axis.step;
                at.max(0.0).min((axis.count - 1) as f64)
            };
            let (first, last) = (node(values[0]).floor(), node(values[1]).ceil());
            first as usize..last as usize + 1
        };
        let (columns, rows) = (ends(&nodes.columns, x_m), ends(&nodes.rows, y_m));
        let mut range_m = [f64::INFINITY, f64::NEG_INFINITY];
        for row in rows {
            let line = &nodes.heights_m[row * nodes.columns.count..][columns.clone()];
            for &height_m in line {
                range_m = [range_m[0].min(height_m), range_m[1].max(height_m)];
            }
        }
        range_m
    }

    /// Height above the plane at a position in the plane, metres.
    #[inline]
    pub fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        self.cell(x_m, y_m).height_m()
    }

    /// Slopes along the plane's x and y axes at a position.
    #[inline]
    pub fn slopes(&self, x_m: f64, y_m: f64) -> [f64; 2] {
        let cell = self.cell(x_m, y_m);
        let [[a, b], [c, d]] = cell.corners_m;
        let [v, u] = cell.at;
        // Outside the nodes the slope along that axis is zero.
        let [along_x, along_y] = cell.within.map(|within| if within { 1.0 } else { 0.0 });
        [
            along_x * ((b - a) * (1.0 - v) + (d - c) * v) / self.0.columns.step,
            along_y * ((c - a) * (1.0 - u) + (d - b) * u) / self.0.rows.step,
        ]
    }

    /// Maximum slope along either axis.
    pub fn steepest(&self) -> f64 {
        let Nodes {
            columns,
            rows,
            heights_m,
            ..
        } = &*self.0;
        let mut steepest = 0.0f64;
        for (i, line) in heights_m.chunks(columns.count).enumerate() {
            for (j, height) in line.iter().enumerate() {
                if j > 0 {
                    steepest = steepest.max((height - line[j - 1]).abs() / columns.step);
                }
                if i > 0 {
                    let below = heights_m[(i - 1) * columns.count + j];
                    steepest = steepest.max((height - below).abs() / rows.step);
                }
            }
        }
        steepest
    }

    #[inline]
    fn cell(&self, x_m: f64, y_m: f64) -> Cell {
        let nodes = &*self.0;
        let place = |axis: &Axis, value: f64| {
            let at = (value - axis.start) / axis.step;
            let last = (axis.count - 1) as f64;
            // NaN counts as the first node.
            let held = at.max(0.0).min(last);
            let first = (held as usize).min(axis.count - 2);
            (first, held - first as f64, at == held)
        };
        let (column, u, within_x) = place(&nodes.columns, x_m);
        let (row, v, within_y) = place(&nodes.rows, y_m);
        let first = row * nodes.columns.count + column;
        let pair = |at: usize| [nodes.heights_m[at], nodes.heights_m[at + 1]];
        Cell {
            corners_m: [pair(first), pair(first + nodes.columns.count)],
            at: [v, u],
            within: [within_x, within_y],
        }
    }
}

/// Four nodes around a position.
struct Cell {
    corners_m: [[f64; 2]; 2],
    /// Position between the nodes, 0 to 1, along the axes of rows and columns.
    at: [f64; 2],
    /// Whether the position is within the nodes along x and y.
    within: [bool; 2],
}

impl Cell {
    #[inline]
    fn height_m(&self) -> f64 {
        let [[a, b], [c, d]] = self.corners_m;
        let [v, u] = self.at;
        let (low, high) = (a + (b - a) * u, c + (d - c) * u);
        low + (high - low) * v
    }
}

/// Round a height to the unit of the text form.
fn rounded(height_m: f64) -> f64 {
    // Division by a whole number gives the float64 nearest to the decimal number; adding zero turns -0 into 0.
    (height_m / UNIT_M).round() / (1.0 / UNIT_M).round() + 0.0
}

/// Text form with one line of numbers per row of nodes.
#[derive(Serialize, Deserialize)]
struct Text {
    surface: String,
    error_m: f64,
    columns: Axis,
    rows: Axis,
    heights_m: Vec<String>,
}

impl From<Relief> for Text {
    fn from(relief: Relief) -> Self {
        let nodes = &*relief.0;
        let line = |heights: &[f64]| {
            let mut text = String::with_capacity(8 * heights.len());
            for (i, height) in heights.iter().enumerate() {
                let gap = if i > 0 { " " } else { "" };
                write!(text, "{gap}{height}").expect("text takes any text");
            }
            text
        };
        Self {
            surface: nodes.surface.clone(),
            error_m: nodes.error_m,
            columns: nodes.columns,
            rows: nodes.rows,
            heights_m: nodes
                .heights_m
                .chunks(nodes.columns.count)
                .map(line)
                .collect(),
        }
    }
}

impl TryFrom<Text> for Relief {
    type Error = GridError;

    fn try_from(text: Text) -> Result<Self, GridError> {
        let mut heights_m = Vec::new();
        for (row, line) in text.heights_m.iter().enumerate() {
            let before = heights_m.len();
            for number in line.split_ascii_whitespace() {
                let height = number.parse::<f64>().map_err(|_| {
                    GridError(format!(
                        "relief: row {row}: expected a number, found '{number}'"
                    ))
                })?;
                heights_m.push(height);
            }
            let found = heights_m.len() - before;
            if found != text.columns.count {
                return Err(GridError(format!(
                    "relief: row {row}: expected {} heights, found {found}",
                    text.columns.count
                )));
            }
        }
        Self::new(
            text.surface,
            [text.rows, text.columns],
            heights_m,
            text.error_m,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(start: f64, step: f64, count: usize) -> Axis {
        Axis { start, step, count }
    }

    /// A bilinear function is reproduced everywhere, slopes included.
    #[test]
    fn bilinear_surface_is_reproduced() {
        let [rows, columns] = [axis(-4.0, 2.0, 6), axis(1.0, 0.5, 5)];
        let height = |x: f64, y: f64| 3.0 + 0.5 * x - 0.25 * y + 0.125 * x * y;
        let heights = (0..6)
            .flat_map(|row| (0..5).map(move |column| height(columns.at(column), rows.at(row))))
            .collect();
        let relief = Relief::new("test", [rows, columns], heights, 0.0).unwrap();
        for (x, y) in [(1.0, -4.0), (1.3, 0.7), (2.99, 5.9), (3.0, 6.0)] {
            assert!((relief.height_m(x, y) - height(x, y)).abs() < 1e-12);
        }
        let [along_x, along_y] = relief.slopes(1.3, 0.7);
        assert!((along_x - (0.5 + 0.125 * 0.7)).abs() < 1e-12);
        assert!((along_y - (-0.25 + 0.125 * 1.3)).abs() < 1e-12);
        // Constant extrapolation.
        assert_eq!(relief.height_m(99.0, 6.0), relief.height_m(3.0, 6.0));
        assert_eq!(relief.slopes(99.0, 0.7)[0], 0.0);
        assert_eq!(
            relief.height_m(f64::NAN, f64::NAN),
            relief.height_m(1.0, -4.0)
        );
    }

    #[test]
    fn damaged_nodes_are_refused() {
        let make = |rows: Axis, columns: Axis, heights: Vec<f64>| {
            Relief::new("test", [rows, columns], heights, 0.0)
                .map(drop)
                .unwrap_err()
                .to_string()
        };
        let two = axis(0.0, 1.0, 2);
        assert!(make(axis(0.0, 1.0, 1), two, vec![0.0; 2]).contains("at least two"));
        assert!(make(axis(0.0, -1.0, 2), two, vec![0.0; 4]).contains("positive step"));
        assert!(make(two, two, vec![0.0; 3]).contains("3 heights"));
        assert!(make(two, two, vec![0.0, f64::NAN, 0.0, 0.0]).contains("node 1 of row 0"));
        assert!(make(two, two, vec![0.0, 0.0, 0.0, 1e7]).contains("node 1 of row 1"));
    }
}
