//! An image read where a map's pixels are.
//!
//! Every part of a map (a pixel, or where pixels are coarser than the image's a share of one) is traced to its place on the focusing surface
//! ([`crate::surface`]): exactly at nine places of a patch, between them by parabolas, which leaves less than 1e-4 of a pixel on patches of 256; each exactly where the
//! surface has a relief. There the image, its carrier taken away ([`crate::carrier`]), is read by a windowed sinc of 6 to 16 taps.
//!
//! **Error** of complex values, relative RMS: as many taps are taken as make it less than -60 dB for the image's own band, by
//! [`WindowedSinc::error`]; where 16 are too few, it is more. [`Ortho::error_db`] says it. Within the kernel's reach of the image's edge, zeros are read beyond
//! it. **Cost** a pixel: 72 to 512 products with sums, and of the image the carrier once for each pixel read.

use std::f64::consts::TAU;
use std::ops::{Mul, Range};

use num_complex::Complex32;
use rayon::prelude::*;

use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::{Parts, Place, power};
use subaperture_resolution::support::Looks;
use subaperture_signal::windowed_sinc::{TAPS, WindowedSinc};

use crate::carrier::Carrier;
use crate::surface::Surface;
use crate::{Lying, MapError, Raster};

/// Parts of a patch's side.
const PATCH: usize = 256;
/// The smallest, where an image turns fast, as near a pole.
const LEAST_PATCH: usize = 8;
/// Pixels of the image that a patch may need, for each of its own, before it is cut in smaller ones.
const MOST_READ: usize = 16;
/// Error below which no more taps are taken, -60 dB.
const ERROR: f64 = 1e-3;

/// An image and where it was seen from.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// Its pixels.
    pub pixels: &'a dyn Parts,
    /// Where they are.
    pub grid: &'a ImageGrid,
    /// Where that is.
    pub frame: &'a SceneFrame,
    /// From where it was seen.
    pub looks: &'a Looks,
}

/// An image read on a raster.
#[derive(Debug)]
pub struct Ortho<'a> {
    pixels: &'a dyn Parts,
    pub(crate) raster: Raster,
    pub(crate) surface: Surface<'a>,
    spectrum: Spectrum<'a>,
    /// Half of what the spectrum fills, cycles a row and a column.
    band: [f64; 2],
    kernel: WindowedSinc,
    /// Parts of a pixel's side.
    fine: usize,
}

impl<'a> Ortho<'a> {
    /// Plans it.
    ///
    /// # Errors
    /// [`MapError`].
    pub fn new(source: Source<'a>, raster: Raster) -> Result<Self, MapError> {
        let surface = Surface::of_grid(source.grid, source.frame)?;
        let carrier = Carrier::of(source.grid, source.looks)?;
        let band = carrier.band;
        let spectrum = Spectrum::Carried(carrier, source.grid);
        Ok(Self::of(source.pixels, surface, spectrum, band, raster))
    }

    /// The same of an image whose pixels lie as its own metadata say; complex values are then those of its samples between pixels, whatever their phase refers to.
    pub fn told(pixels: &'a dyn Parts, lying: &'a dyn Lying, raster: Raster) -> Self {
        let (rows, columns) = pixels.size();
        let surface = Surface::Told(lying, [rows, columns]);
        // Wider ones leave no kernel anything to do.
        let band = lying.widths().map(|width| (0.5 * width).clamp(0.0, 0.499));
        Self::of(pixels, surface, Spectrum::Told(lying), band, raster)
    }

    fn of(
        pixels: &'a dyn Parts,
        surface: Surface<'a>,
        spectrum: Spectrum<'a>,
        band: [f64; 2],
        raster: Raster,
    ) -> Self {
        let wider = band[0].max(band[1]);
        let kernel = TAPS
            .into_iter()
            .map(|taps| WindowedSinc::new(taps, wider))
            .find(|kernel| error_of(kernel, band) < ERROR)
            .unwrap_or_else(|| WindowedSinc::new(TAPS[TAPS.len() - 1], wider));
        Self {
            fine: raster.fine(&surface) as usize,
            pixels,
            raster,
            surface,
            spectrum,
            band,
            kernel,
        }
    }

    /// Relative RMS error of complex values, dB, for an image that fills its band.
    pub fn error_db(&self) -> f64 {
        20.0 * libm::log10(error_of(&self.kernel, self.band))
    }

    /// By how much rows and columns of the image are finer than its band needs.
    pub fn oversampling(&self) -> [f64; 2] {
        self.band.map(|band| 0.5 / band)
    }

    /// Values of the image, averaged in one of the map's pixels.
    pub fn averaged(&self) -> usize {
        self.fine * self.fine
    }

