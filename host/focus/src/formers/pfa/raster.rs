//! Non-uniform Fourier sum from arbitrary samples to arbitrary positions: gridding, transform, interpolation.
//!
//! ```text
//! F(x) = sum_s a_s exp(+j 2 pi (K_s - K_0) . x)
//! ```
//!
//! Spectrum: a sample is gridded onto `W x W` cells of a rectangular raster with spacing `dK = 1 / (2 D)`, where `D` is the extent of the
//! image, by the Kaiser-Bessel kernel. By the interpolation property of the kernel
//! ([`KaiserBessel`]) `sum_i phi(kappa - i) exp(j 2 pi i y) = Phi(y) exp(j 2 pi kappa y)`, `|y| <= 1/4`, so
//! dividing by `Phi` at the interpolated position restores the sum. Image: the raster is padded to twice its
//! size, transformed, and interpolated with the same kernel, whose roll-off is divided out of the raster
//! first. Only the half of the transform that contains the image is kept.
//!
//! Arithmetic is float32; the errors are those of [`KaiserBessel::error`] in two directions, twice.

use glam::DVec2;
use num_complex::Complex32;
use rayon::prelude::*;
use subaperture_fft::Transforms;

use super::plane::{self, Extent};
use crate::{FormError, Reason, Remedy};
use subaperture_kernels::gridding::{Band, Line};
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::reading::weighted;
use subaperture_model::monitor::{Monitor, during};
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::kaiser_bessel::KaiserBessel;

/// Names of the stages.
pub(super) const SPREADING: &str = "spreading";
pub(super) const TRANSFORMS: &str = "transforms";

/// Raster rows gridded by one thread at a time; fixed, so that the summation order is fixed.
const ROWS_A_TASK: usize = 32;
/// Relative error of a kernel's table ([`KaiserBessel`]).
const TABLE: f64 = 2e-6;
/// Largest number of cells in one direction; more would not fit any memory in two.
const MAX_CELLS: f64 = 1e8;

/// Spatial frequencies of a pulse's samples: `start + k step`, cycles per metre.
#[derive(Clone, Copy, Debug)]
pub(super) struct Track {
    pub(super) start: DVec2,
    pub(super) step: DVec2,
}

/// One direction of the raster.
#[derive(Clone, Copy, Debug)]
struct RasterAxis {
    /// Spatial frequency of the cell `count / 2`, cycles per metre.
    middle: f64,
    /// Number of cells per cycle per metre.
    cells: f64,
    count: usize,
    /// Length of the transform, cells.
    length: usize,
}

impl RasterAxis {
    fn new(low: f64, high: f64, half_m: f64, taps: usize) -> Result<Self, FormError> {
        let cells = 4.0 * half_m;
        let span = ((high - low) * cells).ceil();
        if span.is_nan() || span > MAX_CELLS {
            let why = format!(
                "the grid, {:.3e} m wide with its distortion, needs {span:.1e} cells of the scene's \
                 spectrum, at most {MAX_CELLS:.0e} are possible",
                2.0 * half_m
            );
            let remedies = [Remedy::SmallerGrid, Remedy::OtherFormer(&["rdbp"])];
            return Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)));
        }
        let count = span as usize + taps + 1;
        Ok(Self {
            middle: (low + high) / 2.0,
            cells,
            count,
            length: fast_length(2 * count),
        })
    }

    fn cell(&self, cycles_m: f64) -> f64 {
        (cycles_m - self.middle) * self.cells + (self.count / 2) as f64
    }

    /// Retained transform values: half of the transform, and the kernel half-width at both ends.
    fn kept(&self, taps: usize) -> usize {
        (self.length / 2 + 2 * taps).min(self.length)
    }

    /// Inverse roll-off of the interpolation kernel.
    fn emphasis(&self, kernel: &KaiserBessel) -> Vec<f32> {
        kernel.emphasis(self.count, self.length)
    }
}

/// Size of the raster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RasterSize {
    /// Number of kernel taps.
    pub(super) taps: usize,
    /// Rows and columns of the spectrum.
    pub(super) cells: [usize; 2],
    /// Transform lengths over rows and columns.
    pub(super) lengths: [usize; 2],
    /// Retained rows and columns of the image.
    pub(super) kept: [usize; 2],
}

impl RasterSize {
    pub(super) fn new(band: plane::Band, extent: Extent, taps: usize) -> Result<Self, FormError> {
        let axes = raster_axes(band, extent, taps)?;
        Ok(Self {
            taps,
            cells: axes.map(|axis| axis.count),
            lengths: axes.map(|axis| axis.length),
            kept: axes.map(|axis| axis.kept(taps)),
        })
    }

