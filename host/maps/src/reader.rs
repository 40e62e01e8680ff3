//! Windowed-sinc interpolation of an image, shared by maps ([`crate::Ortho`]) and resampling ([`crate::Resampled`]).
//!
//! The carrier is removed ([`crate::carrier`]), a windowed sinc of 6 to 16 taps interpolates, and the carrier is restored at the interpolated position. The
//! number of taps is the smallest whose relative RMS error is below -60 dB for the image's bandwidth ([`WindowedSinc::error`]).

use std::f64::consts::TAU;
use std::ops::Mul;

use num_complex::Complex32;
use rayon::prelude::*;

use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{ImageSource, PixelBlock};
use subaperture_signal::windowed_sinc::{TAPS, WindowedSinc};

use crate::carrier::Carrier;
use crate::surface::Surface;
use crate::{MapError, ProjectionModel};

/// Target interpolation error: -60 dB.
const ERROR: f64 = 1e-3;

/// Image with surface, spectrum and interpolation kernel.
#[derive(Debug)]
pub(crate) struct Reader<'a> {
    pub(crate) pixels: &'a dyn ImageSource,
    pub(crate) surface: Surface<'a>,
    spectrum: Spectrum<'a>,
    /// Half-bandwidth, cycles per row and per column.
    band: [f64; 2],
    kernel: WindowedSinc,
}

impl<'a> Reader<'a> {
    /// Interpolator of an image on a grid, after removal of a carrier.
    pub(crate) fn carried(
        pixels: &'a dyn ImageSource,
        surface: Surface<'a>,
        carrier: Carrier,
        grid: &'a ImageGrid,
    ) -> Self {
        let band = carrier.band;
        Self::of(pixels, surface, Spectrum::Carried(carrier, grid), band)
    }

    /// Interpolator of an image whose metadata give its spectrum.
    pub(crate) fn projected(
        pixels: &'a dyn ImageSource,
        surface: Surface<'a>,
        model: &'a dyn ProjectionModel,
    ) -> Self {
        // No kernel exists for half a cycle per pixel and more.
        let band = model.widths().map(|width| (0.5 * width).clamp(0.0, 0.499));
        Self::of(pixels, surface, Spectrum::Stated(model), band)
    }

    /// Reader of the nearest pixel, without interpolation.
    pub(crate) fn nearest(pixels: &'a dyn ImageSource, surface: Surface<'a>) -> Self {
        Self::of(pixels, surface, Spectrum::Unread, [0.0; 2])
    }

    fn of(
        pixels: &'a dyn ImageSource,
        surface: Surface<'a>,
        spectrum: Spectrum<'a>,
        band: [f64; 2],
    ) -> Self {
        let wider = band[0].max(band[1]);
        let kernel = TAPS
            .into_iter()
            .map(|taps| WindowedSinc::new(taps, wider))
            .find(|kernel| error_of(kernel, band) < ERROR)
            .unwrap_or_else(|| WindowedSinc::new(TAPS[TAPS.len() - 1], wider));
        Self {
            pixels,
            surface,
            spectrum,
            band,
            kernel,
        }
    }

    /// Relative RMS error of complex values, dB, for an image that fills its band.
    pub(crate) fn error_db(&self) -> f64 {
        20.0 * libm::log10(error_of(&self.kernel, self.band))
    }

    /// Oversampling factor of rows and columns.
    pub(crate) fn oversampling(&self) -> [f64; 2] {
        self.band.map(|band| 0.5 / band)
    }

    /// Half-length of the kernel, pixels.
    pub(crate) fn reach(&self) -> usize {
        self.kernel.taps() / 2
    }

    /// Window of the image that these samples need; `None` if all lie outside.
    pub(crate) fn window(&self, traced: &[Traced]) -> Option<PixelBlock> {
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

    /// Interpolate at these samples from a window of the image; NaN outside the image.
    pub(crate) fn read(
        &self,
        traced: &[Traced],
        window: &PixelBlock,
    ) -> Result<Vec<Complex32>, MapError> {
        // Shared by threads; the image's file handle is not.
        let (surface, spectrum, kernel) = (&self.surface, &self.spectrum, &self.kernel);
        let mut image = self
            .pixels
            .window(window)
            .map_err(MapError::ImageSource)?
            .pixels;
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
                return NO_VALUE;
            }
            let local = [0, 1].map(|i| traced.pixel[i] - window[i].start as f64);
            let turns = match spectrum {
                Spectrum::Carried(..) => None,
                Spectrum::Unread => {
                    let [row, column] = local.map(|x| x.round().max(0.0) as usize);
                    let at = row * columns.len() + column.min(columns.len() - 1);
                    return image.get(at).copied().unwrap_or(NO_VALUE);
                }
                Spectrum::Stated(model) => Some(model.middle(traced.pixel)),
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

/// Position of an image's spectrum.
#[derive(Debug)]
enum Spectrum<'a> {
    /// About a carrier, for an image on this grid.
    Carried(Carrier, &'a ImageGrid),
    /// Unused: values are those of the nearest pixel.
    Unread,
    /// Stated by the image's metadata.
    Stated(&'a dyn ProjectionModel),
}

/// Value outside the image.
pub(crate) const NO_VALUE: Complex32 = Complex32::new(f32::NAN, f32::NAN);

/// Projected sample: image row and column, and coordinates in the image plane.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Traced {
    pub(crate) pixel: [f64; 2],
    pub(crate) plane: [f64; 2],
}

/// Whether a fractional pixel lies on the image (pixels as areas).
fn inside(pixel: [f64; 2], counts: [usize; 2]) -> bool {
    (0..2).all(|i| pixel[i] >= -0.5 && pixel[i] < counts[i] as f64 - 0.5)
}

/// Combined interpolation error of both axes.
fn error_of(kernel: &WindowedSinc, band: [f64; 2]) -> f64 {
    let [rows, columns] = band.map(|band| kernel.error(band));
    libm::hypot(rows, columns)
}

/// Interpolate at a row and column; zeros outside. `turns` is the carrier, cycles per row and per column.
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

/// Weighted sum of `W` x `W` pixels from `first` on; zeros outside.
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