    /// The image.
    pub fn pixels(&self) -> &'a dyn Parts {
        self.pixels
    }

    /// The raster.
    pub fn raster(&self) -> &Raster {
        &self.raster
    }

    /// Complex values of some pixels of the map, row-major; NaN where the image is not.
    ///
    /// # Errors
    /// [`MapError::Coarse`], [`MapError::Parts`].
    pub(crate) fn complex(&self, place: &Place) -> Result<Vec<Complex32>, MapError> {
        if self.fine > 1 {
            return Err(MapError::Coarse {
                pixel_m: self.raster.pixel_m,
                needed_m: self
                    .surface
                    .steps_m()
                    .into_iter()
                    .fold(f64::INFINITY, f64::min),
            });
        }
        let mut out = vec![NOTHING; place[0].len() * place[1].len()];
        let columns = place[1].len();
        self.patches(place, PATCH, &mut |patch, values| {
            for (row, values) in patch[0].clone().zip(values.chunks(patch[1].len())) {
                let at = (row - place[0].start) * columns + patch[1].start - place[1].start;
                out[at..at + values.len()].copy_from_slice(values);
            }
        })?;
        Ok(out)
    }

    /// Mean power of some pixels of the map, likewise.
    ///
    /// # Errors
    /// [`MapError::Parts`].
    pub(crate) fn powers(&self, place: &Place) -> Result<Vec<f32>, MapError> {
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
        // A pixel that lies on the image by less than half is none of it.
        let least = 0.5 * self.averaged() as f64;
        let mean = |[sum, count]: [f64; 2]| match count >= least {
            true => (sum / count) as f32,
            false => f32::NAN,
        };
        Ok(sums.into_iter().map(mean).collect())
    }

    /// Hands over the values of all parts of a place, patch by patch.
    fn patches(&self, place: &Place, side: usize, each: &mut Each) -> Result<(), MapError> {
        for row in place[0].clone().step_by(side) {
            for column in place[1].clone().step_by(side) {
                let patch = [
                    row..(row + side).min(place[0].end),
                    column..(column + side).min(place[1].end),
                ];
                let at = self.pixels_of(&patch);
                let Some(window) = self.window(&at) else {
                    continue;
                };
                let most = MOST_READ * at.len() + PATCH * PATCH;
                if window[0].len() * window[1].len() > most && side > LEAST_PATCH {
                    self.patches(&patch, (side / 2).max(LEAST_PATCH), each)?;
                } else {
                    each(&patch, &self.read(&at, &window)?);
                }
            }
        }
        Ok(())
    }

    /// Rows, columns and places on the plane of a patch's parts, row-major.
    fn pixels_of(&self, patch: &Place) -> Vec<Traced> {
        if !self.surface.is_smooth() {
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
                self.surface.on_plane(&self.raster.projection.place(at))
            })
        });
        let weights = |range: &Range<usize>, i: usize| {
            let last = (range.len() - 1) as f64;
            parabola(if last > 0.0 { i as f64 / last } else { 0.0 })
        };
        let along: Vec<[f64; 3]> = (0..patch[1].len()).map(|i| weights(&patch[1], i)).collect();
        let surface = &self.surface;
        let mut traced = vec![Traced::default(); patch[0].len() * patch[1].len()];
        traced
            .par_chunks_mut(patch[1].len())
            .enumerate()
            .for_each(|(i, line)| {
                let down = weights(&patch[0], i);
                // At this row, at the three columns.
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

    /// The same, each traced for itself.
    fn each_pixel_of(&self, patch: &Place) -> Vec<Traced> {
        let side = 1.0 / self.fine as f64;
        let columns = patch[1].len();
        // What is shared by threads; the image's file is not.
        let (raster, surface) = (&self.raster, &self.surface);
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

    /// What of the image is needed for these places, if any of them is on it.
    fn window(&self, traced: &[Traced]) -> Option<Place> {
        let counts = self.surface.counts();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for Traced { pixel, .. } in traced.iter().filter(|traced| inside(traced.pixel, counts)) {
            for i in 0..2 {
                low[i] = low[i].min(pixel[i]);
                high[i] = high[i].max(pixel[i]);
            }
        }
        if low[0] > high[0] {
            return None;
        }
        let half = self.kernel.taps() / 2;
        Some([0, 1].map(|i| {
            let first = (low[i].floor().max(0.0) as usize).saturating_sub(half);
            let last = high[i].ceil() as usize + half + 1;
            first..last.min(counts[i])
        }))
    }

    /// Values at these places, of which this window of the image has all that lie on it.
    fn read(&self, traced: &[Traced], window: &Place) -> Result<Vec<Complex32>, MapError> {
        // What is shared by threads; the image's file is not.
        let (surface, spectrum, kernel) = (&self.surface, &self.spectrum, &self.kernel);
        let mut image = self.pixels.window(window).map_err(MapError::Parts)?.pixels;
        let [rows, columns] = window;
        if let Spectrum::Carried(carrier, grid) = spectrum {
            image
                .par_chunks_mut(columns.len())
                .zip(rows.clone())
                .for_each(|(line, row)| {
                    for (z, column) in line.iter_mut().zip(columns.clone()) {
                        let point = grid.position_m(row, column);
                        *z *= carrier.at(point, [row as f64, column as f64]).conj();
                    }
                });
        }
        let counts = surface.counts();
        let values = |traced: &Traced| {
            if !inside(traced.pixel, counts) {
                return NOTHING;
            }
            let local = [0, 1].map(|i| traced.pixel[i] - window[i].start as f64);
            let turns = match spectrum {
                Spectrum::Carried(..) => None,
                Spectrum::Told(lying) => Some(lying.middle(traced.pixel)),
            };
            let read = match kernel.taps() {
                6 => interpolate::<6>,
                8 => interpolate::<8>,
                10 => interpolate::<10>,
                12 => interpolate::<12>,
                14 => interpolate::<14>,
                _ => interpolate::<16>,
            };
            let value = read(kernel, &image, columns.len(), local, turns);
            match (spectrum, surface) {
                (Spectrum::Carried(carrier, _), Surface::Grid(own)) => {
                    value * carrier.at(own.point_m(traced.plane), traced.pixel)
                }
                _ => value,
            }
        };
        Ok(traced.par_iter().with_min_len(256).map(values).collect())
    }
}

/// Where an image's spectrum is.
#[derive(Debug)]
enum Spectrum<'a> {
    /// About a carrier, of an image on this grid.
    Carried(Carrier, &'a ImageGrid),
    /// Where the image's metadata say.
    Told(&'a dyn Lying),
}

/// What takes the values of a patch.
type Each<'e> = dyn FnMut(&Place, &[Complex32]) + 'e;

const NOTHING: Complex32 = Complex32::new(f32::NAN, f32::NAN);

/// Where a part of the map is: row and column of the image, and on its plane.
#[derive(Clone, Copy, Debug, Default)]
struct Traced {
    pixel: [f64; 2],
    plane: [f64; 2],
}

/// Whether a place is on the image's pixels, as areas.
fn inside(pixel: [f64; 2], counts: [usize; 2]) -> bool {
    (0..2).all(|i| pixel[i] >= -0.5 && pixel[i] < counts[i] as f64 - 0.5)
}

/// Weights of values at 0, 1/2 and 1, for the parabola through them at `t`.
fn parabola(t: f64) -> [f64; 3] {
    [
        2.0 * (t - 0.5) * (t - 1.0),
        -4.0 * t * (t - 1.0),
        2.0 * t * (t - 0.5),
    ]
}

/// Of both axes.
fn error_of(kernel: &WindowedSinc, band: [f64; 2]) -> f64 {
    let [rows, columns] = band.map(|band| kernel.error(band));
    libm::hypot(rows, columns)
}

/// The value at a row and column of these pixels, beyond which are zeros; of samples that turn by so many cycles a row and a column.
#[inline]
fn interpolate<const W: usize>(
    kernel: &WindowedSinc,
    image: &[Complex32],
    columns: usize,
    at: [f64; 2],
    turns: Option<[f64; 2]>,
) -> Complex32 {
    let parts = at.map(|x| x - x.floor());
    let weights = parts.map(|part| kernel.weights::<W>(part as f32));
    let reach = W as isize / 2 - 1;
    let first = at.map(|x| x.floor() as isize - reach);
    match turns {
        None => sum(image, columns, first, weights),
        Some(turns) => {
            let turned = [0, 1].map(|axis| {
                std::array::from_fn::<_, W, _>(|k| {
                    let away = parts[axis] + (reach - k as isize) as f64;
                    let turn = turns[axis] * away;
                    let (sin, cos) = libm::sincos(TAU * (turn - turn.floor()));
                    Complex32::new(cos as f32, sin as f32) * weights[axis][k]
                })
            });
            sum(image, columns, first, turned)
        }
    }
}

/// The weighed sum of `W` rows and columns of these pixels from `first` on, beyond which are zeros.
#[inline]
fn sum<const W: usize, T: Copy>(
    image: &[Complex32],
    columns: usize,
    [first_row, first_column]: [isize; 2],
    [down, along]: [[T; W]; 2],
) -> Complex32
where
    Complex32: Mul<T, Output = Complex32>,
{
    let rows = (image.len() / columns) as isize;
    let mut sum = Complex32::ZERO;
    for (i, weight) in down.into_iter().enumerate() {
        let row = first_row + i as isize;
        if row < 0 || row >= rows {
            continue;
        }
        let line = &image[row as usize * columns..][..columns];
        let mut part = Complex32::ZERO;
        match first_column >= 0 && first_column as usize + W <= columns {
            true => {
                let line = &line[first_column as usize..][..W];
                for (z, w) in line.iter().zip(along) {
                    part += *z * w;
                }
            }
            false => {
                for (k, w) in along.into_iter().enumerate() {
                    let column = first_column + k as isize;
                    if (0..columns as isize).contains(&column) {
                        part += line[column as usize] * w;
                    }
                }
            }
        }
        sum += part * weight;
    }
    sum
}

#[cfg(test)]
mod tests;