    /// Peak memory, bytes: after the transform along one axis, or after both.
    pub(super) fn bytes(&self) -> u128 {
        let [rows, columns] = self.cells.map(|n| n as u128);
        let [kept_rows, kept_columns] = self.kept.map(|n| n as u128);
        8 * (rows * kept_columns + (kept_rows * kept_columns).max(rows * columns))
    }
}

fn raster_axes(
    band: plane::Band,
    extent: Extent,
    taps: usize,
) -> Result<[RasterAxis; 2], FormError> {
    Ok([
        RasterAxis::new(band.low.x, band.high.x, extent.half_m.x, taps)?,
        RasterAxis::new(band.low.y, band.high.y, extent.half_m.y, taps)?,
    ])
}

/// Relative RMS error of gridding and interpolation together with `taps` taps, in two directions each, including tables. At the
/// edge of the extent, where a grid of few pixels lies, it is 3 dB above the mean.
pub(super) fn error(taps: usize) -> f64 {
    2.0 * std::f64::consts::SQRT_2 * libm::hypot(KaiserBessel::new(taps).error(0.25), TABLE)
}

/// Spectrum on a rectangular raster.
pub(super) struct Raster<const W: usize> {
    kernel: KaiserBessel,
    rows: RasterAxis,
    columns: RasterAxis,
    /// Real and imaginary parts, row by row.
    values: Vec<f32>,
}

impl<const W: usize> Raster<W> {
    /// Empty raster; its memory is at most [`RasterSize::bytes`].
    pub(super) fn new(band: plane::Band, extent: Extent) -> Result<Self, FormError> {
        let [rows, columns] = raster_axes(band, extent, W)?;
        Ok(Self {
            kernel: KaiserBessel::new(W),
            rows,
            columns,
            values: vec![0.0; 2 * rows.count * columns.count],
        })
    }

    /// Grid the samples of a block of pulses, `samples` pulse by pulse.
    pub(super) fn spread(
        &mut self,
        tracks: &[Track],
        samples: &[Complex32],
        monitor: &dyn Monitor,
    ) {
        let num_samples = samples.len() / tracks.len();
        let (rows, columns, kernel) = (self.rows, self.columns, &self.kernel);
        let line = |track: &Track| Line {
            start: [rows.cell(track.start.x), columns.cell(track.start.y)],
            step: [track.step.x * rows.cells, track.step.y * columns.cells],
        };
        let lines: Vec<Line> = tracks.iter().map(line).collect();
        let instructions = Instructions::best();
        self.values
            .par_chunks_mut(2 * ROWS_A_TASK * columns.count)
            .enumerate()
            .for_each(|(task, cells)| {
                let _spreading = during(monitor, SPREADING);
                let mut band = Band {
                    first_row: task * ROWS_A_TASK,
                    columns: columns.count,
                    cells,
                };
                for (line, pulse) in lines.iter().zip(samples.chunks_exact(num_samples)) {
                    band.spread::<W>(instructions, kernel, line, pulse);
                }
            });
    }

    /// Transform the spectrum to the image.
    pub(super) fn transform(self, transforms: Transforms, monitor: &dyn Monitor) -> Readable<W> {
        let Self {
            kernel,
            rows,
            columns,
            values,
        } = self;
        let (kept_rows, kept_columns) = (rows.kept(W), columns.kept(W));
        // Transform along rows, with pre-emphasis in both directions.
        let fft = transforms.inverse(columns.length);
        let (row_emphasis, column_emphasis) = (rows.emphasis(&kernel), columns.emphasis(&kernel));
        let mut half = vec![Complex32::ZERO; rows.count * kept_columns];
        half.par_chunks_exact_mut(kept_columns)
            .zip(values.par_chunks_exact(2 * columns.count))
            .zip(&row_emphasis)
            .for_each_init(
                || {
                    let scratch = fft.get_inplace_scratch_len();
                    let buffer = vec![Complex32::ZERO; columns.length + scratch];
                    (buffer, during(monitor, TRANSFORMS))
                },
                |(buffer, _), ((out, row), row_weight)| {
                    let (line, scratch) = buffer.split_at_mut(columns.length);
                    line.fill(Complex32::ZERO);
                    let (cells, _) = row.as_chunks();
                    for (i, ([re, im], w)) in cells.iter().zip(&column_emphasis).enumerate() {
                        line[(i + columns.length - columns.count / 2) % columns.length] =
                            Complex32::new(*re, *im) * (w * row_weight);
                    }
                    fft.process_with_scratch(line, scratch);
                    for (b, z) in out.iter_mut().enumerate() {
                        *z = line[(b + columns.length - kept_columns / 2) % columns.length];
                    }
                },
            );
        drop(values);
        // Transform along columns; the result is stored column by column.
        let fft = transforms.inverse(rows.length);
        let mut image = vec![Complex32::ZERO; kept_columns * kept_rows];
        image
            .par_chunks_exact_mut(kept_rows)
            .enumerate()
            .for_each_init(
                || {
                    let scratch = fft.get_inplace_scratch_len();
                    let buffer = vec![Complex32::ZERO; rows.length + scratch];
                    (buffer, during(monitor, TRANSFORMS))
                },
                |(buffer, _), (column, out)| {
                    let (line, scratch) = buffer.split_at_mut(rows.length);
                    line.fill(Complex32::ZERO);
                    for (i, row) in half.chunks_exact(kept_columns).enumerate() {
                        line[(i + rows.length - rows.count / 2) % rows.length] = row[column];
                    }
                    fft.process_with_scratch(line, scratch);
                    for (b, z) in out.iter_mut().enumerate() {
                        *z = line[(b + rows.length - kept_rows / 2) % rows.length];
                    }
                },
            );
        Readable {
            carrier: DVec2::new(rows.middle, columns.middle),
            kernel,
            rows,
            columns,
            image,
        }
    }
}

