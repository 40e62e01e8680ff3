//! Intermediate arrays of a frequency-domain former, for inspection.

use num_complex::Complex32;

use super::Axes;
use subaperture_model::geometry::Axis;

/// Content of an intermediate array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StageKind {
    /// The two-dimensional spectrum, samples transformed over slow time: rows are the two-way wavenumber
    /// `4 pi f / c`, columns the wavenumber along the track, both in rad/m. Weighted, referred to path
    /// zero; slow time counts from pulse 0.
    Spectrum,
    /// Data after range cell migration correction: rows are the along-track wavenumber in rad/m, columns the closest
    /// range in metres. The reference is applied, so slow time counts from the aperture centre.
    RangeDoppler,
    /// Image before interpolation at pixels: rows are the closest range, columns the along-track position
    /// from the aperture centre, both in metres.
    Image,
}

/// Intermediate array. Pixels are interpolated from the last one with kernels whose roll-off is compensated in advance: spectra of
/// [`StageKind::RangeDoppler`] over range and of [`StageKind::Image`] over both axes rise towards the band
/// edges, by up to 6.6 dB at the very edge (6 taps at a quarter of the sampling rate).
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    /// Content of the array.
    pub kind: StageKind,
    /// Complex values, row-major.
    pub values: &'a [Complex32],
    /// Quantity along the rows.
    pub rows: Axis,
    /// Quantity along the columns.
    pub columns: Axis,
    /// Carrier wavenumbers removed over rows and columns, rad/m. Multiplication by `exp(j (carrier
    /// value))` of the axis restores them.
    pub carriers: [f64; 2],
}

impl<'a> Stage<'a> {
    pub(super) fn new(axes: &Axes, kind: StageKind, values: &'a [Complex32]) -> Self {
        let wavenumber = Axis {
            start: axes.wavenumbers[0],
            step: axes
                .wavenumbers
                .get(1)
                .map_or(0.0, |w| w - axes.wavenumbers[0]),
            count: axes.wavenumbers.len(),
        };
        let along_wavenumber = Axis {
            start: axes.along_wavenumber(0),
            step: axes.along_wavenumber_step,
            count: axes.num_bins,
        };
        let metres = |axis: &super::ImageAxis| Axis {
            start: axis.first_m,
            step: axis.step_m,
            count: axis.count,
        };
        let (range, along) = (&axes.range, &axes.along);
        let (rows, columns, carriers) = match kind {
            StageKind::Spectrum => (wavenumber, along_wavenumber, [0.0, 0.0]),
            StageKind::RangeDoppler => (along_wavenumber, metres(range), [0.0, range.carrier]),
            StageKind::Image => (metres(range), metres(along), [range.carrier, along.carrier]),
        };
        Self {
            kind,
            values,
            rows,
            columns,
            carriers,
        }
    }
}
