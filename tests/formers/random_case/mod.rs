//! Random cases for image formers: track, band, plane of pixels, scatterers, windows and bound from a seed. The phase history and the
//! matched-filter sum are written out here in float64 without the library's paths and phases, so that errors cannot cancel.
//!
//! A [`Case`] consists of a few numbers, so that a failing case can be simplified step by step ([`shrink`]) and printed.

mod dark;
mod draw;
mod oracle;
mod shrink;
mod track;

use std::fmt;

use glam::{DQuat, DVec3, EulerRot};
use num_complex::Complex64;
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::signal::window::Window;

pub(crate) use dark::draw_dark;
pub(crate) use draw::draw;
pub(crate) use oracle::{exact_sum, history};
pub(crate) use shrink::shrink;
pub(crate) use track::{Antennas, Shape, Track};

/// The speed of light, m/s, by definition.
pub(crate) const LIGHT_M_S: f64 = 299_792_458.0;

/// A point scatterer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    /// Position, metres in the scene frame.
    pub(crate) at_m: DVec3,
    /// Amplitude and phase.
    pub(crate) amplitude: Complex64,
}

/// Cartesian or polar grid on an arbitrarily rotated plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    /// Middle of a Cartesian grid, pole of a polar one; metres.
    pub(crate) centre_m: DVec3,
    /// Yaw, pitch and roll, degrees.
    pub(crate) turn_deg: [f64; 3],
    /// Step from row to row and from column to column: metres, or radians for a polar grid's columns.
    pub(crate) steps: [f64; 2],
    /// Rows and columns.
    pub(crate) counts: [usize; 2],
    /// Range of a polar grid's first row, metres; `None` for a Cartesian one.
    pub(crate) polar_from_m: Option<f64>,
}

impl Plane {
    /// The same grid as the library's type.
    pub(crate) fn grid(&self) -> ImageGrid {
        let turn = self.rotation();
        let axis = |start: f64, step: f64, count: usize| Axis { start, step, count };
        let centred =
            |step: f64, count: usize| axis(-step * (count as f64 - 1.0) / 2.0, step, count);
        let [row_step, column_step] = self.steps;
        let [rows, columns] = self.counts;
        ImageGrid {
            polar: self.polar_from_m.is_some(),
            rows: match self.polar_from_m {
                Some(from_m) => axis(from_m, row_step, rows),
                None => centred(row_step, rows),
            },
            columns: centred(column_step, columns),
            origin_m: self.centre_m,
            x_axis: turn * DVec3::X,
            y_axis: turn * DVec3::Y,
            relief: None,
        }
    }

    /// Position of a pixel, metres, independent of the library's.
    pub(crate) fn place_m(&self, row: usize, column: usize) -> DVec3 {
        let turn = self.rotation();
        let of_centre = |i: usize, count: usize| i as f64 - (count as f64 - 1.0) / 2.0;
        let across = self.steps[1] * of_centre(column, self.counts[1]);
        match self.polar_from_m {
            Some(from_m) => {
                let range_m = from_m + self.steps[0] * row as f64;
                let flat = DVec3::new(range_m * across.cos(), range_m * across.sin(), 0.0);
                self.centre_m + turn * flat
            }
            None => {
                let up = self.steps[0] * of_centre(row, self.counts[0]);
                self.centre_m + turn * DVec3::new(across, up, 0.0)
            }
        }
    }

    fn rotation(&self) -> DQuat {
        let [yaw, pitch, roll] = self.turn_deg.map(f64::to_radians);
        DQuat::from_euler(EulerRot::ZYX, yaw, pitch, roll)
    }
}

/// One case.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Case {
    /// Seed that the case was drawn from.
    pub(crate) seed: u64,
    /// Track of the antennas and their arrangement.
    pub(crate) track: Track,
    pub(crate) num_pulses: usize,
    /// Frequency of sample 0, step and number of samples.
    pub(crate) start_hz: f64,
    /// Frequency step, hertz.
    pub(crate) step_hz: f64,
    pub(crate) num_samples: usize,
    pub(crate) plane: Plane,
    pub(crate) points: Vec<Point>,
    /// RMS of noise added to each sample.
    pub(crate) noise: f64,
    /// Windows over frequencies and pulses.
    pub(crate) windows: [Window; 2],
    /// Requested error bound, dB, relative.
    pub(crate) bound_db: f64,
    /// True if the track is smooth and the scene far from it and in view. No former should refuse such a case for lack of accuracy.
    pub(crate) sane: bool,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self:#?}")
    }
}
