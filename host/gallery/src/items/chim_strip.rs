//! Common parts of the items of Chim 2018 on image formation: the L-band radar on a straight track, and maps of
//! intermediate arrays.

use glam::DVec3;
use num_complex::{Complex32, Complex64};

use crate::{Context, ItemError, Picture};
use subaperture_focus::exact::Exact;
use subaperture_focus::{ImageFormer, Task, Transforms};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{Comparison, Image};
use subaperture_model::phase_history::{Band, PhaseHistory, Weights};
use subaperture_planner::Parameters;
use subaperture_plot::{Colours, HeatMap, Panel, PlotError, heat, quicklook};
use subaperture_signal::range_profile::RangeProfiler;
use subaperture_signal::window::Window;
use subaperture_simulate::{PointTargetHistory, Scatterer};

use super::forming::POINT_SCALE;

/// Range bins per frequency, for parabolic peak interpolation.
const RANGE_PADDING: f64 = 8.0;

/// Radar of 4.5, 1.7 to 2.0 GHz, on a straight track of `aperture_m` along x at `y = -range_m`,
/// with unit scatterers at `(x, y)` in a plane.
pub(super) fn l_band(
    range_m: f64,
    aperture_m: f64,
    spacing_m: f64,
    places_m: &[(f64, f64)],
) -> Result<PointTargetHistory, ItemError> {
    let mut pass = Parameters {
        carrier_hz: 1.85e9,
        bandwidth_hz: 300e6,
        num_frequencies: 128,
        range_m,
        velocity_m_s: 1.0,
        prf_hz: 1.0 / spacing_m,
        scene_m: [range_m, range_m],
        ..Parameters::default()
    };
    pass.num_pulses = pass.pulses_over(aperture_m) + 1;
    let collection = pass
        .collection()
        .map_err(|error| ItemError::Measure(error.to_string()))?;
    let scatterers = places_m.iter().map(|&(x, y)| Scatterer {
        position_m: DVec3::new(x, y, 0.0),
        amplitude: Complex64::ONE,
    });
    Ok(PointTargetHistory::new(
        collection,
        scatterers.collect(),
        None,
    ))
}

/// Call `work` with a task over `history` with a window over frequency.
pub(super) fn with_task<T>(
    context: &Context,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    fast: Window,
    work: impl FnOnce(&Task) -> T,
) -> T {
    let weights = Weights::new(history.collection(), fast, Window::None);
    work(&Task {
        memory_bytes: context.memory_bytes,
        monitor: context.monitor,
        ..Task::new(history, grid, &weights)
    })
}

/// Relative RMS error of `former` against the exact sum, dB.
pub(super) fn error_db(
    context: &Context,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    former: &dyn ImageFormer,
) -> Result<f64, ItemError> {
    with_task(context, history, grid, Window::None, |task| {
        let image = former.form_best(task)?.image;
        let exact = Exact.form(task)?.image;
        let comparison = Comparison::between(&image, &exact)
            .map_err(|error| ItemError::Measure(error.to_string()))?;
        Ok(comparison.error_db.unwrap_or(f64::NAN))
    })
}

/// Common band of a recording's pulses.
pub(super) fn band(history: &dyn PhaseHistory) -> Result<Band, ItemError> {
    let missing = || ItemError::Measure("pulses do not share a band".to_owned());
    history.collection().band().ok_or_else(missing)
}

/// Range profiles of rows of samples with reference range `reference_m`: powers `[row][range]` over
/// `shown_m`, and their axis.
pub(super) fn profiles(
    rows: &[Complex32],
    band: &Band,
    window: Window,
    reference_m: f64,
    shown_m: (f64, f64),
) -> (Vec<f32>, Axis) {
    let profiler = RangeProfiler::new(
        1,
        &window.weights(band.count),
        RANGE_PADDING,
        Transforms::Fastest,
    );
    let length = profiler.length();
    let step = band.unambiguous_path_m() / 2.0 / length as f64;
    let bin = |range_m: f64| ((range_m - reference_m) / step).round() as i64;
    let (first, last) = (bin(shown_m.0), bin(shown_m.1));
    let axis = Axis {
        start: reference_m + first as f64 * step,
        step,
        count: (last - first + 1) as usize,
    };
    let mut profile = vec![Complex32::ZERO; length + 1];
    let mut scratch = vec![Complex32::ZERO; profiler.scratch_length()];
    let mut powers = Vec::with_capacity(rows.len() / band.count * axis.count);
    for row in rows.chunks_exact(band.count) {
        profiler.profile(row, &mut profile, &mut scratch);
        let bins = (first..=last).map(|i| i.rem_euclid(length as i64) as usize);
        powers.extend(bins.map(|i| profile[i].norm_sqr()));
    }
    (powers, axis)
}

