//! Read-only range-Doppler map.

use num_complex::Complex32;

use crate::{Axes, LengthError};

/// Range-Doppler map: samples `[doppler][range]`, range contiguous, with their axes.
#[derive(Clone, Copy, Debug)]
pub struct Map<'a> {
    axes: Axes,
    samples: &'a [Complex32],
}

impl<'a> Map<'a> {
    /// View `samples` as a map.
    ///
    /// # Errors
    /// [`LengthError`] if the number of samples is not `D R`.
    pub fn new(axes: Axes, samples: &'a [Complex32]) -> Result<Self, LengthError> {
        LengthError::check("map", axes.shape().map_len(), samples.len())?;
        Ok(Self { axes, samples })
    }

    /// Physical axes of the bins.
    pub fn axes(&self) -> &Axes {
        &self.axes
    }

    /// All samples, `[doppler][range]`.
    pub fn samples(&self) -> &'a [Complex32] {
        self.samples
    }

    /// Sample at a bin.
    ///
    /// # Panics
    /// Panics if the bin is outside the map.
    pub fn at(&self, doppler_bin: usize, range_bin: usize) -> Complex32 {
        let num_range_bins = self.axes.shape().num_range_bins;
        assert!(range_bin < num_range_bins, "range bin {range_bin}");
        self.samples[doppler_bin * num_range_bins + range_bin]
    }

    /// Bilinear interpolation at fractional bins. `None` outside the map; the axes do not wrap.
    ///
    /// For a point scatterer with oversampling `P_r = R/F` and `P_d = D/M` the value between bins is low by at most
    /// `pi^2 / 24 (1/P_r^2 + 1/P_d^2)` of the peak to leading order: linear interpolation errs by `h^2/8` of the
    /// second derivative, which for a band of `F` of `R` cells is at most `(pi/P_r)^2 / 3`.
    pub fn bilinear(&self, doppler_bin: f64, range_bin: f64) -> Option<Complex32> {
        let shape = self.axes.shape();
        let (d, fd) = split(doppler_bin, shape.num_doppler_bins)?;
        let (r, fr) = split(range_bin, shape.num_range_bins)?;
        let lower = self.samples.get(d * shape.num_range_bins + r..)?;
        let upper = lower.get(shape.num_range_bins..)?;
        let along = |row: &[Complex32]| Some(*row.first()? * (1.0 - fr) + *row.get(1)? * fr);
        Some(along(lower)? * (1.0 - fd) + along(upper)? * fd)
    }
}

/// Lower of the two bins around `x` and the fraction above it, if `x` is within `0..=count-1`.
fn split(x: f64, count: usize) -> Option<(usize, f32)> {
    if !(x >= 0.0 && x <= (count - 1) as f64) {
        return None;
    }
    let bin = (x as usize).min(count - 2);
    Some((bin, (x - bin as f64) as f32))
}
