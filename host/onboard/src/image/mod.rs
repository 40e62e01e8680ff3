//! The image from maps of patches that a module computed ([`subaperture_core::stream`]).
//!
//! For a pixel at `p`, with `q` the centre of its patch, and for every sub-CPI of `M` pulses with
//! weights `w_m`, the path relative to the centre is the line `a + b u` through the map's two nodes
//! (`subaperture_focus::sub_cpi`). Maps of `R` range bins and `D` Doppler bins a cycle give
//!
//! ```text
//! I(p) = sum over sub-CPIs of  M exp(+j 2 pi f_ref a / c) map(d, r)  /  sum of all their w_m
//! r = a R step_hz / c,   d = -b D f_ref / c
//! ```
//!
//! Fast weights sum to 1 and a map is `1 / M` of its sum over pulses, so a unit scatterer on a pixel
//! reads 1. Between bins the map is read with [`WindowedSinc`](subaperture_signal::windowed_sinc) kernels in range and in Doppler, of the
//! fewest taps that keep the error bound.
//!
//! **Which pixels.** A map is accurate about its patch only. A pixel belongs to the patch whose centre is
//! nearest. Where its place in any of that patch's maps lies so near the gate's edge that the kernel would reach
//! beyond, it is left out: it reads 0, and [`Report::pixels_outside`] counts it.
//!
//! **Rounding of geometry.** Nodes and centres of patches are float64, and only differences of paths between them count:
//! 1e-9 m at 10^7 m.
//!
//! **Scale.** Samples that were multiplied to fill 16 bits are divided again
//! ([`Run::amplitude_scale`](crate::maps::Run::amplitude_scale)).
//!
//! **Missing maps.** A patch is normalised by the weights of the maps that it has, so a unit scatterer
//! reads 1 there too, on a shorter or thinned aperture. [`Report`] says how many maps are missing and how little of
//! the aperture the worst patch has.
//!
//! **Prediction.** [`Report::predicted_db`] holds three errors: the kernels' by their formula; that of the line of paths,
//! by the nodes of each map and its neighbours (`model`), or by the plan that the run records where that is
//! larger; and the module's arithmetic, [`FIXED`] or [`FLOAT`]. What maps cannot tell is not in it: how a
//! track shook within a sub-CPI, if no plan is recorded, and maps that are missing.
//!
//! Cost: `W^2 + 60` operations or so a pixel and map. Memory: 32 bytes a pixel, one map. Accuracy:
//! `tests/link/maps_image.rs`, against the exact sum. The number of threads changes no bit.

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
use subaperture_focus::{Asked, FormError, Formed, Misses, Reason, Remedy, Tile};
use subaperture_kernels::reading::weighted;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_signal::phase::phasor32;

pub use default_grid::default_grid;
pub use forecast::forecast;
pub use gather::patches;

/// An image to form from maps.
#[derive(Clone, Copy)]
pub struct MapsTask<'a> {
    /// The maps.
    pub maps: &'a dyn Maps,
    /// The pixels wanted.
    pub grid: &'a ImageGrid,
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
    /// Whether the image may be worse.
    pub misses: Misses,
    /// Bytes that image and maps may take together.
    pub memory_bytes: u64,
    /// Told of progress, asked whether to go on.
    pub monitor: &'a dyn Monitor,
}

/// What became of the maps and pixels.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// Patches that have maps.
    pub patches: usize,
    /// Maps used.
    pub maps: usize,
    /// Sub-CPIs of which there should be maps.
    pub sub_cpis: u64,
    /// Maps that should be there and are not.
    pub maps_missing: u64,
    /// Smallest share of the weight sent to the module that a patch's maps hold; `None` where the run
    /// broke off and nothing is known of it.
    pub least_weight_share: Option<f64>,
    /// Pixels outside every patch's gate; they read 0.
    pub pixels_outside: u64,
    /// Taps of the kernels.
    pub kernel_taps: usize,
    /// Predicted error of reading maps between their bins, relative RMS, dB.
    #[serde(rename = "kernel_error_db")]
    pub kernel_db: f64,
    /// Predicted error of the image, relative RMS, dB. `predicted_error_db` in the record.
    #[serde(rename = "predicted_error_db")]
    pub predicted_db: f64,
}

/// Relative RMS error of maps in fixed point, -74 dB: the worst of all shapes that
/// [`subaperture_core::fixed_point`] was measured with.
pub const FIXED: f64 = 2e-4;

/// Relative RMS error of maps in float32, with what is added up here, -115 dB.
pub const FLOAT: f64 = 1.8e-6;

/// Pixels of a patch for which the model is probed.
const PROBED_PIXELS: usize = 25;

/// Maps of a patch for which it is.
const PROBED_MAPS: usize = 1024;

/// Pixels that a thread takes at a time.
const PIXELS_A_TASK: usize = 256;

/// Bytes a pixel: image, patch, order, sum.
const PIXEL_BYTES: u64 = 8 + 4 + 8 + size_of::<Sum>() as u64;

