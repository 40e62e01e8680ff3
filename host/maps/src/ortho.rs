//! Orthorectification: interpolation of an image at the pixels of a map.
//!
//! Every sample of a map (a pixel, or a sub-pixel where map pixels are coarser than the image's) is projected to the focusing surface
//! ([`crate::surface`]): exactly at 3 x 3 positions of a patch and by parabolas between them, with an error below 1e-4 pixel on patches of 256; on a relief
//! every sample exactly. A windowed sinc of 6 to 16 taps interpolates the image there after carrier removal ([`crate::carrier`]).
//!
//! **Error** of complex values, relative RMS: below -60 dB for the image's own bandwidth, by the number of taps ([`crate::reader`]); more where 16 taps are too few.
//! [`Ortho::error_db`] gives it. Within the kernel's half-length of the edge the image is extended with zeros.
//! **Cost** per pixel: 72 to 512 multiply-adds, and one carrier phasor per image pixel.

use std::ops::Range;

use num_complex::Complex32;
use rayon::prelude::*;

use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::{ImageSource, PixelBlock, power};
use subaperture_model::resolution::support::Looks;

use crate::carrier::Carrier;
use crate::reader::{NO_VALUE, Reader, Traced};
use crate::surface::Surface;
use crate::{MapError, ProjectionModel, Raster};

/// Samples per side of a patch.
const PATCH: usize = 256;
/// Smallest patch, used where the projection changes quickly, as near the pole of a polar grid.
const MIN_PATCH: usize = 8;
/// Image pixels per sample above which a patch is subdivided.
const MAX_READ: usize = 16;

/// Image with its geometry.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// Complex pixels.
    pub pixels: &'a dyn ImageSource,
    /// Grid of the pixels.
    pub grid: &'a ImageGrid,
    /// Frame of the grid.
    pub frame: &'a SceneFrame,
    /// Antenna positions and bands of the aperture.
    pub looks: &'a Looks,
}

/// Image resampled to a map raster.
#[derive(Debug)]
pub struct Ortho<'a> {
    reader: Reader<'a>,
    pub(crate) raster: Raster,
    /// Samples per side of a map pixel.
    fine: usize,
}

impl<'a> Ortho<'a> {
    /// Prepare the resampling of an image to a raster.
    ///
    /// # Errors
    /// [`MapError`] if the grid is vertical or not on the Earth, or the image's bandwidth is unknown or undersampled.
    pub fn new(source: Source<'a>, raster: Raster) -> Result<Self, MapError> {
        let surface = Surface::of_grid(source.grid, source.frame)?;
        let carrier = Carrier::of(source.grid, source.looks)?;
        let reader = Reader::carried(source.pixels, surface, carrier, source.grid);
        Ok(Self::of(reader, raster))
    }

    /// Prepare the resampling of an image that its own metadata project. Complex values are then interpolated samples; their phase reference stays that of the image.
    pub fn with_projection(
        pixels: &'a dyn ImageSource,
        model: &'a dyn ProjectionModel,
        raster: Raster,
    ) -> Self {
        let (rows, columns) = pixels.size();
        let surface = Surface::Projected(model, [rows, columns]);
        Self::of(Reader::projected(pixels, surface, model), raster)
    }

    /// Prepare a map of measures on an image's grid, such as coherence, by the nearest pixel: values without phase or band, which are not interpolated.
    ///
    /// # Errors
    /// [`MapError`] if the grid is vertical or not on the Earth.
    pub fn nearest(
        pixels: &'a dyn ImageSource,
        grid: &ImageGrid,
        frame: &SceneFrame,
        raster: Raster,
    ) -> Result<Self, MapError> {
        let surface = Surface::of_grid(grid, frame)?;
        Ok(Self::of(Reader::nearest(pixels, surface), raster))
    }

    fn of(reader: Reader<'a>, raster: Raster) -> Self {
        Self {
            fine: raster.fine(&reader.surface) as usize,
            reader,
            raster,
        }
    }

