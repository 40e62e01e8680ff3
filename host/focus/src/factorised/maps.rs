//! Image of a patch by range-Doppler maps of its history, with a rank-2 model of its paths.
//!
//! A history is divided into equal parts, the sub-apertures. Over each, paths are `alpha_n a(p) + beta_n b(p)`
//! ([`subaperture_kernels::rank_two`]): Doppler processing with a Keystone axis of each pulse's own, which follows the turn of the line of
//! sight as polar format does. Maps are made and interpolated by [`subaperture_kernels::patch_map`]. Fewest parts are used with which the model
//! keeps its share of the error.
//!
//! **Errors** that have a share of the bound: the four kernels (resampling in frequency, gridding in slow time, interpolation in range and in
//! Doppler), and the model: the mean square over the patch of the residual of paths, of the polynomials of `a` and `b` over the
//! patch, and of the curve of range over Doppler along a line of pixels. All are measured for the patch and its pulses before
//! any sample is processed. A patch that exceeds them is left to smaller patches.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use num_complex::Complex32;
use subaperture_kernels::column_fft::ColumnFft;
use subaperture_kernels::decimation::Layout;
use subaperture_kernels::lanes::{GROUP, Instructions};
use subaperture_kernels::patch_map::{
    self, Curve, DOPPLER_TAPS, MAX_STEP, PatchMapScratch, PulseLine, Reading, Shape, Station, TAPS,
    TERMS,
};
use subaperture_kernels::paths;
use subaperture_kernels::rank_two::{Differences, POINTS, Places, RankTwo, differences};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::flat_kernel::FlatKernel;
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::polynomial::through;

use super::history::{Axes, PatchHistory};
use super::thinned::Thinned;
use crate::device::{self, Device, DeviceError, PatchMap};
use crate::patch::{PatchSize, Rectangle, Segment};

/// Name of the stage of maps and their interpolation.
pub(super) const MAPS: &str = "maps";

/// Nodes of the Gauss-Legendre rule with [`TERMS`] nodes on [-1, 1], and their weights.
const NODES: [(f64, f64); TERMS] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// Points apart from the nodes, where polynomials are checked: corners, two sides, one inside.
const CHECKED: [[f64; 2]; POINTS - TERMS * TERMS] = [
    [-1.0, -1.0],
    [-1.0, 1.0],
    [1.0, -1.0],
    [1.0, 1.0],
    [0.0, 1.0],
    [1.0, 0.0],
    [0.3, -0.7],
];

/// Largest number of sub-apertures of a patch, and smallest number of pulses in one.
const MAX_PARTS: usize = 16;
const SHORTEST: usize = 16;

/// Points on each edge of a patch at which its Doppler extent is measured.
const EDGE_POINTS: usize = 17;
/// Margin of the Doppler extent over the checked points.
const MARGIN: f64 = 1.02;
/// Doppler bins beyond it: half of the kernel and two.
const MARGIN_BINS: f64 = (DOPPLER_TAPS / 2 + 2) as f64;

/// Largest number of rows, columns or bins of a map.
const LARGEST: f64 = 32_768.0;

/// Relative RMS error of linear weights over an offset of one sample: half of the mean square of tones within 0.31 cycles per sample, over the
/// root of 5 for offsets up to this one.
const DRIFT_ERROR: f64 = 0.28;

/// Smallest ratio of the Doppler rate along a line of pixels to its mean.
const LEAST_RATE: f64 = 0.2;

/// Ratio of the mean error of a [`FlatKernel`] over its band to that near the edge of the band.
const EDGE: f64 = 0.5;

/// Oversampling beyond which kernels are not adapted.
const MAX_OVERSAMPLING: f64 = 3.0;

/// Kernels for an error bound.
#[derive(Debug)]
pub(super) struct MapKernels {
    /// Kernel of gridding in slow time and of interpolation in range, and its oversampling.
    kaiser_bessel: (KaiserBessel, f64),
    /// Kernel of interpolation in Doppler, and its oversampling.
    doppler: (FlatKernel, f64),
    /// Largest error of a kernel, and of the model.
    kernel_error: f64,
    model_error: f64,
    tables: Mutex<Tables>,
}

/// Transforms by length, and resampling kernels by oversampling in twentieths, made at their first use.
#[derive(Debug, Default)]
struct Tables {
    transforms: BTreeMap<usize, Arc<ColumnFft>>,
    flats: BTreeMap<u32, Option<Arc<FlatKernel>>>,
}

