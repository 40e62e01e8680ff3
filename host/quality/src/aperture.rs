//! Mapping from an image's spatial frequencies to its aperture, for [`crate::sub_aperture`].
//!
//! The cross-range spectrum of an image is its aperture. After multiplication of each pixel by the conjugate phase of its path from the aperture's centre, the
//! contribution of a pulse at angle `a` off the centre has the cross-range spatial frequency `2 a / lambda` everywhere in the image. A fraction of the aperture is 0 to 1, clockwise about
//! the scene seen from the side of the grid's normal; for a forward-looking radar, from right to left. The image does not contain the time order.
//!
//! In an image from other software the aperture lies along columns, as in SICD, centred at the mean frequency of the whole image.
//!
//! **Neglected.** Cross-range frequencies scale with the carrier: at the band edges, fractions are off by half the relative bandwidth times their distance from the centre.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Image, ImageSource, ImageSourceError, PixelBlock};

use crate::response::{Carrier, Geometry};

/// Rows and columns of the windows that the mean frequency is measured in, and their maximum number along each axis.
const SAMPLE_SIDE: usize = 64;
const MAX_SAMPLES: usize = 16;

/// Mapping from an image's spatial frequencies to its aperture.
#[derive(Clone, Debug)]
pub struct Aperture {
    mapping: Mapping,
    /// Weights along the aperture, evenly spaced; empty if uniform or unknown.
    weights: Vec<f64>,
}

#[derive(Clone, Debug)]
enum Mapping {
    /// Along cross-range.
    Seen {
        carrier: Carrier,
        /// Bandwidth of the whole aperture, cycles per metre.
        width: f64,
    },
    /// Along columns, about the mean frequency.
    Columns {
        /// Bandwidth of the whole aperture, cycles per pixel.
        width: f64,
        /// Mean frequency of the image, cycles per pixel.
        centre: f64,
    },
}

/// Centre and scale of the aperture's frequencies at a node.
pub(crate) struct Band {
    /// Centre frequency, cycles per row and per column.
    pub(crate) centre: [f64; 2],
    /// Fraction of the aperture per cycle per row and per cycle per column.
    pub(crate) across: [f64; 2],
}

impl Aperture {
    /// Aperture of an image on a Cartesian grid, from the geometry of its record. `None` for a polar grid, or an aperture of 90 degrees or more, whose spectrum is no line.
    pub fn seen(seen: &Geometry, grid: &ImageGrid) -> Option<Self> {
        let angle = seen.aperture_angle_deg.to_radians();
        let sound = angle > 0.0 && angle < std::f64::consts::FRAC_PI_2 && seen.wavelength_m > 0.0;
        (sound && !grid.polar).then(|| Self {
            mapping: Mapping::Seen {
                carrier: Carrier::of(seen),
                width: 4.0 * libm::sin(angle / 2.0) / seen.wavelength_m,
            },
            weights: Vec::new(),
        })
    }

    /// Aperture of `image` along columns with a bandwidth of `width` cycles per pixel, about the mean frequency, which is measured in at most 256
    /// windows of the image. `None` if `width` is not valid.
    ///
    /// # Errors
    /// [`ImageSourceError`] if the image cannot be read.
    pub fn columns(width: f64, image: &dyn ImageSource) -> Result<Option<Self>, ImageSourceError> {
        if !(width > 0.0 && width <= 1.0) {
            return Ok(None);
        }
        Ok(Some(Self {
            mapping: Mapping::Columns {
                width,
                centre: middle_frequency(image)?,
            },
            weights: Vec::new(),
        }))
    }

    /// Set the slow-time weights of the pulses, evenly spaced over the aperture. Sub-apertures are scaled to the level that uniform weights would give.
    pub fn weighted(mut self, weights: Vec<f64>) -> Self {
        self.weights = weights;
        self
    }

    /// Weights along the aperture, evenly spaced; empty if uniform or unknown.
    pub(crate) fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Whether the mapping is the same at every pixel.
    pub(crate) fn is_uniform(&self) -> bool {
        matches!(self.mapping, Mapping::Columns { .. })
    }

