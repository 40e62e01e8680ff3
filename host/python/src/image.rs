//! Complex images: formed ones, and images of files.

use std::path::PathBuf;

use num_complex::Complex32;
use numpy::ndarray::ArrayView2;
use numpy::{PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use serde_json::{Value, json};
use subaperture::FocusedImage;
use subaperture::geometry::{Extent, ImageGrid, SceneFrame};
use subaperture::image::{Comparison, Image as Pixels, ImageSource};
use subaperture::images::{OpenImage, Reading};
use subaperture::plot::{Panel, quicklook};
use subaperture::quality::response::{Response, Settings, Target, measure};
use subaperture::quality::statistics::{Region, Statistics};

use crate::convert::{self, Memory, memory_bytes};
use crate::errors::{Class, Error};
use crate::grid::{Grid, described};
use crate::work;

/// Complex image with its grid and record.
#[pyclass(frozen, module = "subaperture")]
pub(crate) struct Image(Source);

enum Source {
    Formed(Box<FocusedImage>),
    File(Box<FromFile>),
}

/// Image of a file, in memory.
struct FromFile {
    pixels: Pixels,
    opened: OpenImage,
}

impl Image {
    pub(crate) fn formed(image: FocusedImage) -> Self {
        Self(Source::Formed(Box::new(image)))
    }

    pub(crate) fn pixels(&self) -> &Pixels {
        match &self.0 {
            Source::Formed(image) => &image.image,
            Source::File(file) => &file.pixels,
        }
    }

    fn image_grid(&self) -> Option<ImageGrid> {
        match &self.0 {
            Source::Formed(image) => Some(image.grid.clone()),
            Source::File(file) => file.opened.grid().map(|(grid, _)| grid.clone()),
        }
    }

    /// Grid, or pixels counted from 0 in rows and columns.
    fn grid_or_pixels(&self) -> ImageGrid {
        match &self.0 {
            Source::Formed(image) => image.grid.clone(),
            Source::File(file) => file.opened.pixel_grid(),
        }
    }

    fn frame(&self) -> Option<SceneFrame> {
        match &self.0 {
            Source::Formed(image) => Some(image.frame),
            Source::File(file) => file.opened.grid().and_then(|(_, frame)| frame),
        }
    }

    fn response(&self, target: Target) -> Result<Response, Error> {
        Ok(match &self.0 {
            Source::Formed(image) => image.measure(target)?,
            Source::File(file) => {
                let looks = file.opened.looks();
                let settings = Settings {
                    looks: looks.as_ref(),
                    ..Settings::default()
                };
                measure(&file.pixels, &file.opened.pixel_grid(), target, &settings)?
            }
        })
    }
}

/// Read an image of any format into memory.
#[pyfunction]
#[pyo3(signature = (path, *, memory=None))]
pub(crate) fn read_image(
    py: Python<'_>,
    path: PathBuf,
    memory: Option<Memory>,
) -> Result<Image, Error> {
    let limit_bytes = memory_bytes(memory)?;
    let file = work::run(py, None, |_| {
        let opened = OpenImage::open(&path, &Reading::default())?;
        let (rows, columns) = opened.pixels.size();
        let needed_bytes = 8 * rows as u64 * columns as u64;
        if needed_bytes > limit_bytes {
            return Err(Error::new(
                Class::Memory,
                format!(
                    "{}: {rows} x {columns} pixels need {needed_bytes} bytes of the {limit_bytes} allowed; raise memory",
                    path.display()
                ),
            ));
        }
        let pixels = opened
            .pixels
            .window(&[0..rows, 0..columns])
            .map_err(|error| Error::new(Class::Read, error))?;
        Ok(FromFile { pixels, opened })
    })?;
    Ok(Image(Source::File(Box::new(file))))
}

#[pymethods]
impl Image {
    /// Pixels as a read-only complex64 array of rows x columns, without a copy. Row 0 has the smallest y, column 0 the smallest x.
    #[getter]
    fn array<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<Complex32>>> {
        let pixels = slf.get().pixels();
        let view = ArrayView2::from_shape((pixels.rows, pixels.columns), &pixels.pixels);
        let view = view.expect("as many pixels as rows x columns");
        // SAFETY: the array keeps a reference to the image, whose pixels neither move nor change: the class is frozen, and no method
        // replaces them. The array is read-only.
        #[allow(unsafe_code, reason = "an array without a copy of the pixels")]
        let array = unsafe { PyArray2::borrow_from_array(&view, slf.clone().into_any()) };
        array.readwrite().make_nonwriteable();
        Ok(array)
    }

    /// Numbers of rows and columns.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.pixels().rows, self.pixels().columns)
    }

    /// Grid of the pixels; None if unknown.
    #[getter]
    fn grid(&self) -> Option<Grid> {
        self.image_grid().map(|grid| Grid { grid })
    }

    /// Latitude and longitude (degrees) and height (metres) of the origin; None if unknown.
    #[getter]
    fn origin_deg_m(&self) -> Option<(f64, f64, f64)> {
        let origin = self.frame()?.geodetic(subaperture::glam::DVec3::ZERO)?;
        Some((origin.latitude_deg, origin.longitude_deg, origin.height_m))
    }

    /// Title for plots: recording and former.
    #[getter]
    fn title(&self) -> String {
        match &self.0 {
            Source::Formed(image) => image.title(),
            Source::File(file) => file.opened.path.display().to_string(),
        }
    }

    /// Predicted relative RMS error against the exact sum, dB; None for an image of a file.
    #[getter]
    fn predicted_error_db(&self) -> Option<f64> {
        match &self.0 {
            Source::Formed(image) => Some(image.predicted_error_db),
            Source::File(_) => None,
        }
    }

    /// Whether the predicted error exceeds the error bound.
    #[getter]
    fn bound_missed(&self) -> bool {
        match &self.0 {
            Source::Formed(image) => image.bound_missed,
            Source::File(_) => false,
        }
    }

    /// Warnings about the quality of the image, one sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        match &self.0 {
            Source::Formed(image) => image.warnings.clone(),
            Source::File(_) => Vec::new(),
        }
    }

    /// Record of the image: recording, settings, grid, checksums; None if unknown.
    #[getter]
    fn record<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let record = match &self.0 {
            Source::Formed(image) => image.record(),
            Source::File(file) => file.opened.record.clone().unwrap_or(Value::Null),
        };
        convert::object(py, &record)
    }

    /// Measure a point target: position, 3 dB width, PSLR, ISLR, level and phase.
    ///
    /// Parameters
    /// ----------
    /// x, y : float, optional
    ///     Approximate position, metres. Default: the brightest pixel.
    ///
    /// Returns
    /// -------
    /// dict
    ///     ``position_m``, ``level_db``, ``phase_rad`` and ``cuts`` along x and y with ``width_3db`` and side lobes.
    ///
    /// Raises
    /// ------
    /// MeasurementError
    ///     If no point stands out, or it is too near the border.
    #[pyo3(signature = (x=None, y=None))]
    fn measure<'py>(
        &self,
        py: Python<'py>,
        x: Option<f64>,
        y: Option<f64>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let target = match (x, y) {
            (None, None) => Target::Brightest,
            (Some(column_value), Some(row_value)) => Target::Near {
                column_value,
                row_value,
            },
            _ => {
                return Err(Error::argument(
                    "measure: expected x and y, or neither for the brightest pixel",
                ));
            }
        };
        let response = work::run(py, None, |_| self.response(target))?;
        Ok(convert::object(py, &json!(response))?)
    }

    /// Statistics of the image or of a region: levels in dB, entropy, contrast, sharpness.
    ///
    /// Parameters
    /// ----------
    /// extent : sequence of 4 floats, optional
    ///     Minimum and maximum x, minimum and maximum y, metres. Default: the whole image.
    #[pyo3(signature = (extent=None))]
    fn statistics<'py>(
        &self,
        py: Python<'py>,
        extent: Option<[f64; 4]>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let region = match extent {
            None => Region::whole(self.pixels()),
            Some([x_min, x_max, y_min, y_max]) => {
                let extent = Extent {
                    x_m: (x_min, x_max),
                    y_m: (y_min, y_max),
                };
                Region::within(&extent, &self.grid_or_pixels()).map_err(Error::argument)?
            }
        };
        let statistics = work::run(py, None, |_| Ok(Statistics::of(self.pixels(), &region)))?;
        Ok(convert::object(py, &json!(statistics))?)
    }

    /// Write ``image.npy``, ``image.json`` and ``image.png`` to a folder, all or none. ``subap`` measures, compares and exports them.
    ///
    /// Files of other programs are never replaced.
    fn save(&self, py: Python<'_>, folder: PathBuf) -> Result<(), Error> {
        let Source::Formed(image) = &self.0 else {
            return Err(Error::argument(
                "save: expected an image from focus, found one that was read from a file",
            ));
        };
        work::run(py, None, |_| {
            image
                .save(&folder)
                .map_err(|error| Error::new(Class::Write, error))
        })
    }

    /// Picture of the level in dB, as the bytes of a PNG.
    fn png<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyBytes>, Error> {
        let drawn = work::run(py, None, |_| match &self.0 {
            Source::Formed(image) => Ok(image.picture()?),
            Source::File(file) => {
                let grid = file.opened.pixel_grid();
                Ok(quicklook(&Panel::new(&file.pixels, &grid, self.title()))?)
            }
        })?;
        Ok(PyBytes::new(py, &drawn))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyBytes>, Error> {
        self.png(py)
    }

    /// Draw the level with Matplotlib.
    ///
    /// Parameters
    /// ----------
    /// ax : matplotlib.axes.Axes, optional
    ///     Axes to draw in. Default: the current ones.
    /// dynamic_range_db : float
    ///     Range of levels below the brightest pixel, dB.
    /// **options
    ///     Options of ``Axes.imshow``.
    ///
    /// Returns
    /// -------
    /// matplotlib.axes.Axes
    #[pyo3(signature = (ax=None, **options))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        ax: Option<Bound<'py, PyAny>>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let display = slf.py().import("subaperture._display")?;
        display.call_method("plot", (slf, ax), options)
    }

    /// Image as an ``xarray.DataArray`` with coordinates, units and attributes.
    fn to_xarray<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let display = slf.py().import("subaperture._display")?;
        display.call_method1("to_xarray", (slf,))
    }

    fn __repr__(&self) -> String {
        let (rows, columns) = self.shape();
        format!("<Image '{}': {rows} x {columns} pixels>", self.title())
    }
}

/// Compare two images on the same pixels.
#[pyfunction]
pub(crate) fn compare_images<'py>(
    py: Python<'py>,
    image: &Image,
    reference: &Image,
) -> Result<Bound<'py, PyAny>, Error> {
    let comparison = work::run(py, None, |_| {
        if let (Source::File(a), Source::File(b)) = (&image.0, &reference.0) {
            return Ok(subaperture::images::compare(&a.opened, &b.opened)?.comparison);
        }
        if let (Some(a), Some(b)) = (image.image_grid(), reference.image_grid())
            && a != b
        {
            return Err(Error::argument(format!(
                "compare: expected images on one grid, found {} and {}: form both on one grid, or save both and compare the files",
                described(&a),
                described(&b)
            )));
        }
        Comparison::between(image.pixels(), reference.pixels()).map_err(Error::argument)
    })?;
    Ok(convert::object(py, &json!(comparison))?)
}