/// Position of the largest power of a row within `reach` of `near`, by a parabola through three levels.
pub(super) fn ridge(row: &[f32], axis: &Axis, near: f64, reach: f64) -> f64 {
    let inside = |i: &usize| (axis.at(*i) - near).abs() <= reach;
    let inner = (1..axis.count - 1).filter(inside);
    let Some(peak) = inner.max_by(|&a, &b| row[a].total_cmp(&row[b])) else {
        return f64::NAN;
    };
    let [a, b, c] = [peak - 1, peak, peak + 1].map(|i| f64::from(row[i]).ln());
    axis.at(peak) + axis.step * 0.5 * (a - c) / (a - 2.0 * b + c)
}

/// Transpose of a matrix.
pub(super) fn transposed(values: &[Complex32], columns: usize) -> Vec<Complex32> {
    let rows = values.len() / columns;
    (0..values.len())
        .map(|i| values[i % rows * columns + i / rows])
        .collect()
}

/// Convert an axis from rad/m to cycles per metre.
pub(super) fn cycles(axis: &Axis) -> Axis {
    Axis {
        start: axis.start / std::f64::consts::TAU,
        step: axis.step / std::f64::consts::TAU,
        count: axis.count,
    }
}

/// Two-way wavenumber at the band centre, rad/m.
pub(super) fn centre_wavenumber(band: &Band) -> f64 {
    2.0 * std::f64::consts::TAU * band.centre_hz() / SPEED_OF_LIGHT_M_S
}

/// Labels and axes of a map.
pub(super) struct Map<'a> {
    pub(super) name: &'a str,
    pub(super) caption: &'a str,
    /// Horizontal and vertical label.
    pub(super) labels: [&'a str; 2],
    pub(super) rows: Axis,
    pub(super) columns: Axis,
}

impl Map<'_> {
    /// Map of powers, dynamic range 50 dB.
    pub(super) fn levels(&self, powers: &[f32]) -> Result<Picture, PlotError> {
        let peak = powers.iter().copied().fold(0.0, f32::max);
        // Floor of -100 dB for zero power.
        let level = |p: &f32| 10.0 * (p / peak).max(1e-10).log10();
        let values: Vec<f32> = powers.iter().map(level).collect();
        self.values(&values, (-50.0, 0.0), "dB")
    }

    /// Map of values.
    pub(super) fn values(
        &self,
        values: &[f32],
        range: (f64, f64),
        unit: &str,
    ) -> Result<Picture, PlotError> {
        // Pixels are square: the shorter axis is repeated to limit the aspect ratio.
        let (rows, row_times) = repeated(&self.rows, self.columns.count);
        let (columns, column_times) = repeated(&self.columns, self.rows.count);
        let value = |i: usize| {
            let (row, column) = (
                i / columns.count / row_times,
                i % columns.count / column_times,
            );
            values[row * self.columns.count + column]
        };
        let values: Vec<f32> = (0..rows.count * columns.count).map(value).collect();
        let png = heat(&HeatMap {
            values: &values,
            rows,
            columns,
            title: self.caption.to_owned(),
            across_label: self.labels[0].to_owned(),
            up_label: self.labels[1].to_owned(),
            unit: unit.to_owned(),
            range,
            colours: Colours::default(),
            proportional: false,
        })?;
        Ok(Picture {
            name: self.name.to_owned(),
            caption: self.caption.to_owned(),
            png,
        })
    }
}

/// Repeat the elements of `axis` to at least two thirds of the length `other`; returns the repetition.
fn repeated(axis: &Axis, other: usize) -> (Axis, usize) {
    let times = (2 * other).div_ceil(3 * axis.count).max(1);
    let step = axis.step / times as f64;
    let repeated = Axis {
        start: axis.start - axis.step / 2.0 + step / 2.0,
        step,
        count: axis.count * times,
    };
    (repeated, times)
}

/// Picture of a focused image of unit scatterers.
pub(super) fn focused(
    image: &Image,
    grid: &ImageGrid,
    caption: &str,
) -> Result<Picture, PlotError> {
    Ok(Picture {
        name: "image".to_owned(),
        caption: caption.to_owned(),
        png: quicklook(&Panel {
            scale: POINT_SCALE,
            ..Panel::new(image, grid, caption)
        })?,
    })
}

/// Root mean square.
pub(super) fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v * v, count + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}
