//! Pixel grids.

use numpy::PyArray1;
use pyo3::prelude::*;
use subaperture::geometry::{Axis, ImageGrid};

use crate::errors::Error;

/// Pixel grid of an image.
#[pyclass(frozen, eq, module = "subaperture")]
#[derive(Clone, PartialEq)]
pub(crate) struct Grid {
    pub(crate) grid: ImageGrid,
}

/// Grid or its text.
#[derive(FromPyObject)]
pub(crate) enum GridLike<'py> {
    Grid(PyRef<'py, Grid>),
    Text(String),
}

impl GridLike<'_> {
    pub(crate) fn grid(&self) -> Result<ImageGrid, Error> {
        match self {
            Self::Grid(grid) => Ok(grid.grid.clone()),
            Self::Text(text) => parsed(text),
        }
    }
}

fn parsed(text: &str) -> Result<ImageGrid, Error> {
    text.parse()
        .map_err(|error| Error::argument(format!("grid: {error}")))
}

/// Size and extent of a grid.
pub(crate) fn described(grid: &ImageGrid) -> String {
    let [rows, columns] = [&grid.rows, &grid.columns].map(|axis| {
        let last = axis.at(axis.count.saturating_sub(1));
        format!("{} ({} to {last})", axis.count, axis.start)
    });
    let kind = if grid.is_raster() {
        "Cartesian"
    } else {
        "polar"
    };
    format!("<Grid, {kind}: {rows} rows x {columns} columns>")
}

fn values<'py>(py: Python<'py>, axis: &Axis) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_iter(py, (0..axis.count).map(|i| axis.at(i)))
}

#[pymethods]
impl Grid {
    /// Grid of a text, such as ``x=-50:50:0.2,y=-50:50:0.2,z=0`` (start, stop, step in metres).
    #[new]
    fn new(text: &str) -> Result<Self, Error> {
        parsed(text).map(|grid| Self { grid })
    }

    /// Numbers of rows and columns.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.grid.rows.count, self.grid.columns.count)
    }

    /// Values of the rows: y in metres, or range from the pole in metres.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        values(py, &self.grid.rows)
    }

    /// Values of the columns: x in metres, or angle in radians.
    #[getter]
    fn columns<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        values(py, &self.grid.columns)
    }

    /// Whether rows and columns are y and x, not range and angle.
    #[getter]
    fn is_cartesian(&self) -> bool {
        self.grid.is_raster()
    }

    /// Position of a pixel in the scene frame, metres.
    fn position(&self, row: usize, column: usize) -> Result<(f64, f64, f64), Error> {
        let (rows, columns) = self.shape();
        match row < rows && column < columns {
            true => Ok(self.grid.position_m(row, column).into()),
            false => Err(Error::argument(format!(
                "pixel ({row}, {column}): expected a row below {rows} and a column below {columns}"
            ))),
        }
    }

    fn __repr__(&self) -> String {
        described(&self.grid)
    }
}
