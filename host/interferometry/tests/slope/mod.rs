//! Simulated slopes for displacement.
//!
//! Each pass is the sum of points with the phase `-(4 pi / lambda) (r + d) + a + b r` and noise, written out here. The radar is at the origin.

use std::f64::consts::PI;

use num_complex::{Complex32, Complex64};
use subaperture_interferometry::displacement::{
    DisplacementError, DisplacementSeries, Passes, Point, Settings, measure,
};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::Image;

use crate::speckle::Random;

/// Wavelength of a Ku-band radar.
pub(crate) const WAVELENGTH_M: f64 = 0.017;
/// Spacing of the pixels, and of the points in pixels.
pub(crate) const STEP_M: f64 = 2.0;
pub(crate) const SPACING: usize = 4;
/// Start of rows (y), metres.
pub(crate) const NEAR_M: f64 = 100.0;

/// Slope of `side x side` points in `passes` passes.
pub(crate) struct Slope {
    pub(crate) side: usize,
    pub(crate) times_s: Vec<f64>,
    /// Displacement at x, y in a pass, metres.
    pub(crate) motion: fn(f64, f64, usize) -> f64,
    /// Ratio of a point's power to that of the noise, by the number of the point.
    pub(crate) snr_db: fn(usize) -> f64,
    /// Constant and slope of the screen of a pass, radians and radians per metre.
    pub(crate) screen: fn(usize) -> [f64; 2],
}

/// Screen with phases all around the circle, and up to 5 rad over 500 m.
pub(crate) fn weather(pass: usize) -> [f64; 2] {
    let k = pass as f64;
    [2.4 * k, 0.01 * (1.7 * k).sin()]
}

impl Slope {
    pub(crate) fn grid(&self) -> ImageGrid {
        let count = self.side * SPACING;
        let axis = |start| Axis {
            start,
            step: STEP_M,
            count,
        };
        ImageGrid::horizontal(axis(-STEP_M * count as f64 / 2.0), axis(NEAR_M), 0.0)
    }

    /// Position of a pixel.
    fn place(&self, row: usize, column: usize) -> [f64; 2] {
        let half = (self.side * SPACING) as f64 / 2.0;
        [
            (column as f64 - half) * STEP_M,
            NEAR_M + row as f64 * STEP_M,
        ]
    }

    /// Points with responses of 3 x 3 pixels, 6 and 12 dB down at edges and corners, and noise of unit power in every pixel.
    pub(crate) fn images(&self, seed: u64) -> Vec<Image> {
        let count = self.side * SPACING;
        let mut random = Random(seed);
        let origins: Vec<f64> = (0..self.side * self.side)
            .map(|_| random.normal().arg())
            .collect();
        let image = |pass: usize| {
            let mut pixels: Vec<Complex64> = (0..count * count).map(|_| random.normal()).collect();
            let [constant, per_m] = (self.screen)(pass);
            for (n, origin) in origins.iter().enumerate() {
                // Irregular by a pixel in rows and columns.
                let row = n / self.side * SPACING + 1 + n * 5 % 7 % 2;
                let column = n % self.side * SPACING + 1 + n * 3 % 11 % 2;
                let [x, y] = self.place(row, column);
                let phase = origin - 4.0 * PI / WAVELENGTH_M * (self.motion)(x, y, pass)
                    + constant
                    + per_m * x.hypot(y);
                let value = Complex64::from_polar(10f64.powf((self.snr_db)(n) / 20.0), phase);
                for (down, across) in (0..9).map(|i| (i / 3, i % 3)) {
                    let off = (down != 1) as i32 + (across != 1) as i32;
                    let at = (row + down - 1) * count + column + across - 1;
                    pixels[at] += value * 0.5f64.powi(off);
                }
            }
            Image {
                rows: count,
                columns: count,
                pixels: (pixels.iter())
                    .map(|z| Complex32::new(z.re as f32, z.im as f32))
                    .collect(),
            }
        };
        (0..self.times_s.len()).map(image).collect()
    }

    pub(crate) fn measured(
        &self,
        seed: u64,
        settings: &Settings,
    ) -> Result<DisplacementSeries, DisplacementError> {
        measure(
            &Passes {
                images: &self.images(seed),
                times_s: &self.times_s,
                grid: &self.grid(),
                radar_m: [0.0; 3],
                wavelength_m: WAVELENGTH_M,
            },
            settings,
        )
    }

    /// Error and standard deviation of every displacement after the first pass, metres.
    pub(crate) fn errors(&self, series: &DisplacementSeries) -> Vec<[f64; 2]> {
        let of_point = |point: &Point| {
            let [x, y, _] = point.position_m;
            let truth = move |pass| (self.motion)(x, y, pass) - (self.motion)(x, y, 0);
            let passes = 1..self.times_s.len();
            let pairs = passes.map(|k| [point.displacement_m[k] - truth(k), point.deviation_m[k]]);
            pairs.collect::<Vec<_>>()
        };
        series.points.iter().flat_map(of_point).collect()
    }
}

pub(crate) fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), v| (sum + v * v, count + 1));
    (sum / f64::from(count)).sqrt()
}

/// Fraction of the errors within 1.96 standard deviations.
pub(crate) fn coverage(errors: &[[f64; 2]]) -> f64 {
    let within = errors.iter().filter(|[e, s]| e.abs() <= 1.96 * s).count();
    within as f64 / errors.len() as f64
}

pub(crate) fn days(count: usize) -> Vec<f64> {
    (0..count).map(|k| 86_400.0 * k as f64).collect()
}
