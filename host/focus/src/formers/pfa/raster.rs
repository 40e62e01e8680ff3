//! A Fourier sum over samples anywhere, at places anywhere: spreading, a transform, reading.
//!
//! ```text
//! F(x) = sum_s a_s exp(+j 2 pi (K_s - K_0) . x)
//! ```
//!
//! Spectrum: a sample is spread onto `W x W` cells of a rectangular raster spaced by `dK = 1 / (2 D)`, `D` the
//! image's extent, with the Kaiser-Bessel kernel; by the kernel's own interpolation property
//! ([`KaiserBessel`]) `sum_i phi(kappa - i) exp(j 2 pi i y) = Phi(y) exp(j 2 pi kappa y)`, `|y| <= 1/4`, so
//! dividing by `Phi` at the place read gives the sum back. Image: the raster is padded to twice its
//! size, transformed, and read with the same kernel, whose roll-off is divided out of the raster
//! first. Only the half of the transform in which the image lies is kept.
//!
//! In float32; the errors are those of [`KaiserBessel::error`] in two directions, twice.

use glam::DVec2;
use num_complex::Complex32;
use rayon::prelude::*;
use subaperture_fft::Transforms;

use super::plane::{self, Extent};
use crate::budget::Budget;
use crate::{FormError, Reason, Remedy};
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::reading::weighted;
use subaperture_kernels::spreading::{Band, Line};
use subaperture_model::monitor::{Monitor, during};
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::kaiser_bessel::KaiserBessel;

/// Its stages.
pub(super) const SPREADING: &str = "spreading";
pub(super) const TRANSFORMS: &str = "transforms";

/// Rows of the raster that one thread spreads onto at a time. Fixed, so that sums have one order.
const ROWS_A_TASK: usize = 32;
/// Relative error of a kernel's table ([`KaiserBessel`]).
const TABLE: f64 = 2e-6;
/// Cells in one direction that no memory would hold in two.
const MOST_CELLS: f64 = 1e8;

/// Spatial frequencies of a pulse's samples: `start + k step`, cycles a metre.
#[derive(Clone, Copy, Debug)]
pub(super) struct Track {
    pub(super) start: DVec2,
    pub(super) step: DVec2,
}

/// One direction of the raster.
#[derive(Clone, Copy, Debug)]
struct RasterAxis {
    /// Spatial frequency of the cell `count / 2`.
    middle: f64,
    /// Cells for a cycle a metre.
    cells: f64,
    count: usize,
    /// Length of the transform.
    length: usize,
}

impl RasterAxis {
    fn new(low: f64, high: f64, half_m: f64, taps: usize) -> Result<Self, FormError> {
        let cells = 4.0 * half_m;
        let span = ((high - low) * cells).ceil();
        if span.is_nan() || span > MOST_CELLS {
            let why = format!(
                "the grid, {:.3e} m wide with its distortion, takes {span:.1e} cells of the scene's \
                 spectrum",
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

    /// Values kept of the transform: the image's half, and the kernel's reach at both ends.
    fn kept(&self, taps: usize) -> usize {
        (self.length / 2 + 2 * taps).min(self.length)
    }

    /// Roll-off of the reading kernel, divided out.
    fn emphasis(&self, kernel: &KaiserBessel) -> Vec<f32> {
        kernel.emphasis(self.count, self.length)
    }
}

/// How large the raster is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RasterSize {
    /// Taps of the kernels.
    pub(super) taps: usize,
    /// Rows and columns of the spectrum.
    pub(super) cells: [usize; 2],
    /// Lengths of the transforms over them.
    pub(super) lengths: [usize; 2],
    /// Rows and columns that are kept of the image.
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

    /// The most that is held at once: after the transform along one axis, or after both.
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

/// Relative RMS error of spreading and reading together with `taps` taps, in two directions each, tables included: at the
/// edge of the extent, where a grid of few pixels lies, by 3 dB above the mean.
pub(super) fn error(taps: usize) -> f64 {
    2.0 * std::f64::consts::SQRT_2 * libm::hypot(KaiserBessel::new(taps).error(0.25), TABLE)
}

/// The spectrum, on a raster.
pub(super) struct Raster<const W: usize> {
    kernel: KaiserBessel,
    rows: RasterAxis,
    columns: RasterAxis,
    /// Row by row, real and imaginary parts.
    values: Vec<f32>,
}

impl<const W: usize> Raster<W> {
    pub(super) fn new(
        band: plane::Band,
        extent: Extent,
        budget: &mut Budget,
    ) -> Result<Self, FormError> {
        let [rows, columns] = raster_axes(band, extent, W)?;
        budget.take(
            "the raster of the scene's spectrum",
            RasterSize::new(band, extent, W)?.bytes(),
            &[
                Remedy::SmallerGrid,
                Remedy::OtherFormer(&["rdbp"]),
                Remedy::MoreMemory,
            ],
        )?;
        Ok(Self {
            kernel: KaiserBessel::new(W),
            rows,
            columns,
            values: vec![0.0; 2 * rows.count * columns.count],
        })
    }

    /// Adds the samples of some pulses, `samples` pulse by pulse.
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

    /// The image that the spectrum is of.
    pub(super) fn transform(self, transforms: Transforms, monitor: &dyn Monitor) -> Readable<W> {
        let Self {
            kernel,
            rows,
            columns,
            values,
        } = self;
        let (kept_rows, kept_columns) = (rows.kept(W), columns.kept(W));
        // Along rows, emphasised both ways.
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
        // Along columns; the result is stored column by column.
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

/// The image, to be read anywhere.
pub(super) struct Readable<const W: usize> {
    /// The spectrum's middle, cycles a metre: taken out of what [`Self::at`] returns.
    pub(super) carrier: DVec2,
    kernel: KaiserBessel,
    rows: RasterAxis,
    columns: RasterAxis,
    /// Column by column.
    image: Vec<Complex32>,
}

impl<const W: usize> Readable<W> {
    /// `F(place_m)`; 0 outside the extent, which linear paths have where they are no model at all.
    pub(super) fn at(&self, place_m: DVec2) -> Complex32 {
        let (rows, columns) = (&self.rows, &self.columns);
        // In cycles a cell, at most a quarter inside the extent.
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
    fn the_sum_is_the_plain_sum() {
        // Two tracks that cross cells at odd fractions, one of them backwards in rows.
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
        let mut raster = Raster::<6>::new(band, extent, &mut Budget::new(1 << 24)).unwrap();
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
        // Kernels at -101 dB, their table twice in two directions at -108, float32 at -115.
        assert!(error_db < -97.0, "{error_db}");
    }
}
