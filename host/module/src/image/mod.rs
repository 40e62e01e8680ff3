//! Image formation from the patch maps of a module ([`subaperture_core::stream`]).
//!
//! For a pixel at `p`, `q` the centre of its patch, and every sub-CPI of `M` pulses with weights `w_m`, the path relative to
//! the centre is approximated by the line `a + b u` through the two nodes of the map (`subaperture_focus::sub_cpi`). With
//! maps of `R` range bins and `D` Doppler bins per cycle the image is
//!
//! ```text
//! I(p) = sum over sub-CPIs of  M exp(+j 2 pi f_ref a / c) map(d, r)  /  sum of all their w_m
//! r = a R step_hz / c,   d = -b D f_ref / c
//! ```
//!
//! Fast-time weights sum to 1 and a map is `1 / M` of its sum over pulses, so a scatterer of unit amplitude on a pixel has
//! amplitude 1. The map is interpolated with [`WindowedSinc`](subaperture_signal::windowed_sinc) kernels in range and
//! Doppler, with the fewest taps that keep the error bound.
//!
//! **Pixels.** A map is accurate around its patch only, so a pixel belongs to the patch with the nearest centre. If the
//! kernel would extend beyond the gate in any map of that patch, the pixel is 0 and counted by [`Report::pixels_outside`].
//!
//! **Rounding of geometry.** Nodes and patch centres are float64, and only path differences between them matter:
//! 1e-9 m at 10^7 m.
//!
//! **Scale.** Images are divided by the factor that scaled the samples to 16 bits
//! ([`Run::amplitude_scale`](crate::maps::Run::amplitude_scale)).
//!
//! **Missing maps.** A patch is normalised by the weights of the maps that it has, so a unit scatterer has amplitude 1 with a
//! shorter or sparser aperture as well. [`Report`] contains the number of missing maps and the aperture fraction of the worst
//! patch.
//!
//! **Predicted error.** [`Report::predicted_db`] combines three errors: that of the kernels by formula; that of the linear
//! path model from the nodes of each map and its neighbours (`model`), or from the recorded plan if larger; and that of the
//! module's arithmetic, [`FIXED`] or [`FLOAT`]. Not included is what maps do not contain: track vibration within a sub-CPI if
//! no plan is recorded, and missing maps.
//!
//! **Cost**: about `W^2 + 60` operations per pixel and map. **Memory**: 32 bytes per pixel, one map. **Accuracy**:
//! `tests/link/maps_image.rs`, against the exact sum. The result is bit-identical for any number of threads.

mod default_grid;
mod forecast;
mod gather;
pub mod kernels;
mod model;

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;
use serde_json::json;
use subaperture_core::stream::{MapHeader, Setup};

use self::gather::PatchMaps;
use self::kernels::Kernels;
use self::model::sub_cpi_of;
use crate::maps::{Arithmetic, Maps, OwnedMap};
use subaperture_focus::budget::Budget;
use subaperture_focus::sub_cpi::{Datum, SubCpi};
use subaperture_focus::{BoundPolicy, ErrorGoal, FormError, Formed, Reason, Remedy, Tile};
use subaperture_kernels::reading::weighted;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_signal::phase::phasor32;

pub use default_grid::default_grid;
pub use forecast::forecast;
pub use gather::patches;

/// Image formation from maps: inputs and limits.
#[derive(Clone, Copy)]
pub struct MapsTask<'a> {
    /// Maps to use.
    pub maps: &'a dyn Maps,
    /// Pixel grid.
    pub grid: &'a ImageGrid,
    /// Bound on the relative RMS error of the image in dB (negative).
    pub error_db: f64,
    /// Whether an image that exceeds the bound is allowed.
    pub bound_policy: BoundPolicy,
    /// Memory limit for image and maps in bytes.
    pub memory_bytes: u64,
    /// Progress and cancellation.
    pub monitor: &'a dyn Monitor,
}

/// Statistics of an image formed from maps.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// Number of patches with maps.
    pub patches: usize,
    /// Number of maps used.
    pub maps: usize,
    /// Number of sub-CPIs that should have maps.
    pub sub_cpis: u64,
    /// Number of missing maps.
    pub maps_missing: u64,
    /// Smallest fraction of the weight sent to the module that a patch's maps contain. `None` if the run was interrupted and it
    /// is unknown.
    pub least_weight_share: Option<f64>,
    /// Number of pixels outside the gates of their patches; they are 0.
    pub pixels_outside: u64,
    /// Number of interpolation taps.
    pub kernel_taps: usize,
    /// Predicted interpolation error, relative RMS in dB.
    #[serde(rename = "kernel_error_db")]
    pub kernel_db: f64,
    /// Predicted error of the image, relative RMS in dB. `predicted_error_db` in the record.
    #[serde(rename = "predicted_error_db")]
    pub predicted_db: f64,
}