impl MapKernels {
    /// Kernels whose errors are at most `kernel_error`, for the worst tone of the band: a bright pixel may lie at the edge of a patch. `None` if
    /// no kernel is that exact.
    pub(super) fn of(kernel_error: f64, model_error: f64) -> Option<Self> {
        let ratios = || (24..=40).map(|i| f64::from(i) * 0.05);
        let kaiser_bessel = ratios()
            .map(|ratio| (KaiserBessel::oversampled(TAPS, ratio), ratio))
            .find(|(kernel, ratio)| kernel.largest_error(0.5 / ratio) <= kernel_error)?;
        let doppler = ratios()
            .find(|&ratio| FlatKernel::error_of(DOPPLER_TAPS, ratio) <= EDGE * kernel_error)
            .map(|ratio| (FlatKernel::new(DOPPLER_TAPS, ratio), ratio))?;
        Some(Self {
            kaiser_bessel,
            doppler,
            kernel_error,
            model_error,
            tables: Mutex::default(),
        })
    }

    fn transform(&self, length: usize) -> Arc<ColumnFft> {
        let mut tables = self.tables.lock().unwrap_or_else(PoisonError::into_inner);
        let transform = tables.transforms.entry(length);
        let transform = transform.or_insert_with(|| Arc::new(ColumnFft::new(length)));
        transform.clone()
    }

    /// Shortest resampling kernel for an oversampling; `None` if every kernel has a larger error.
    fn flat(&self, oversampling: f64) -> Option<Arc<FlatKernel>> {
        let twentieths = (oversampling.min(MAX_OVERSAMPLING) * 20.0).floor();
        // Not-a-number fails, too.
        let is_oversampled = twentieths > 20.0;
        if !is_oversampled {
            return None;
        }
        let mut tables = self.tables.lock().unwrap_or_else(PoisonError::into_inner);
        let flat = tables.flats.entry(twentieths as u32).or_insert_with(|| {
            let ratio = twentieths / 20.0;
            let taps = FlatKernel::taps_for(EDGE * self.kernel_error, ratio)?;
            Some(Arc::new(FlatKernel::new(taps, ratio)))
        });
        flat.clone()
    }
}

/// Sizes of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sizes {
    first_column: isize,
    columns: usize,
    first_row: isize,
    rows: usize,
    first_bin: isize,
    bins: usize,
    over_rows: usize,
    over_columns: usize,
}

/// Maps of a patch.
struct PatchMaps {
    /// Whether stations follow the columns of the grid, along which Doppler changes more than along rows.
    by_columns: bool,
    parts: Vec<PartMap>,
}

/// Map of one sub-aperture and positions of the pixels on it.
struct PartMap {
    pulses: Range<usize>,
    sizes: Sizes,
    /// Kernel that resamples pulses in frequency.
    flat: Arc<FlatKernel>,
    lines: Vec<PulseLine>,
    curves: Vec<Curve>,
    bin_scale: f32,
    clamp: [f32; 2],
    stations: Vec<Station>,
}

/// Numbers that determine the cost of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MapSize {
    pub(super) pulses: usize,
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) bins: usize,
    pub(super) over_rows: usize,
    pub(super) over_columns: usize,
    pub(super) flat_taps: usize,
    pub(super) stations: usize,
    pub(super) lines: usize,
}

/// Buffers of one thread.
#[derive(Default)]
pub(super) struct MapScratch {
    antennas: Vec<paths::Antennas>,
    table: Vec<Differences>,
    models: Vec<RankTwo>,
    kernels: PatchMapScratch,
    pixels: Vec<f32>,
    rows: Vec<Complex32>,
    /// Values of a map for a device.
    map: Vec<f32>,
}

/// A patch: pixels and pulses.
pub(super) struct MapPatch<'a> {
    pub(super) grid: &'a ImageGrid,
    pub(super) rectangle: Rectangle,
    pub(super) axes: &'a Axes,
    pub(super) thinned: &'a Thinned,
    /// Path of each pulse to the centre of the rectangle, metres.
    pub(super) data_m: &'a [f64],
}