/// Bytes that [`form`] takes: the maps' index, the image with what its pixels need, and a map.
fn taken_bytes(task: &MapsTask) -> [u128; 3] {
    let headers = task.maps.headers().iter();
    let maps = headers.map(|header| OwnedMap::bytes(&header.patch));
    [
        task.maps.held_bytes().into(),
        u128::from(task.grid.num_pixels()) * u128::from(PIXEL_BYTES),
        maps.max().unwrap_or(0).into(),
    ]
}

/// Bytes that [`form`] takes in all.
pub fn memory_bytes(task: &MapsTask) -> u128 {
    taken_bytes(task).iter().sum()
}

/// Forms the image.
///
/// # Errors
/// [`FormError`]: no maps, maps that contradict one another, not enough memory, or as the maps' reader.
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

/// Checks that the budget has room for what [`form`] takes.
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

/// What the straight line of paths leaves at some of a patch's pixels, relative.
fn model_error_of(task: &MapsTask, patch: &PatchMaps, members: &[usize], kernels: &Kernels) -> f64 {
    let probes = some_of(task.grid, members);
    let taps = kernels.range.taps();
    probe(task.maps, patch, |header| {
        // Pixels outside of the gate are not read.
        let places = Places::new(&task.maps.run().setup, header);
        let inside = |&point: &DVec3| places.of(point).is_within(taps, header);
        probes.iter().copied().filter(inside).collect()
    })
}

/// Predicts the image's error, and checks that it is within the bound.
fn predict(
    task: &MapsTask,
    report: &mut Report,
    model_error: f64,
    kernel_error: f64,
) -> Result<(), FormError> {
    // The plan's prediction holds kernels too.
    let own_error = model_error
        .hypot(kernel_error)
        .max(planned_error(task.maps));
    report.predicted_db = 20.0 * own_error.hypot(arithmetic_error(task.maps)).log10();
    let asked = Asked {
        bound_db: Some(task.error_db),
        misses: task.misses,
    };
    asked.check(report.predicted_db, || {
        let why = format!(
            "reading the maps between their bins leaves {:.1} dB, the straight line of paths {:.1} dB towards the edges \
             of the grid",
            report.kernel_db,
            20.0 * model_error.log10()
        );
        Reason::new(why).helped_by(&[Remedy::SmallerGrid])
    })
}

/// The error that the run's plan predicted, if it is recorded.
fn planned_error(maps: &dyn Maps) -> f64 {
    let planned_db = maps.run().provenance.get("predicted_error_db");
    let planned_db = planned_db.and_then(serde_json::Value::as_f64);
    planned_db.map_or(0.0, |planned_db| 10f64.powf(planned_db / 20.0))
}

/// What the module's arithmetic adds, relative RMS.
fn arithmetic_error(maps: &dyn Maps) -> f64 {
    match maps.run().arithmetic {
        Arithmetic::Fixed => FIXED,
        Arithmetic::Float => FLOAT,
    }
}

/// Some of a patch's pixels `members` of a grid, evenly.
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

/// RMS over `points` of the phase that the line of paths leaves in the worst of a patch's maps, radians; the points of each
/// map by its header.
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

/// A pixel in the making.
#[derive(Clone, Copy, Default)]
struct Sum {
    value: Complex32,
    /// Whether its place lay outside one of the maps.
    outside: bool,
}

/// The pixels sorted by their patches, and where each patch's end.
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
    // Every start has moved on to its patch's end.
    starts.pop();
    (order, starts)
}

/// Adds one map to the pixels `members` of its patch.
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
            "the map of sub-CPI {}, patch {} holds a value that is not a finite number: compute it again",
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

/// Where pixels lie in a map.
struct Places {
    sub_cpi: SubCpi,
    datum: Datum,
    /// Rows and columns a metre.
    scales: [f64; 2],
    /// Row and column of the patch's centre.
    centre: [f64; 2],
}

/// Where a pixel lies in a map, and its path relative to that of the patch's centre.
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
    /// Whether a kernel of `taps` taps about it lies within the map.
    fn is_within(&self, taps: usize, header: &MapHeader) -> bool {
        first_tap(taps, self.row, header.patch.num_doppler_bins()).is_some()
            && first_tap(taps, self.column, header.patch.num_range_bins()).is_some()
    }
}

/// A map's values and how to read between them.
struct Reading<'a> {
    kernels: &'a Kernels,
    values: &'a [Complex32],
    width: usize,
    rows: usize,
}

impl Reading<'_> {
    /// The value at a row and column; `None` where the kernel would reach beyond the map.
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

/// First of the `taps` bins about `place`, and the fraction beyond its bin; `None` unless all lie within
/// `count` bins.
fn first_tap(taps: usize, place: f64, count: usize) -> Option<(usize, f32)> {
    let whole = place.floor();
    let first = whole - (taps / 2 - 1) as f64;
    let last = count.checked_sub(taps)?;
    (first >= 0.0 && first <= last as f64).then_some((first as usize, (place - whole) as f32))
}