/// Transformed image for interpolation at any position.
pub(super) struct Readable<const W: usize> {
    /// Centre of the spectrum, cycles per metre; removed from the values of [`Self::at`].
    pub(super) carrier: DVec2,
    kernel: KaiserBessel,
    rows: RasterAxis,
    columns: RasterAxis,
    /// Complex values, column by column.
    image: Vec<Complex32>,
}

impl<const W: usize> Readable<W> {
    /// Value `F(place_m)`; 0 outside the extent, which only occurs where the linear path model is invalid.
    pub(super) fn at(&self, place_m: DVec2) -> Complex32 {
        let (rows, columns) = (&self.rows, &self.columns);
        // Cycles per cell, at most a quarter inside the extent.
        let y = DVec2::new(place_m.x / rows.cells, place_m.y / columns.cells);
        if !y.abs().cmple(DVec2::splat(0.25)).all() {
            return Complex32::ZERO;
        }
        let (kept_rows, kept_columns) = (rows.kept(W), columns.kept(W));
        let tap = |y: f64, length: usize, kept: usize| {
            let place = y * length as f64 + (kept / 2) as f64;
            let whole = place.floor();
            let first = (whole as isize + 1 - (W / 2) as isize).clamp(0, (kept - W) as isize);
            (
                first as usize,
                self.kernel.weights::<W>((place - whole) as f32),
            )
        };
        let (row, row_weights) = tap(y.x, rows.length, kept_rows);
        let (column, column_weights) = tap(y.y, columns.length, kept_columns);
        let weights = [&column_weights, &row_weights];
        let sum = weighted(&self.image, kept_rows, [column, row], weights);
        let roll_off = self.kernel.spectrum(y.x) * self.kernel.spectrum(y.y);
        sum * (1.0 / roll_off) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex64;
    use subaperture_model::monitor::Silent;

    #[test]
    fn raster_sum_equals_direct_sum() {
        // Two tracks that cross cells at odd fractions, one of them in descending rows.
        let tracks = [
            Track {
                start: DVec2::new(10.0, -1.0),
                step: DVec2::new(0.0137, 0.021),
            },
            Track {
                start: DVec2::new(12.0, 1.3),
                step: DVec2::new(-0.0173, -0.011),
            },
        ];
        let samples: Vec<Complex32> = (0..200)
            .map(|i| Complex32::cis((i * i) as f32 * 0.37))
            .collect();
        let band = plane::Band {
            low: DVec2::new(10.0, -1.0),
            high: DVec2::new(12.0, 1.3),
        };
        let extent = Extent {
            centre_m: DVec2::ZERO,
            half_m: DVec2::new(7.0, 11.0),
        };
        let mut raster = Raster::<6>::new(band, extent).unwrap();
        raster.spread(&tracks, &samples, &Silent);
        let image = raster.transform(Transforms::Fastest, &Silent);
        let (mut error, mut power) = (0.0, 0.0);
        for i in 0..300 {
            let u = f64::from(i) * 0.618_034;
            let place = DVec2::new(u.fract() * 2.0 - 1.0, (u * 7.3).fract() * 2.0 - 1.0);
            let place = place * extent.half_m;
            let mut expected = Complex64::ZERO;
            for (j, z) in samples.iter().enumerate() {
                let track = &tracks[j / 100];
                let cycles = track.start + track.step * (j % 100) as f64 - image.carrier;
                let turn = std::f64::consts::TAU * cycles.dot(place);
                expected += Complex64::new(z.re.into(), z.im.into()) * Complex64::cis(turn);
            }
            let got = image.at(place);
            error += (Complex64::new(got.re.into(), got.im.into()) - expected).norm_sqr();
            power += expected.norm_sqr();
        }
        let error_db = 10.0 * (error / power).log10();
        println!("6 taps: {error_db:.1} dB");
        // Kernels at -101 dB, their tables in two directions at -108, float32 at -115.
        assert!(error_db < -97.0, "{error_db}");
    }
}