impl MapPatch<'_> {
    /// Numbers of stations and of lines.
    fn stations_and_lines(&self, by_columns: bool) -> [usize; 2] {
        let PatchSize { rows, columns } = self.rectangle.size;
        match by_columns {
            true => [columns, rows],
            false => [rows, columns],
        }
    }

    /// Points of the model: nodes row by row, then the checked ones.
    fn places(&self) -> Places {
        let mut places = [[0.0; POINTS]; 3];
        for (i, [row, column]) in points().enumerate() {
            let [row, column] = [row, column].map(|x| 0.5 + 0.5 * x);
            let point = self.rectangle.point_m(self.grid, row, column);
            for (axis, x) in places.iter_mut().zip(point.to_array()) {
                axis[i] = x;
            }
        }
        places
    }
}

/// Rows and columns of the points, from -1 to 1 over the patch.
fn points() -> impl Iterator<Item = [f64; 2]> {
    let nodes = NODES
        .into_iter()
        .flat_map(|(row, _)| NODES.map(|(column, _)| [row, column]));
    nodes.chain(CHECKED)
}

/// Weights of the points, with the sum 1: the mean over the patch.
fn point_weights() -> [f64; POINTS] {
    let mut weights = [0.0; POINTS];
    for (i, weight) in weights[..TERMS * TERMS].iter_mut().enumerate() {
        *weight = NODES[i / TERMS].1 * NODES[i % TERMS].1 / 4.0;
    }
    weights
}

/// Path functions over a patch as polynomials `[line][station]`, of metres.
type Surface = [[f64; TERMS]; TERMS];

fn surface(values: &[f64; POINTS], by_columns: bool) -> Surface {
    let nodes = NODES.map(|(x, _)| x);
    let value = |line: usize, station: usize| match by_columns {
        true => values[TERMS * line + station],
        false => values[TERMS * station + line],
    };
    let along: [[f64; TERMS]; TERMS] =
        std::array::from_fn(|line| through(nodes, std::array::from_fn(|i| value(line, i))));
    let mut terms = [[0.0; TERMS]; TERMS];
    for station in 0..TERMS {
        let over_lines = through(nodes, std::array::from_fn(|line| along[line][station]));
        for (line, term) in over_lines.into_iter().enumerate() {
            terms[line][station] = term;
        }
    }
    terms
}

/// Value of a polynomial.
fn at(terms: &[f64; TERMS], x: f64) -> f64 {
    terms.iter().rev().fold(0.0, |sum, term| sum * x + term)
}

/// Polynomial over lines at a station.
fn at_station(surface: &Surface, station: f64) -> [f64; TERMS] {
    surface.map(|terms| at(&terms, station))
}

impl MapScratch {
    /// Plan the maps of a patch; `None` if it is not suited or too many sub-apertures would be needed.
    fn plan(&mut self, patch: &MapPatch, kernels: &MapKernels) -> Option<PatchMaps> {
        let count = patch.data_m.len();
        if !patch.grid.is_raster() || patch.axes.step_hz <= 0.0 || count < SHORTEST {
            return None;
        }
        let instructions = Instructions::best();
        self.antennas.clear();
        let each = patch.thinned.antennas.iter().zip(patch.data_m);
        self.antennas
            .extend(each.map(|([t, r], &datum_m)| paths::Antennas {
                transmitter_m: t.to_array(),
                receiver_m: r.to_array(),
                datum_m,
            }));
        self.table.resize(count, [0.0; POINTS]);
        differences(
            instructions,
            &self.antennas,
            &patch.places(),
            &mut self.table,
        );
        let point_weights = point_weights();
        let cycles_m = patch.axes.highest_hz() / SPEED_OF_LIGHT_M_S;
        let allowed = (kernels.model_error / (std::f64::consts::TAU * cycles_m)).powi(2);
        let mut parts = 1;
        loop {
            let longest = count.div_ceil(parts);
            if parts > MAX_PARTS || (parts > 1 && longest < SHORTEST) {
                return None;
            }
            let (mut squares, mut total) = (0.0, 0.0);
            self.models.resize_with(parts, RankTwo::default);
            let ranges = || (0..parts).map(|i| i * count / parts..(i + 1) * count / parts);
            for (range, model) in ranges().zip(&mut self.models) {
                let weights = &patch.thinned.weights[range.clone()];
                let table = &self.table[range];
                if !model.fit(instructions, table, weights, &point_weights) {
                    return None;
                }
                let weight: f64 = weights.iter().sum();
                squares += weight * model.mean_square_m2;
                total += weight;
            }
            let mean_square_m2 = squares / total;
            if mean_square_m2 <= 0.8 * allowed {
                let rest = allowed - mean_square_m2;
                let by_columns = follows_columns(&self.models);
                let maps = ranges().zip(&self.models);
                let maps = maps.map(|(range, model)| {
                    let table = &self.table[range.clone()];
                    PartMap::new(patch, kernels, by_columns, range, (table, model), rest)
                });
                return Some(PatchMaps {
                    by_columns,
                    parts: maps.collect::<Option<_>>()?,
                });
            }
            // The residual is quadratic in the length.
            let times = (mean_square_m2 / (0.8 * allowed)).sqrt().sqrt();
            let more = (parts as f64 * times).ceil().min(1e3) as usize;
            parts = more.max(parts + 1);
        }
    }