/// Relative RMS error of fixed-point maps, -74 dB: the worst of all shapes measured for
/// [`subaperture_core::fixed_point`].
pub const FIXED: f64 = 2e-4;

/// Relative RMS error of float32 maps including the summation here, -115 dB.
pub const FLOAT: f64 = 1.8e-6;

/// Number of pixels per patch at which the path model is evaluated.
const PROBED_PIXELS: usize = 25;

/// Number of maps per patch for which the path model is evaluated.
const PROBED_MAPS: usize = 1024;

/// Number of pixels per parallel task.
const PIXELS_A_TASK: usize = 256;

/// Bytes per pixel: image, patch, order, sum.
const PIXEL_BYTES: u64 = 8 + 4 + 8 + size_of::<Sum>() as u64;

/// Memory of [`form`] in bytes: map index, image with per-pixel data, and one map.
fn taken_bytes(task: &MapsTask) -> [u128; 3] {
    let headers = task.maps.headers().iter();
    let maps = headers.map(|header| OwnedMap::bytes(&header.patch));
    [
        task.maps.held_bytes().into(),
        u128::from(task.grid.num_pixels()) * u128::from(PIXEL_BYTES),
        maps.max().unwrap_or(0).into(),
    ]
}

/// Total memory of [`form`] in bytes.
pub fn memory_bytes(task: &MapsTask) -> u128 {
    taken_bytes(task).iter().sum()
}

/// Form the image.
///
/// # Errors
/// [`FormError`] if there are no maps, maps contradict each other, memory is insufficient, or a map cannot be read.
pub fn form(task: &MapsTask) -> Result<(Formed, Report), FormError> {
    let patches = patches(task.maps)?;
    take_memory(task)?;
    let headers = task.maps.headers();

    let kernels = Kernels::for_bound(&task.maps.run().setup, task.error_db);
    let (order, ends) = by_patch(task.grid, &patches);
    let mut pixels = vec![Complex32::ZERO; order.len()];
    let mut report = Report {
        patches: patches.len(),
        maps: headers.len(),
        sub_cpis: gather::expected_sub_cpis(task.maps),
        maps_missing: 0,
        least_weight_share: gather::least_weight_share(task.maps, &patches),
        pixels_outside: 0,
        kernel_taps: kernels.range.taps(),
        kernel_db: 20.0 * kernels.error.log10(),
        predicted_db: 0.0,
    };
    let mut model_error = 0.0f64;
    let scale = task.maps.run().amplitude_scale();
    let (mut start, mut done) = (0, 0);
    for (patch, end) in patches.iter().zip(ends) {
        // A file may claim any number of pulses.
        let missing = report.sub_cpis.saturating_sub(patch.maps.len() as u64);
        report.maps_missing = report.maps_missing.saturating_add(missing);
        let members = &order[start..end];
        start = end;
        model_error = model_error.max(model_error_of(task, patch, members, &kernels));
        let mut sums = vec![Sum::default(); members.len()];
        for &index in &patch.maps {
            if !members.is_empty() {
                let map = task.maps.read(index)?;
                add(task, &kernels, map, members, &mut sums)?;
            }
            if task.monitor.cancelled() {
                return Err(FormError::Cancelled);
            }
            done += 1;
            task.monitor
                .progress(f64::from(done) / headers.len() as f64);
        }
        let norm = (1.0 / (patch.weight_sum * scale)) as f32;
        for (&pixel, sum) in members.iter().zip(sums) {
            if sum.outside {
                report.pixels_outside += 1;
            } else {
                pixels[pixel] = sum.value * norm;
            }
        }
    }
    predict(task, &mut report, model_error, kernels.error)?;
    let place = Tile::place_of(task.grid);
    let tile = Tile { place, pixels };
    tile.check_finite(task.grid)?;
    let mut formed = Formed::on(task.grid, tile.pixels, report.predicted_db, json!(report));
    formed.expect(Some(task.error_db), report.predicted_db);
    Ok((formed, report))
}

/// Check that the memory limit is sufficient for [`form`].
fn take_memory(task: &MapsTask) -> Result<(), FormError> {
    let mut budget = Budget::new(task.memory_bytes);
    let [index, image, map] = taken_bytes(task);
    budget.take("the maps' index", index, &[Remedy::MoreMemory])?;
    budget.take(
        "the image",
        image,
        &[Remedy::FewerPixels, Remedy::MoreMemory],
    )?;
    budget.take("a map", map, &[Remedy::MoreMemory])
}

