//! The arrays that a frequency-domain former holds on its way, for those who want to look.

use num_complex::Complex32;

use super::Axes;
use subaperture_model::geometry::Axis;

/// What an array holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StageKind {
    /// The two-dimensional spectrum, samples transformed over slow time: rows are the two-way wavenumber
    /// `4 pi f / c`, columns the wavenumber along the track, both in rad/m. Weighted, referred to path
    /// zero; slow time counts from pulse 0.
    Spectrum,
    /// After migration is corrected: rows are the wavenumber along the track in rad/m, columns the closest
    /// range in metres. The reference is applied, so slow time counts from the aperture's centre.
    RangeDoppler,
    /// The image before it is read at pixels: rows are the closest range, columns the place along the track
    /// from the aperture's centre, both in metres.
    Image,
}

/// One of them. Pixels are read from the last with kernels whose roll-off is made good before: spectra of
/// [`StageKind::RangeDoppler`] over range and of [`StageKind::Image`] over both axes rise towards the band's
/// ends, by up to 6.6 dB at the very ends (6 taps at a quarter of the sampling rate).
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    /// What it holds.
    pub kind: StageKind,
    /// Values, row-major.
    pub values: &'a [Complex32],
    /// What the rows stand for.
    pub rows: Axis,
    /// What the columns stand for.
    pub columns: Axis,
    /// Wavenumbers that values are brought down by over rows and columns, rad/m: times `exp(j (carrier
    /// value))` of the axis they are what they were.
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