    /// Numbers that determine the cost of the maps of a patch; `None` as of [`Self::plan`].
    pub(super) fn sizes(&mut self, patch: &MapPatch, kernels: &MapKernels) -> Option<Vec<MapSize>> {
        let maps = self.plan(patch, kernels)?;
        let [stations, lines] = patch.stations_and_lines(maps.by_columns);
        let sizes = maps.parts.iter().map(|map| MapSize {
            pulses: map.pulses.len(),
            columns: map.sizes.columns,
            rows: map.sizes.rows,
            bins: map.sizes.bins,
            over_rows: map.sizes.over_rows,
            over_columns: map.sizes.over_columns,
            flat_taps: map.flat.taps(),
            stations,
            lines,
        });
        Some(sizes.collect())
    }

    /// Add the image of a patch to its requested pixels, interpolated by the `device` if there is one; `false` if the patch is not suited to maps.
    ///
    /// # Errors
    /// Errors of the device.
    pub(super) fn image(
        &mut self,
        patch: &MapPatch,
        kernels: &MapKernels,
        history: &PatchHistory,
        segments: &mut [Segment],
        device: Option<&dyn Device>,
    ) -> Result<bool, DeviceError> {
        let Some(maps) = self.plan(patch, kernels) else {
            return Ok(false);
        };
        let layout = patch.axes.layout();
        let [stations, lines] = patch.stations_and_lines(maps.by_columns);
        let places = places(lines);
        let mut sums = match device.filter(|_| maps.rounding() <= kernels.kernel_error) {
            Some(device) => Some(device.start_patch(stations, lines)?),
            None => None,
        };
        self.pixels.clear();
        if sums.is_none() {
            let count = 2 * stations * patch_map::pixel_stride(lines);
            self.pixels.resize(count, 0.0);
        }
        for map in &maps.parts {
            let [over_rows, over_columns] =
                [map.sizes.over_rows, map.sizes.over_columns].map(|n| kernels.transform(n));
            let shape = map.shape(layout, kernels, [&over_rows, &over_columns]);
            let reading = Reading {
                curves: &map.curves,
                bin_scale: map.bin_scale,
                clamp: map.clamp,
                stations: &map.stations,
                lines: &places,
            };
            let values = layout.values();
            let samples = &history.values[map.pulses.start * values..map.pulses.end * values];
            let (instructions, pulses) = (Instructions::best(), (&map.lines[..], samples));
            let Some(sums) = &mut sums else {
                let (scratch, pixels) = (&mut self.kernels, &mut self.pixels);
                patch_map::add_patch(instructions, &shape, pulses, &reading, scratch, pixels);
                continue;
            };
            self.map.resize(
                patch_map::map_length(map.sizes.bins, map.sizes.over_columns),
                0.0,
            );
            let (scratch, map_values) = (&mut self.kernels, &mut self.map);
            patch_map::make_map(instructions, &shape, pulses, scratch, map_values);
            sums.add(&PatchMap {
                values: &self.map,
                range_bins: map.sizes.over_columns,
                first_bin: map.sizes.first_bin,
                kernels: [shape.range.polynomials(), shape.doppler.polynomials()],
                reading: &reading,
            })?;
        }
        if let Some(sums) = sums {
            self.pixels = sums.take()?;
        }
        self.rows.resize(stations * lines, Complex32::ZERO);
        let pixels = (&self.pixels[..], stations, lines);
        patch_map::to_rows(
            Instructions::best(),
            pixels,
            !maps.by_columns,
            &mut self.rows,
        );
        let columns = patch.rectangle.size.columns;
        for segment in segments {
            let row = (segment.row - patch.rectangle.row) * columns;
            let own = &self.rows[row + segment.column - patch.rectangle.column..];
            for (pixel, value) in segment.pixels.iter_mut().zip(own) {
                *pixel += value;
            }
        }
        Ok(true)
    }
}