/// Relative error of the linear path model at some of a patch's pixels.
fn model_error_of(task: &MapsTask, patch: &PatchMaps, members: &[usize], kernels: &Kernels) -> f64 {
    let probes = some_of(task.grid, members);
    let taps = kernels.range.taps();
    probe(task.maps, patch, |header| {
        // Pixels outside the gate are not interpolated.
        let places = Places::new(&task.maps.run().setup, header);
        let inside = |&point: &DVec3| places.of(point).is_within(taps, header);
        probes.iter().copied().filter(inside).collect()
    })
}

/// Predict the error of the image and check it against the bound.
fn predict(
    task: &MapsTask,
    report: &mut Report,
    model_error: f64,
    kernel_error: f64,
) -> Result<(), FormError> {
    // The plan's prediction includes the kernels.
    let own_error = model_error
        .hypot(kernel_error)
        .max(planned_error(task.maps));
    report.predicted_db = 20.0 * own_error.hypot(arithmetic_error(task.maps)).log10();
    let goal = ErrorGoal {
        bound_db: Some(task.error_db),
        bound_policy: task.bound_policy,
    };
    goal.check(report.predicted_db, || {
        let why = format!(
            "interpolation of the maps causes {:.1} dB, the linear path model {:.1} dB towards the edges \
             of the grid",
            report.kernel_db,
            20.0 * model_error.log10()
        );
        Reason::new(why).helped_by(&[Remedy::SmallerGrid])
    })
}

/// Error that the run's plan predicted, if recorded.
fn planned_error(maps: &dyn Maps) -> f64 {
    let planned_db = maps.run().provenance.get("predicted_error_db");
    let planned_db = planned_db.and_then(serde_json::Value::as_f64);
    planned_db.map_or(0.0, |planned_db| 10f64.powf(planned_db / 20.0))
}

/// Relative RMS error of the module's arithmetic.
fn arithmetic_error(maps: &dyn Maps) -> f64 {
    match maps.run().arithmetic {
        Arithmetic::Fixed => FIXED,
        Arithmetic::Float => FLOAT,
    }
}

/// Evenly spaced sample of the pixels `members` of a grid.
fn some_of(grid: &ImageGrid, members: &[usize]) -> Vec<DVec3> {
    let columns = grid.columns.count;
    let Some(last) = members.len().checked_sub(1) else {
        return Vec::new();
    };
    (0..PROBED_PIXELS)
        .map(|i| members[i * last / (PROBED_PIXELS - 1)])
        .map(|pixel| grid.position_m(pixel / columns, pixel % columns))
        .collect()
}

/// RMS phase error in radians of the linear path model over `points` in the worst of a patch's maps. The points depend on the
/// header of each map.
fn probe(maps: &dyn Maps, patch: &PatchMaps, points: impl Fn(&MapHeader) -> Vec<DVec3>) -> f64 {
    let headers = maps.headers();
    let step = patch.maps.len().div_ceil(PROBED_MAPS).max(1);
    let chosen = (0..patch.maps.len()).filter(|i| i % step == 0 || i + 1 == patch.maps.len());
    chosen
        .map(|i| {
            let at = |i: usize| patch.maps.get(i).map(|&map| &headers[map]);
            let header = &headers[patch.maps[i]];
            let before = i.checked_sub(1).and_then(at);
            let setup = &maps.run().setup;
            model::error(setup, header, [before, at(i + 1)], &points(header))
        })
        .fold(0.0, f64::max)
}

/// Pixel sum during accumulation.
#[derive(Clone, Copy, Default)]
struct Sum {
    value: Complex32,
    /// Whether the pixel lies outside one of the maps.
    outside: bool,
}