    /// Surface of the image's pixels.
    pub(crate) fn surface(&self) -> &Surface<'a> {
        &self.reader.surface
    }

    /// Relative RMS error of complex values, dB, for an image that fills its band.
    pub fn error_db(&self) -> f64 {
        self.reader.error_db()
    }

    /// Oversampling factor of rows and columns: pixel rate over bandwidth.
    pub fn oversampling(&self) -> [f64; 2] {
        self.reader.oversampling()
    }

    /// Samples averaged per map pixel.
    pub fn averaged(&self) -> usize {
        self.fine * self.fine
    }

    /// Source image.
    pub fn pixels(&self) -> &'a dyn ImageSource {
        self.reader.pixels
    }

    /// Target raster.
    pub fn raster(&self) -> &Raster {
        &self.raster
    }

    /// Complex values of a window of the map, row-major; NaN outside the image.
    ///
    /// # Errors
    /// [`MapError::Coarse`] if map pixels are coarser than the image's; [`MapError::ImageSource`] if the image cannot be read.
    pub fn complex(&self, place: &PixelBlock) -> Result<Vec<Complex32>, MapError> {
        if self.fine > 1 {
            return Err(MapError::Coarse {
                pixel_m: self.raster.pixel_m,
                needed_m: self
                    .surface()
                    .steps_m()
                    .into_iter()
                    .fold(f64::INFINITY, f64::min),
            });
        }
        let mut out = vec![NO_VALUE; place[0].len() * place[1].len()];
        let columns = place[1].len();
        self.patches(place, PATCH, &mut |patch, values| {
            for (row, values) in patch[0].clone().zip(values.chunks(patch[1].len())) {
                let at = (row - place[0].start) * columns + patch[1].start - place[1].start;
                out[at..at + values.len()].copy_from_slice(values);
            }
        })?;
        Ok(out)
    }

    /// Mean power of a window of the map, row-major; NaN outside the image.
    ///
    /// # Errors
    /// [`MapError::ImageSource`] if the image cannot be read.
    pub fn powers(&self, place: &PixelBlock) -> Result<Vec<f32>, MapError> {
        let columns = place[1].len();
        let fine = self.fine;
        let mut sums = vec![[0.0f64; 2]; place[0].len() * columns];
        let parts = [0, 1].map(|i| place[i].start * fine..place[i].end * fine);
        self.patches(&parts, PATCH.max(fine), &mut |patch, values| {
            for (row, values) in patch[0].clone().zip(values.chunks(patch[1].len())) {
                let at = (row / fine - place[0].start) * columns;
                for (column, &value) in patch[1].clone().zip(values) {
                    let power = power(value);
                    if power.is_finite() {
                        let sum = &mut sums[at + column / fine - place[1].start];
                        *sum = [sum[0] + power, sum[1] + 1.0];
                    }
                }
            }
        })?;
        // At least half of a pixel's samples must lie on the image.
        let least = 0.5 * self.averaged() as f64;
        let mean = |[sum, count]: [f64; 2]| match count >= least {
            true => (sum / count) as f32,
            false => f32::NAN,
        };
        Ok(sums.into_iter().map(mean).collect())
    }

    /// Pass the samples of a window to `each`, patch by patch.
    fn patches(&self, place: &PixelBlock, side: usize, each: &mut Each) -> Result<(), MapError> {
        for row in place[0].clone().step_by(side) {
            for column in place[1].clone().step_by(side) {
                let patch = [
                    row..(row + side).min(place[0].end),
                    column..(column + side).min(place[1].end),
                ];
                let at = self.pixels_of(&patch);
                let Some(window) = self.reader.window(&at) else {
                    continue;
                };
                let most = MAX_READ * at.len() + PATCH * PATCH;
                if window[0].len() * window[1].len() > most && side > MIN_PATCH {
                    self.patches(&patch, (side / 2).max(MIN_PATCH), each)?;
                } else {
                    each(&patch, &self.reader.read(&at, &window)?);
                }
            }
        }
        Ok(())
    }

    /// Image pixel and surface coordinates of a patch's samples, row-major.
    fn pixels_of(&self, patch: &PixelBlock) -> Vec<Traced> {
        if !self.surface().is_smooth() {
            return self.each_pixel_of(patch);
        }
        let side = 1.0 / self.fine as f64;
        let nodes = |range: &Range<usize>| {
            let (first, last) = (range.start as f64 + 0.5, range.end as f64 - 0.5);
            [first, 0.5 * (first + last), last]
        };
        let [rows, columns] = [nodes(&patch[0]), nodes(&patch[1])];
        let known = rows.map(|row| {
            columns.map(|column| {
                let at = self.raster.coordinates([row * side, column * side]);
                self.surface().on_plane(&self.raster.projection.place(at))
            })
        });
        let weights = |range: &Range<usize>, i: usize| {
            let last = (range.len() - 1) as f64;
            parabola(if last > 0.0 { i as f64 / last } else { 0.0 })
        };
        let along: Vec<[f64; 3]> = (0..patch[1].len()).map(|i| weights(&patch[1], i)).collect();
        let surface = self.surface();
        let mut traced = vec![Traced::default(); patch[0].len() * patch[1].len()];
        traced
            .par_chunks_mut(patch[1].len())
            .enumerate()
            .for_each(|(i, line)| {
                let down = weights(&patch[0], i);
                // Values of this row at the three columns.
                let three = [0, 1, 2].map(|c| {
                    [0, 1].map(|axis| (0..3).map(|r| down[r] * known[r][c][axis]).sum::<f64>())
                });
                for (traced, w) in line.iter_mut().zip(&along) {
                    traced.plane = [0, 1].map(|axis| {
                        w[0] * three[0][axis] + w[1] * three[1][axis] + w[2] * three[2][axis]
                    });
                    traced.pixel = surface.pixel(traced.plane);
                }
            });
        traced
    }

    /// Like [`Self::pixels_of`], with each sample projected exactly.
    fn each_pixel_of(&self, patch: &PixelBlock) -> Vec<Traced> {
        let side = 1.0 / self.fine as f64;
        let columns = patch[1].len();
        // Shared by threads; the image's file handle is not.
        let (raster, surface) = (&self.raster, self.surface());
        let mut traced = vec![Traced::default(); patch[0].len() * columns];
        let lines = traced.par_chunks_mut(columns).zip(patch[0].clone());
        lines.for_each(|(line, row)| {
            for (traced, column) in line.iter_mut().zip(patch[1].clone()) {
                let parts = [row, column].map(|i| (i as f64 + 0.5) * side);
                let place = raster.projection.place(raster.coordinates(parts));
                traced.plane = surface.on_plane(&place);
                traced.pixel = surface.pixel(traced.plane);
            }
        });
        traced
    }
}

/// Receiver of a patch's values.
type Each<'e> = dyn FnMut(&PixelBlock, &[Complex32]) + 'e;

/// Lagrange weights at `t` of the parabola through values at 0, 1/2 and 1.
fn parabola(t: f64) -> [f64; 3] {
    [
        2.0 * (t - 0.5) * (t - 1.0),
        -4.0 * t * (t - 1.0),
        2.0 * t * (t - 0.5),
    ]
}

#[cfg(test)]
mod tests;