impl PatchMaps {
    /// Bound on the error of their interpolation by a device.
    fn rounding(&self) -> f64 {
        let stations = self.parts.iter().flat_map(|map| &map.stations);
        device::map_rounding(stations.map(device::bend).fold(0.0, f64::max))
    }
}

/// Whether Doppler changes more along rows of pixels, from column to column, than along columns.
fn follows_columns(models: &[RankTwo]) -> bool {
    let last = TERMS - 1;
    let [mut across, mut down] = [0.0; 2];
    for [_, b] in models.iter().map(|model| &model.functions) {
        for i in 0..TERMS {
            across += (b[TERMS * i + last] - b[TERMS * i]).abs();
            down += (b[TERMS * last + i] - b[i]).abs();
        }
    }
    across >= down
}

/// Places of `count` pixels from -1 to 1.
fn places(count: usize) -> Vec<f64> {
    let last = (count.max(2) - 1) as f64;
    (0..count).map(|i| 2.0 * i as f64 / last - 1.0).collect()
}

impl PartMap {
    fn new(
        patch: &MapPatch,
        kernels: &MapKernels,
        by_columns: bool,
        pulses: Range<usize>,
        (table, model): (&[Differences], &RankTwo),
        allowed_m2: f64,
    ) -> Option<Self> {
        let axes = patch.axes;
        let c = SPEED_OF_LIGHT_M_S;
        let centre_hz = axes.frequency_hz((axes.num_samples / 2) as f64);
        // Rates of the line of sight, about the middle of their range.
        let rate = |[alpha, beta]: [f64; 2]| beta / alpha;
        let rates = model.coefficients.iter().map(|&own| rate(own));
        let [low, high] = rates.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], rate| {
            [low.min(rate), high.max(rate)]
        });
        let middle = 0.5 * (low + high);
        let b = model.functions[1];
        let mut a = model.functions[0];
        for (a, b) in a.iter_mut().zip(&b) {
            *a += middle * b;
        }
        let [num_stations, num_lines] = patch.stations_and_lines(by_columns);
        if num_stations < 2 || num_lines < 2 {
            return None;
        }
        let [a_surface, b_surface] = [&a, &b].map(|values| surface(values, by_columns));
        // Points and edges: the extremes of a function that rises along every line.
        let edges = (0..EDGE_POINTS).flat_map(|i| {
            let x = 2.0 * i as f64 / (EDGE_POINTS - 1) as f64 - 1.0;
            [[x, -1.0], [x, 1.0], [-1.0, x], [1.0, x]]
        });
        let edges = edges.map(|[line, station]| at(&at_station(&b_surface, station), line));
        let widest_b = edges.chain(b).fold(0.0f64, |most, b| most.max(b.abs()));
        // Range over Doppler along the lines of the nodes.
        let nodes = NODES.map(|(x, _)| x);
        let node = |values: &[f64; POINTS], line: usize, station: usize| match by_columns {
            true => values[TERMS * line + station],
            false => values[TERMS * station + line],
        };
        let mut curves = [[0.0; TERMS]; TERMS];
        let last = TERMS - 1;
        for (line, curve) in curves.iter_mut().enumerate() {
            let along: [f64; TERMS] = std::array::from_fn(|i| node(&b, line, i) / widest_b);
            let slopes = (0..last).map(|i| (along[i + 1] - along[i]) / (nodes[i + 1] - nodes[i]));
            let mean = (along[last] - along[0]) / (nodes[last] - nodes[0]);
            if !slopes.into_iter().all(|slope| slope / mean > LEAST_RATE) {
                return None;
            }
            *curve = through(along, std::array::from_fn(|i| node(&a, line, i)));
        }
        let shear = curves.iter().map(|curve| curve[1]).sum::<f64>() / TERMS as f64;
        for curve in &mut curves {
            curve[1] -= shear;
        }
        let shear = shear / widest_b;
        // Terms of the curves as polynomials over lines.
        let mut over_lines = [[0.0; TERMS]; TERMS];
        for (term, over) in over_lines.iter_mut().enumerate() {
            *over = through(nodes, std::array::from_fn(|line| curves[line][term]));
        }
        let curve_at = |line: f64| over_lines.map(|over| at(&over, line));
        let bandwidth_hz = axes.step_hz * axes.num_samples as f64;
        let spread = model
            .coefficients
            .iter()
            .map(|own| (rate(*own) - middle).powi(2));
        let spread = spread.sum::<f64>() / model.coefficients.len() as f64;
        // Errors of polynomials and curves at the checked points, as of the carrier's path.
        let mut error_m2 = 0.0;
        for (i, [row, column]) in points().enumerate().skip(TERMS * TERMS) {
            let [line, station] = match by_columns {
                true => [row, column],
                false => [column, row],
            };
            let [own_a, own_b] =
                [&a_surface, &b_surface].map(|of| at(&at_station(of, station), line));
            let range = at(&curve_at(line), own_b / widest_b) - (own_a - shear * own_b);
            error_m2 += (own_a - a[i]).powi(2) + spread * (own_b - b[i]).powi(2);
            error_m2 += range * range * (bandwidth_hz / centre_hz).powi(2) / 12.0;
        }
        let within = error_m2 / CHECKED.len() as f64 <= allowed_m2;
        // Bound on the slope of a curve up to `reach` times the Doppler extent, metres per unit of `b`.
        let slope_within = |reach: f64| {
            let bounds = [-1.0, 0.0, 1.0].map(|line| {
                let terms = curve_at(line);
                let slopes =
                    (1..TERMS).map(|i| i as f64 * terms[i].abs() * reach.powi(i as i32 - 1));
                slopes.sum::<f64>() / widest_b
            });
            bounds.into_iter().fold(0.0, f64::max)
        };
        let slope = slope_within(1.0);
        // Columns: samples of all pulses on a common axis.
        let column = |alpha: f64| (axes.start_hz * alpha - centre_hz) / axes.step_hz;
        let last_sample = (axes.num_samples - 1) as f64;
        let ends = model.coefficients.iter().map(|&[alpha, _]| {
            let first = column(alpha);
            [first, first + alpha * last_sample]
        });
        // Within a group of columns the offset of samples to columns is linear, and weights are linear in it.
        let stretch = |[alpha, _]: &[f64; 2]| (alpha - 1.0).abs();
        let stretch = model.coefficients.iter().map(stretch).fold(0.0, f64::max);
        let drift = 0.5 * GROUP as f64 * stretch;
        let [left, right] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], own| {
            [low.min(own[0]), high.max(own[1])]
        });
        let depth_m = table
            .iter()
            .flatten()
            .fold(0.0f64, |most, d| most.max(d.abs()));
        let oversampling = c / (2.0 * axes.step_hz * depth_m * MARGIN);
        let flat = kernels.flat(oversampling)?;
        let half = (flat.taps() / 2) as f64;
        let first_column = left.floor() - half;
        let columns = right.floor() + half + 1.0 - first_column;
        let columns = (columns / GROUP as f64).ceil() * GROUP as f64;
        // Rows: the plane of frequency and rate.
        let position_hz = |own: [f64; 2], column: f64| {
            let x_hz = column * axes.step_hz;
            (centre_hz + x_hz) * (rate(own) - middle) + shear * x_hz
        };
        let coefficients = || model.coefficients.iter().copied();
        let furthest_hz = |column: f64| {
            coefficients().fold(0.0f64, |most, own| most.max(position_hz(own, column).abs()))
        };
        let extent_hz = furthest_hz(left).max(furthest_hz(right));
        let bend_hz = left.abs().max(right.abs()) * axes.step_hz * slope;
        let doppler = kernels.doppler.1;
        // Doppler bins, and rows whose gridding covers all of them.
        let mut bin_m = c / (2.0 * doppler * (extent_hz + bend_hz));
        let reach_m = MARGIN * widest_b + MARGIN_BINS * bin_m;
        let row_hz = c / (2.0 * kernels.kaiser_bessel.1 * reach_m);
        // Columns without samples have rows, too.
        let ends = [first_column, first_column + columns].map(furthest_hz);
        let furthest = (ends[0].max(ends[1]) / row_hz).ceil() + (TAPS / 2 + 1) as f64;
        let over_rows = c / (row_hz * bin_m);
        let over_columns = 2.0 * kernels.kaiser_bessel.1 * left.abs().max(right.abs());
        let sizes = [columns, 2.0 * furthest, over_rows, over_columns];
        // Also for not-a-number.
        let within = within && DRIFT_ERROR * drift * drift <= kernels.kernel_error;
        if !within || !sizes.iter().all(|&size| size < LARGEST) {
            return None;
        }
        let columns = columns as usize;
        let over_columns = fast_length((over_columns.ceil() as usize).max(columns));
        let half_bins = |bin_m: f64| (MARGIN * widest_b / bin_m + MARGIN_BINS).ceil() as usize;
        let mut over_rows = fast_length((over_rows.ceil() as usize).max(2 * furthest as usize + 1));
        bin_m = c / (row_hz * over_rows as f64);
        let bins = (2 * half_bins(bin_m) + 1).next_multiple_of(GROUP);
        if bins > over_rows {
            over_rows = fast_length(bins.next_multiple_of(GROUP) + GROUP);
            bin_m = c / (row_hz * over_rows as f64);
        }
        let bins = (2 * half_bins(bin_m) + 1).next_multiple_of(GROUP);
        if bins > over_rows {
            return None;
        }
        let range_bin_m = c / (axes.step_hz * over_columns as f64);
        let line_step = 2.0 / (num_lines as f64 - 1.0);
        let lines: Vec<PulseLine> = coefficients()
            .map(|own| PulseLine {
                column: column(own[0]),
                columns_a_sample: own[0],
                row: centre_hz * (rate(own) - middle) / row_hz,
                rows_a_column: axes.step_hz * (rate(own) - middle + shear) / row_hz,
            })
            .collect();
        let curves: Vec<Curve> = places(num_lines)
            .into_iter()
            .map(|line| {
                let mut terms = curve_at(line).map(|term| term / range_bin_m);
                let start = terms[0].round();
                terms[0] -= start;
                Curve {
                    start,
                    terms: terms.map(|term| term as f32),
                }
            })
            .collect();
        let stations: Vec<Station> = places(num_stations)
            .into_iter()
            .map(|station| {
                let cycles = at_station(&a_surface, station).map(|a| a * centre_hz / c);
                let mut bins = at_station(&b_surface, station).map(|b| b / bin_m);
                let start = bins[0].round();
                bins[0] -= start;
                Station {
                    start,
                    bins: bins.map(|term| term as f32),
                    cycles,
                }
            })
            .collect();
        let reach = half_bins(bin_m) as f64 * bin_m / widest_b;
        // Steps within a vector of lanes.
        let rows_a_column = lines.iter().map(|line| line.rows_a_column.abs());
        let bins_a_line = stations.iter().map(|station| {
            let rest = station.bins[2..].iter().map(|&term| f64::from(term).abs());
            (f64::from(station.bins[1]).abs() + 4.0 * rest.sum::<f64>()) * line_step
        });
        let steps = [
            rows_a_column.fold(0.0, f64::max),
            bins_a_line.fold(0.0, f64::max),
            slope_within(reach) * bin_m / range_bin_m,
        ];
        if steps.iter().any(|&step| step > MAX_STEP) {
            return None;
        }
        Some(Self {
            pulses,
            sizes: Sizes {
                first_column: first_column as isize,
                columns,
                first_row: -(furthest as isize),
                rows: 2 * furthest as usize + 1,
                first_bin: -((bins / 2) as isize),
                bins,
                over_rows,
                over_columns,
            },
            flat,
            lines,
            curves,
            bin_scale: (bin_m / widest_b) as f32,
            clamp: [-reach as f32, reach as f32],
            stations,
        })
    }

    fn shape<'a>(
        &'a self,
        samples: Layout,
        kernels: &'a MapKernels,
        [over_rows, over_columns]: [&'a ColumnFft; 2],
    ) -> Shape<'a> {
        let sizes = &self.sizes;
        Shape {
            samples,
            first_column: sizes.first_column,
            columns: sizes.columns,
            first_row: sizes.first_row,
            rows: sizes.rows,
            first_bin: sizes.first_bin,
            bins: sizes.bins,
            over_rows,
            over_columns,
            flat: &self.flat,
            gridding: &kernels.kaiser_bessel.0,
            range: &kernels.kaiser_bessel.0,
            doppler: &kernels.doppler.0,
        }
    }
}