    /// Frequencies of the aperture at a node; `None` where the aperture is unknown.
    pub(crate) fn band(&self, grid: &ImageGrid, node: [usize; 2]) -> Option<Band> {
        match &self.mapping {
            Mapping::Seen { carrier, width } => {
                let row_value = grid.rows.start + node[0] as f64 * grid.rows.step;
                let column_value = grid.columns.start + node[1] as f64 * grid.columns.step;
                // Without the phase gradient per pixel, the centre is unknown too.
                carrier.turn(grid, row_value, column_value)?;
                let sight = carrier.antenna_m - grid.point_m(row_value, column_value);
                let (x, y) = (sight.dot(grid.x_axis), sight.dot(grid.y_axis));
                let flat = libm::hypot(x, y);
                // No cross-range direction for a vertical line of sight.
                (flat >= 1e-3 * sight.length()).then(|| Band {
                    centre: [0.0; 2],
                    across: [
                        x / flat / grid.rows.step / width,
                        -y / flat / grid.columns.step / width,
                    ],
                })
            }
            Mapping::Columns { width, centre } => Some(Band {
                centre: [0.0, *centre],
                across: [0.0, 1.0 / width],
            }),
        }
    }

    /// Read a window of the image without non-finite pixels, and without the path phase to the aperture's centre where it is known.
    pub(crate) fn window(
        &self,
        image: &dyn ImageSource,
        grid: &ImageGrid,
        place: &PixelBlock,
    ) -> Result<Image, ImageSourceError> {
        let mut window = finite_window(image, place)?;
        if let Mapping::Seen { carrier, .. } = &self.mapping {
            take_off(carrier, grid, place, &mut window);
        }
        Ok(window)
    }
}

/// Multiply each pixel by the conjugate two-way path phase from the aperture's centre.
fn take_off(carrier: &Carrier, grid: &ImageGrid, [rows, columns]: &PixelBlock, patch: &mut Image) {
    let lines = patch.pixels.chunks_exact_mut(columns.len().max(1));
    for (row, line) in rows.clone().zip(lines) {
        for (column, z) in columns.clone().zip(line) {
            let range_m = grid.position_m(row, column).distance(carrier.antenna_m);
            let turns = 2.0 * range_m / carrier.wavelength_m;
            let (sin, cos) = libm::sincosf((TAU * (turns - turns.round())) as f32);
            *z *= Complex32::new(cos, -sin);
        }
    }
}

/// Mean frequency of an image along columns, cycles per pixel: circular mean of the phase step, over the whole of a small image or over windows spread evenly.
fn middle_frequency(image: &dyn ImageSource) -> Result<f64, ImageSourceError> {
    let (rows, columns) = image.size();
    let starts = |count: usize| {
        let windows = count.div_ceil(SAMPLE_SIDE).min(MAX_SAMPLES);
        let last = count - SAMPLE_SIDE.min(count);
        (0..windows).map(move |k| last * k / (windows - 1).max(1))
    };
    let mut sum = Complex64::ZERO;
    for row in starts(rows) {
        for column in starts(columns) {
            let place = [
                row..(row + SAMPLE_SIDE).min(rows),
                column..(column + SAMPLE_SIDE).min(columns),
            ];
            let sample = finite_window(image, &place)?;
            for line in sample.pixels.chunks_exact(sample.columns.max(1)) {
                for pair in line.windows(2) {
                    let product = pair[1] * pair[0].conj();
                    sum += Complex64::new(product.re.into(), product.im.into());
                }
            }
        }
    }
    Ok(sum.arg() / TAU)
}

/// Read a window with 0 for non-finite pixels, which would spoil the whole of a transform.
fn finite_window(image: &dyn ImageSource, place: &PixelBlock) -> Result<Image, ImageSourceError> {
    let mut window = image.window(place)?;
    for z in window.pixels.iter_mut().filter(|z| !z.is_finite()) {
        *z = Complex32::ZERO;
    }
    Ok(window)
}