/// Pixels sorted by patch, and the end of each patch's range.
fn by_patch(grid: &ImageGrid, patches: &[PatchMaps]) -> (Vec<usize>, Vec<usize>) {
    let centres: Vec<DVec3> = patches
        .iter()
        .map(|patch| DVec3::from(patch.patch.centre_m))
        .collect();
    let columns = grid.columns.count;
    let nearest: Vec<u32> = (0..grid.num_pixels() as usize)
        .into_par_iter()
        .map(|i| {
            let point = grid.position_m(i / columns, i % columns);
            let distances = centres.iter().map(|c| c.distance_squared(point));
            let nearest = distances.zip(0..).min_by(|a, b| a.0.total_cmp(&b.0));
            nearest.map_or(0, |(_, patch)| patch)
        })
        .collect();
    let mut starts = vec![0; patches.len() + 1];
    for &patch in &nearest {
        starts[patch as usize + 1] += 1;
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    let mut order = vec![0; nearest.len()];
    for (pixel, patch) in nearest.into_iter().enumerate() {
        let place = &mut starts[patch as usize];
        order[*place] = pixel;
        *place += 1;
    }
    // Every start index has advanced to the end of its patch.
    starts.pop();
    (order, starts)
}

/// Add one map to the pixels `members` of its patch.
fn add(
    task: &MapsTask,
    kernels: &Kernels,
    map: OwnedMap,
    members: &[usize],
    sums: &mut [Sum],
) -> Result<(), FormError> {
    let header = map.header;
    let values = map.into_values();
    if !values.iter().all(|z| z.re.is_finite() && z.im.is_finite()) {
        return Err(FormError::unsuited(format!(
            "map of sub-CPI {}, patch {} contains a value that is not finite: compute it again",
            header.sub_cpi, header.patch_index
        )));
    }
    let reading = Reading {
        kernels,
        values: &values,
        width: header.patch.num_range_bins(),
        rows: header.patch.num_doppler_bins(),
    };
    let setup = &task.maps.run().setup;
    let cycles_m = setup.centre_hz() / SPEED_OF_LIGHT_M_S;
    let num_pulses = f32::from(header.num_pulses);
    let places = Places::new(setup, &header);
    let columns = task.grid.columns.count;
    sums.par_chunks_mut(PIXELS_A_TASK)
        .zip(members.par_chunks(PIXELS_A_TASK))
        .for_each(|(sums, members)| {
            if task.monitor.cancelled() {
                return;
            }
            for (sum, pixel) in sums.iter_mut().zip(members) {
                let point = task.grid.position_m(pixel / columns, pixel % columns);
                let place = places.of(point);
                match reading.at(place.row, place.column) {
                    Some(value) => {
                        sum.value += value * phasor32(place.path_m * cycles_m) * num_pulses;
                    }
                    None => sum.outside = true,
                }
            }
        });
    Ok(())
}

/// Positions of pixels in a map.
struct Places {
    sub_cpi: SubCpi,
    datum: Datum,
    /// Rows and columns per metre.
    scales: [f64; 2],
    /// Row and column of the patch centre.
    centre: [f64; 2],
}

/// Position of a pixel in a map, and its path relative to the patch centre.
struct Place {
    path_m: f64,
    row: f64,
    column: f64,
}

impl Places {
    fn new(setup: &Setup, header: &MapHeader) -> Self {
        let cycles_m = setup.centre_hz() / SPEED_OF_LIGHT_M_S;
        let sub_cpi = sub_cpi_of(header);
        Self {
            datum: sub_cpi.datum(DVec3::from(header.patch.centre_m)),
            sub_cpi,
            scales: [
                -f64::from(setup.doppler_length) * cycles_m,
                f64::from(setup.range_length) * setup.step_hz / SPEED_OF_LIGHT_M_S,
            ],
            centre: [
                f64::from(header.patch.doppler_reach),
                f64::from(header.patch.range_reach),
            ],
        }
    }

    fn of(&self, point: DVec3) -> Place {
        let (path_m, rate_m) = self.sub_cpi.line(&self.datum, point);
        Place {
            path_m,
            row: rate_m * self.scales[0] + self.centre[0],
            column: path_m * self.scales[1] + self.centre[1],
        }
    }
}

impl Place {
    /// Whether a kernel of `taps` taps around the position lies within the map.
    fn is_within(&self, taps: usize, header: &MapHeader) -> bool {
        first_tap(taps, self.row, header.patch.num_doppler_bins()).is_some()
            && first_tap(taps, self.column, header.patch.num_range_bins()).is_some()
    }
}

/// Map samples with interpolation kernels.
struct Reading<'a> {
    kernels: &'a Kernels,
    values: &'a [Complex32],
    width: usize,
    rows: usize,
}

impl Reading<'_> {
    /// Interpolated value at a row and column. `None` if the kernel extends beyond the map.
    fn at(&self, row: f64, column: f64) -> Option<Complex32> {
        match self.kernels.range.taps() {
            6 => self.read::<6>(row, column),
            8 => self.read::<8>(row, column),
            10 => self.read::<10>(row, column),
            12 => self.read::<12>(row, column),
            14 => self.read::<14>(row, column),
            _ => self.read::<16>(row, column),
        }
    }

    fn read<const W: usize>(&self, row: f64, column: f64) -> Option<Complex32> {
        let (first_row, row_fraction) = first_tap(W, row, self.rows)?;
        let (first, fraction) = first_tap(W, column, self.width)?;
        let row_weights = self.kernels.doppler.weights::<W>(row_fraction);
        let weights = self.kernels.range.weights::<W>(fraction);
        let first = [first_row, first];
        Some(weighted(
            self.values,
            self.width,
            first,
            [&row_weights, &weights],
        ))
    }
}

/// First of the `taps` bins around `place`, and the fraction beyond its bin. `None` unless all are within `count` bins.
fn first_tap(taps: usize, place: f64, count: usize) -> Option<(usize, f32)> {
    let whole = place.floor();
    let first = whole - (taps / 2 - 1) as f64;
    let last = count.checked_sub(taps)?;
    (first >= 0.0 && first <= last as f64).then_some((first as usize, (place - whole) as f32))
}
