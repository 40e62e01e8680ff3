//! Range-Doppler map of a patch of pixels, and the patch's image from it.
//!
//! The phase history of a patch, referred to its centre, is summed over pulses `n` and frequencies `k` for paths of the form
//! `alpha_n a(p) + beta_n b(p)`:
//!
//! ```text
//! I(p) = sum_n sum_k z[n][k] exp(j 2 pi f_k (alpha_n a + beta_n b) / c)
//!      = exp(j 2 pi f_c a / c) sum_n sum_k z[n][k] exp(j 2 pi (X a' + Y b) / c)
//! ```
//!
//! with `X = f_k alpha_n - f_c`, `Y = f_k beta_n + s X` and `a' = a - s b`: the polar format of the samples. The Keystone axis (Schone 2020, (3.9)) is
//! the special case of `alpha = 1` and `beta` equal to the pulse number. Samples are resampled onto columns `X = l dX` by a
//! kernel without roll-off ([`FlatKernel`]), then gridded onto rows `Y = m dY` (Kaiser-Bessel). Two Fourier transforms make
//! the map over Doppler `b` and range `a'`. Two one-dimensional interpolations read it: in range along the curve `a'(b)` of every
//! line of pixels, then in Doppler at every pixel.
//!
//! ```text
//! pulses --resample--> columns --grid--> raster --transform--> [bin][column] --transform--> [range][bin]
//!        --interpolate in range--> [bin][line] --interpolate in Doppler, restore phase--> pixels [station][line]
//! ```
//!
//! **Accuracy** positions and carrier phases are float64, sums float32; the kernels' weights have errors of 1e-6. The result is bit-identical in all
//! instruction sets. **Cost** `W + 7` complex multiply-adds per sample, two transforms, 7 per Doppler bin and line, 13 per pixel.

use num_complex::Complex32;
use subaperture_signal::flat_kernel::{FlatKernel, STEPS};
use subaperture_signal::kaiser_bessel::{KaiserBessel, TERMS as KERNEL_TERMS};

use crate::column_fft::{ColumnFft, Row, ZEROS};
use crate::decimation;
use crate::lanes::{GROUP, Instructions, Kernel, Lanes, transpose};
use crate::phasor::{Polynomials, ROUND, nearest};
use crate::taps::{below, weights};

/// Taps of the Kaiser-Bessel kernels.
pub const TAPS: usize = 6;

/// Taps of the interpolation in Doppler.
pub const DOPPLER_TAPS: usize = 12;

/// Coefficients of a polynomial along a line or over Doppler.
pub const TERMS: usize = 5;

/// Sizes of a map, transforms and kernels.
pub struct Shape<'a> {
    /// Layout of the samples of a pulse.
    pub samples: decimation::Layout,
    /// Number `l` of the first column; column 0 is at the centre frequency.
    pub first_column: isize,
    /// Number of columns, a multiple of [`GROUP`].
    pub columns: usize,
    /// Number `m` of the first row; row 0 is at a rate of zero.
    pub first_row: isize,
    /// Number of rows of the raster.
    pub rows: usize,
    /// Number of the first Doppler bin; bin 0 is at zero Doppler.
    pub first_bin: isize,
    /// Number of Doppler bins, a multiple of [`GROUP`].
    pub bins: usize,
    /// Transform over rows, at least as long as the rows and as the bins.
    pub over_rows: &'a ColumnFft,
    /// Transform over columns, at least as long as the columns.
    pub over_columns: &'a ColumnFft,
    /// Kernel that resamples samples onto columns.
    pub flat: &'a FlatKernel,
    /// Kernel that grids columns onto rows.
    pub gridding: &'a KaiserBessel,
    /// Kernel of the interpolation in range.
    pub range: &'a KaiserBessel,
    /// Kernel of the interpolation in Doppler.
    pub doppler: &'a FlatKernel,
}

/// Positions of a pulse's samples on the raster.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PulseLine {
    /// Column of sample 0.
    pub column: f64,
    /// Columns per sample, close to 1.
    pub columns_a_sample: f64,
    /// Row at column 0.
    pub row: f64,
    /// Increment of the row per column.
    pub rows_a_column: f64,
}

/// Range bin over Doppler along a line of pixels: `start` plus a polynomial of the Doppler bin times [`Reading::bin_scale`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Curve {
    /// Range bin, a whole number, from which the polynomial counts.
    pub start: f64,
    /// Coefficients of the polynomial, range bins.
    pub terms: [f32; TERMS],
}

/// Doppler and carrier phase along a station, the pixels of all lines at the same place of their line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Station {
    /// Doppler bin, a whole number, from which the polynomial counts.
    pub start: f64,
    /// Polynomial of the line's coordinate, Doppler bins.
    pub bins: [f32; TERMS],
    /// Polynomial of the line's coordinate, cycles.
    pub cycles: [f64; TERMS],
}

/// Positions of pixels on a map.
pub struct Reading<'a> {
    /// Curve of each line.
    pub curves: &'a [Curve],
    /// Factor of the argument of the curves, per Doppler bin.
    pub bin_scale: f32,
    /// Smallest and largest argument; others are clamped.
    pub clamp: [f32; 2],
    /// Stations in the order of the pixels along a line.
    pub stations: &'a [Station],
    /// Coordinate of each line for the stations' polynomials: evenly spaced, from -1 to 1.
    pub lines: &'a [f64],
}

/// Buffers of one thread.
#[derive(Default)]
pub struct PatchMapScratch {
    line: Vec<f32>,
    resampled: Vec<f32>,
    raster: Vec<f32>,
    spectra: Vec<f32>,
    read: Vec<f32>,
    rows: [Vec<Row>; 2],
    column_emphasis: Vec<f32>,
    bin_emphasis: Vec<f32>,
}

/// Stride, numbers, for planes of `count`: whole groups, and an odd number of them so that rows do not share cache sets.
const fn stride(count: usize) -> usize {
    let groups = count.div_ceil(GROUP);
    (groups + 1 - groups % 2) * GROUP
}

/// Zeros before and after the samples of a pulse.
const MARGIN: usize = GROUP;

impl PatchMapScratch {
    fn lengths(shape: &Shape, lines: usize) -> [usize; 3] {
        [
            2 * shape.rows * stride(shape.columns),
            2 * shape.columns * stride(shape.bins),
            2 * shape.bins * stride(lines),
        ]
    }
}

/// Image of a patch: add to `pixels`, `[station][real, imaginary][stride of the lines]`, the samples `history` of `pulses`.
///
/// # Panics
/// If lengths do not match, or a row or column of a sample is outside the raster.
pub fn add_patch(
    instructions: Instructions,
    shape: &Shape,
    (pulses, history): (&[PulseLine], &[f32]),
    reading: &Reading,
    scratch: &mut PatchMapScratch,
    pixels: &mut [f32],
) {
    assert_eq!(reading.curves.len(), reading.lines.len());
    assert_eq!(
        pixels.len(),
        2 * reading.stations.len() * pixel_stride(reading.lines.len())
    );
    let output = Output::Pixels { reading, pixels };
    form(instructions, shape, (pulses, history), scratch, output);
}

/// Map of a patch: [`map_length`] values `[bin / 16][range bin][real, imaginary][16 bins]` of the samples `history` of `pulses`.
///
/// # Panics
/// If lengths do not match, or a row or column of a sample is outside the raster.
pub fn make_map(
    instructions: Instructions,
    shape: &Shape,
    (pulses, history): (&[PulseLine], &[f32]),
    scratch: &mut PatchMapScratch,
    values: &mut [f32],
) {
    assert_eq!(
        values.len(),
        map_length(shape.bins, shape.over_columns.len())
    );
    let output = Output::Map(values);
    form(instructions, shape, (pulses, history), scratch, output);
}

/// Number of values of a map with the given numbers of Doppler and range bins.
pub const fn map_length(bins: usize, range_bins: usize) -> usize {
    2 * bins * range_bins
}

fn form(
    instructions: Instructions,
    shape: &Shape,
    (pulses, history): (&[PulseLine], &[f32]),
    scratch: &mut PatchMapScratch,
    output: Output,
) {
    assert_eq!(history.len(), pulses.len() * shape.samples.values());
    assert!(shape.columns.is_multiple_of(GROUP) && shape.bins.is_multiple_of(GROUP));
    let [rows, columns] = [shape.over_rows.len(), shape.over_columns.len()];
    assert!(rows >= shape.rows.max(shape.bins) && columns >= shape.columns);
    assert!(shape.gridding.taps() == TAPS && shape.range.taps() == TAPS);
    assert_eq!(shape.doppler.taps(), DOPPLER_TAPS);
    let lines = match &output {
        Output::Pixels { reading, .. } => reading.lines.len(),
        Output::Map(_) => 0,
    };
    let [raster, spectra, read] = PatchMapScratch::lengths(shape, lines);
    scratch.line.clear();
    scratch.line.resize(
        2 * (2 * MARGIN + shape.samples.factor() * shape.samples.plane()),
        0.0,
    );
    scratch.resampled.resize(2 * shape.columns, 0.0);
    scratch.raster.clear();
    scratch.raster.resize(raster, 0.0);
    scratch.spectra.resize(spectra, 0.0);
    scratch.read.resize(read, 0.0);
    for buffer in &mut scratch.rows {
        buffer.resize(rows.max(columns), ZEROS);
    }
    let inverse =
        |kernel: &KaiserBessel, first: isize, count: usize, length: usize, to: &mut Vec<f32>| {
            to.clear();
            let place = |i: usize| (first + i as isize) as f64 / length as f64;
            to.extend((0..count).map(|i| (1.0 / kernel.spectrum(place(i))) as f32));
        };
    inverse(
        shape.range,
        shape.first_column,
        shape.columns,
        columns,
        &mut scratch.column_emphasis,
    );
    inverse(
        shape.gridding,
        shape.first_bin,
        shape.bins,
        rows,
        &mut scratch.bin_emphasis,
    );
    instructions.run(Form {
        shape,
        pulses,
        history,
        scratch,
        output,
    });
}

/// Stride of the lines of pixels, numbers.
pub const fn pixel_stride(lines: usize) -> usize {
    lines.next_multiple_of(GROUP)
}

/// Result of the transforms.
enum Output<'a> {
    /// Pixels interpolated at their positions.
    Pixels {
        reading: &'a Reading<'a>,
        pixels: &'a mut [f32],
    },
    /// Values of the map.
    Map(&'a mut [f32]),
}

struct Form<'a> {
    shape: &'a Shape<'a>,
    pulses: &'a [PulseLine],
    history: &'a [f32],
    scratch: &'a mut PatchMapScratch,
    output: Output<'a>,
}

impl Kernel for Form<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self {
            shape,
            pulses,
            history,
            scratch,
            mut output,
        } = self;
        let PatchMapScratch {
            line,
            resampled,
            raster,
            spectra,
            read,
            rows,
            column_emphasis,
            bin_emphasis,
        } = scratch;
        for (pulse, row) in pulses
            .iter()
            .zip(history.chunks_exact(shape.samples.values()))
        {
            unpack(lanes, shape.samples, row, line);
            resample(lanes, shape, pulse, line, resampled);
            grid(lanes, shape, pulse, resampled, raster);
        }
        let [first, second] = rows;
        for block in 0..shape.columns / GROUP {
            let buffers = [&mut first[..], &mut second[..]];
            let emphasis = [&column_emphasis[..], bin_emphasis];
            over_rows(lanes, shape, block, (raster, emphasis), buffers, spectra);
        }
        for block in 0..shape.bins / GROUP {
            let buffers = [&mut first[..], &mut second[..]];
            let rows = over_columns(lanes, shape, block, spectra, buffers);
            match &mut output {
                Output::Pixels { reading, .. } => {
                    read_lines(lanes, shape, block, (rows, reading), read);
                }
                Output::Map(values) => {
                    let values = values.as_chunks_mut().0;
                    values[block * rows.len()..(block + 1) * rows.len()].copy_from_slice(rows);
                }
            }
        }
        if let Output::Pixels { reading, pixels } = output {
            read_stations(lanes, shape, reading, read, pixels);
        }
    }
}

/// Write the samples of a pulse in order, real and imaginary parts apart, between zeros.
#[inline(always)]
fn unpack<L: Lanes>(lanes: L, layout: decimation::Layout, row: &[f32], line: &mut [f32]) {
    let (factor, half) = (layout.factor(), layout.plane());
    let plane = line.len() / 2;
    for (line, row) in line
        .chunks_exact_mut(plane)
        .zip(row.chunks_exact(factor * half))
    {
        if factor != 2 {
            for (phase, row) in row.chunks_exact(half).enumerate() {
                let to = line[MARGIN + phase..].iter_mut().step_by(factor);
                to.zip(row).for_each(|(to, value)| *to = *value);
            }
            continue;
        }
        let (even, odd) = row.split_at(half);
        for i in (0..half).step_by(L::COUNT) {
            let pairs = lanes.zip(lanes.load(&even[i..]), lanes.load(&odd[i..]));
            for (j, pairs) in pairs.into_iter().enumerate() {
                lanes.store(pairs, &mut line[MARGIN + 2 * i + j * L::COUNT..]);
            }
        }
    }
}

/// Numbers 0 to 15, as lanes of a part from `part` on.
#[inline(always)]
fn ramp<L: Lanes>(lanes: L, part: usize) -> L::Numbers {
    const RAMP: [f32; GROUP] = [
        0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
    ];
    lanes.load(&RAMP[part..])
}

/// Resample a pulse onto the columns.
#[inline(always)]
fn resample<L: Lanes>(
    lanes: L,
    shape: &Shape,
    pulse: &PulseLine,
    line: &[f32],
    resampled: &mut [f32],
) {
    let plane = line.len() / 2;
    let (line_re, line_im) = line.split_at(plane);
    let (out_re, out_im) = resampled.split_at_mut(shape.columns);
    // Sample k lies at column k + x_0 + (scale - 1) k.
    let stretch = pulse.columns_a_sample - 1.0;
    let taps = shape.flat.taps();
    for block in (0..shape.columns).step_by(GROUP) {
        let first = (shape.first_column + block as isize) as f64;
        // The sample at the middle of the block, and the offset of samples to columns there.
        let middle = first + 7.5 - pulse.column;
        let offset = pulse.column + stretch * middle;
        let whole = below(offset);
        let fraction = offset - whole;
        let step = nearest(fraction * STEPS as f64);
        let table = shape.flat.row(step as usize);
        // Tap i of the first lane takes sample `sample - i`.
        let sample = first + (taps / 2) as f64 - 1.0 - whole;
        let beyond = fraction - step / STEPS as f64 + stretch * (sample - middle);
        let start = sample as isize + MARGIN as isize;
        for part in (0..GROUP).step_by(L::COUNT) {
            let along = lanes.mul(ramp(lanes, part), lanes.splat(stretch as f32));
            let [mut re, mut im] = [lanes.splat(0.0); 2];
            for (i, &[weight, slope]) in table.iter().enumerate() {
                let from = start - i as isize;
                // Blocks without samples.
                if from < 0 || from as usize + GROUP > plane {
                    continue;
                }
                let from = from as usize + part;
                let own = (beyond - stretch * i as f64) as f32;
                let weight = own.mul_add(slope, weight);
                let weight = lanes.mul_add(along, lanes.splat(slope), lanes.splat(weight));
                re = lanes.mul_add(weight, lanes.load(&line_re[from..]), re);
                im = lanes.mul_add(weight, lanes.load(&line_im[from..]), im);
            }
            lanes.store(re, &mut out_re[block + part..]);
            lanes.store(im, &mut out_im[block + part..]);
        }
    }
}

/// Largest number of different first elements of the lanes of a vector.
const MAX_FIRSTS: usize = 24;

/// Largest step of a position, elements, from lane to lane: rows per column, Doppler bins per line, range bins per Doppler bin.
pub const MAX_STEP: f64 = 1.4;

/// Kernel weights of the lanes of a vector at positions `base + offsets`.
struct Window<L: Lanes, const W: usize> {
    /// First element of the lowest lane.
    first: isize,
    /// Weights of each lane from its own first element on, between zeros: element `i` at `i + 1`.
    own: [L::Numbers; DOPPLER_TAPS + 2],
    /// Offset of each lane's first element from the lowest lane's, and the largest of them.
    above: L::Numbers,
    span: usize,
}

impl<L: Lanes, const W: usize> Window<L, W> {
    /// Weights of a kernel with these polynomials. Positions further apart than [`MAX_FIRSTS`] are clamped to it, which no call reaches.
    #[inline(always)]
    fn new(
        lanes: L,
        polynomials: &[[[f32; KERNEL_TERMS]; 2]],
        base: f64,
        offsets: L::Numbers,
    ) -> Self {
        let round = lanes.splat(ROUND);
        let below_half = lanes.sub(offsets, lanes.splat(0.5));
        let whole = lanes.sub(lanes.add(below_half, round), round);
        let [least, most] = lanes.ends(whole);
        let mut own = [lanes.splat(0.0); DOPPLER_TAPS + 2];
        let weights: [_; W] = weights(lanes, polynomials, lanes.sub(below_half, whole));
        own[1..=W].copy_from_slice(&weights);
        Self {
            first: base as isize + least as isize - (W / 2 - 1) as isize,
            own,
            above: lanes.sub(whole, lanes.splat(least)),
            span: ((most - least) as usize).min(MAX_FIRSTS - 1),
        }
    }

    /// Weights of an element where lanes have one or two first elements.
    #[inline(always)]
    fn of_two(&self, lanes: L, low: L::Numbers, element: usize) -> L::Numbers {
        let upper = lanes.mul(self.own[element], self.above);
        lanes.mul_add(self.own[element + 1], low, upper)
    }

    /// Lanes with the lower of two first elements.
    #[inline(always)]
    fn low(&self, lanes: L) -> L::Numbers {
        lanes.sub(lanes.splat(1.0), self.above)
    }

    /// Weights of an element where lanes have any first elements.
    #[inline(always)]
    fn of_several(&self, lanes: L, element: usize) -> L::Numbers {
        let mut weight = lanes.splat(0.0);
        let last = self.span.min(element);
        for i in element.saturating_sub(W - 1)..=last {
            let mask = lanes.is_equal(self.above, lanes.splat(i as f32));
            weight = lanes.mul_add(self.own[element - i + 1], mask, weight);
        }
        weight
    }
}

/// Loop over the elements of a window of `$taps` taps with their weights. A macro, because a closure would not be compiled with the caller's
/// instruction set. Windows of one first element are not treated apart: a branch that is hard to predict costs more than an element.
macro_rules! each_element {
    ($lanes:ident, $window:ident, $taps:ident, |$element:ident, $weight:ident| $body:block) => {
        if $window.span <= 1 {
            let low = $window.low($lanes);
            for $element in 0..$taps + 1 {
                let $weight = $window.of_two($lanes, low, $element);
                $body
            }
        } else {
            for $element in 0..$taps + $window.span {
                let $weight = $window.of_several($lanes, $element);
                $body
            }
        }
    };
}

/// Weighted sum of the elements of a window, real and imaginary. Even and odd elements have sums of their own, for shorter chains of
/// additions.
macro_rules! sum_elements {
    ($lanes:ident, $window:ident, $taps:ident, |$element:ident| $parts:block) => {{
        let mut sums = [[$lanes.splat(0.0); 2]; 2];
        if $window.span <= 1 {
            let low = $window.low($lanes);
            for pair in 0..$taps / 2 {
                for (odd, sum) in sums.iter_mut().enumerate() {
                    let $element = 2 * pair + odd;
                    let weight = $window.of_two($lanes, low, $element);
                    let [re, im]: [&[f32]; 2] = $parts;
                    sum[0] = $lanes.mul_add(weight, $lanes.load(re), sum[0]);
                    sum[1] = $lanes.mul_add(weight, $lanes.load(im), sum[1]);
                }
            }
            let $element = $taps;
            let weight = $window.of_two($lanes, low, $element);
            let [re, im]: [&[f32]; 2] = $parts;
            sums[0][0] = $lanes.mul_add(weight, $lanes.load(re), sums[0][0]);
            sums[0][1] = $lanes.mul_add(weight, $lanes.load(im), sums[0][1]);
        } else {
            for $element in 0..$taps + $window.span {
                let weight = $window.of_several($lanes, $element);
                let [re, im]: [&[f32]; 2] = $parts;
                let sum = &mut sums[$element % 2];
                sum[0] = $lanes.mul_add(weight, $lanes.load(re), sum[0]);
                sum[1] = $lanes.mul_add(weight, $lanes.load(im), sum[1]);
            }
        }
        [
            $lanes.add(sums[0][0], sums[1][0]),
            $lanes.add(sums[0][1], sums[1][1]),
        ]
    }};
}

/// Add a resampled pulse to the rows of the raster.
#[inline(always)]
fn grid<L: Lanes>(
    lanes: L,
    shape: &Shape,
    pulse: &PulseLine,
    resampled: &[f32],
    raster: &mut [f32],
) {
    let (re, im) = resampled.split_at(shape.columns);
    let plane = stride(shape.columns);
    let step = pulse.rows_a_column as f32;
    let along = lanes.splat(step);
    for block in (0..shape.columns).step_by(GROUP) {
        let l = (shape.first_column + block as isize) as f64;
        let row = pulse.row + l * pulse.rows_a_column - shape.first_row as f64;
        let base = nearest(row);
        let first = (row - base) as f32;
        let start = lanes.splat(first);
        for part in (0..GROUP).step_by(L::COUNT) {
            let column = block + part;
            let offsets = lanes.mul_add(ramp(lanes, part), along, start);
            let window = Window::<L, TAPS>::new(lanes, shape.gridding.polynomials(), base, offsets);
            let [z_re, z_im] = [lanes.load(&re[column..]), lanes.load(&im[column..])];
            let first = usize::try_from(window.first).expect("a row of the raster") * 2 * plane;
            each_element!(lanes, window, TAPS, |i, weight| {
                let to = &mut raster[first + 2 * plane * i + column..];
                lanes.store(lanes.mul_add(weight, z_re, lanes.load(to)), to);
                let to = &mut to[plane..];
                lanes.store(lanes.mul_add(weight, z_im, lanes.load(to)), to);
            });
        }
    }
}

/// Rows of a transform from a block of columns of planes `[row][real, imaginary][plane]`, the first of them row `first` modulo the length;
/// other rows are zero.
#[inline(always)]
fn gather(rows: &mut [Row], first: isize, (planes, plane): (&[f32], usize), block: usize) {
    rows.fill(ZEROS);
    let length = rows.len() as isize;
    let own = block * GROUP..(block + 1) * GROUP;
    for (place, from) in (first..).zip(planes.chunks_exact(2 * plane)) {
        let to = &mut rows[place.rem_euclid(length) as usize];
        to[..GROUP].copy_from_slice(&from[own.clone()]);
        to[GROUP..].copy_from_slice(&from[plane..][own.clone()]);
    }
}

/// Transform a block of columns over the rows, and write the Doppler bins of each column.
#[inline(always)]
fn over_rows<L: Lanes>(
    lanes: L,
    shape: &Shape,
    block: usize,
    (raster, [column_emphasis, bin_emphasis]): (&[f32], [&[f32]; 2]),
    [first, second]: [&mut [Row]; 2],
    spectra: &mut [f32],
) {
    let fft = shape.over_rows;
    let (length, plane) = (fft.len(), stride(shape.columns));
    let (rows, other) = (&mut first[..length], &mut second[..length]);
    gather(rows, shape.first_row, (raster, plane), block);
    let rows = fft.run(lanes, rows, other);
    let plane = stride(shape.bins);
    let first_bin = shape.first_bin;
    for bin in (0..shape.bins).step_by(L::COUNT) {
        for part in (0..GROUP).step_by(L::COUNT) {
            for imaginary in [0, 1] {
                let mut tile = [lanes.splat(0.0); GROUP];
                for (i, tile) in tile.iter_mut().enumerate().take(L::COUNT) {
                    let place = (first_bin + (bin + i) as isize).rem_euclid(length as isize);
                    let row = &rows[place as usize][imaginary * GROUP + part..];
                    *tile = lanes.mul(lanes.load(row), lanes.splat(bin_emphasis[bin + i]));
                }
                transpose(lanes, &mut tile);
                for (i, &tile) in tile.iter().enumerate().take(L::COUNT) {
                    let column = block * GROUP + part + i;
                    let to = &mut spectra[(2 * column + imaginary) * plane + bin..];
                    lanes.store(lanes.mul(tile, lanes.splat(column_emphasis[column])), to);
                }
            }
        }
    }
}

/// Transform a block of Doppler bins over the columns: rows of range bins.
#[inline(always)]
fn over_columns<'b, L: Lanes>(
    lanes: L,
    shape: &Shape,
    block: usize,
    spectra: &[f32],
    [first, second]: [&'b mut [Row]; 2],
) -> &'b [Row] {
    let fft = shape.over_columns;
    let (length, plane) = (fft.len(), stride(shape.bins));
    let (rows, other) = (&mut first[..length], &mut second[..length]);
    gather(rows, shape.first_column, (spectra, plane), block);
    fft.run(lanes, rows, other)
}

/// Interpolate a block of Doppler bins in range at every line.
#[inline(always)]
fn read_lines<L: Lanes>(
    lanes: L,
    shape: &Shape,
    block: usize,
    (rows, reading): (&[Row], &Reading),
    read: &mut [f32],
) {
    let length = rows.len();
    let first_bin = (shape.first_bin + (block * GROUP) as isize) as f32;
    let plane = stride(reading.lines.len());
    let read = &mut read[2 * plane * block * GROUP..];
    for part in (0..GROUP).step_by(L::COUNT) {
        let mut bin = [0.0f32; GROUP];
        for (i, bin) in bin.iter_mut().enumerate() {
            let at = (first_bin + (part + i) as f32) * reading.bin_scale;
            *bin = at.max(reading.clamp[0]).min(reading.clamp[1]);
        }
        let bin = lanes.load(&bin);
        for (group, curves) in reading.curves.chunks(L::COUNT).enumerate() {
            let [mut real, mut imaginary] = [[lanes.splat(0.0); GROUP]; 2];
            for (line, curve) in curves.iter().enumerate() {
                let mut range = lanes.splat(curve.terms[TERMS - 1]);
                for &term in curve.terms[..TERMS - 1].iter().rev() {
                    range = lanes.mul_add(bin, range, lanes.splat(term));
                }
                let window =
                    Window::<L, TAPS>::new(lanes, shape.range.polynomials(), curve.start, range);
                // Elements are fewer than two periods.
                let first = window.first.rem_euclid(length as isize) as usize;
                [real[line], imaginary[line]] = sum_elements!(lanes, window, TAPS, |i| {
                    let row = first + i;
                    let from = &rows[if row < length {
                        row
                    } else {
                        (row - length) % length
                    }];
                    [&from[part..], &from[GROUP + part..]]
                });
            }
            transpose(lanes, &mut real);
            transpose(lanes, &mut imaginary);
            for i in 0..L::COUNT {
                let to = &mut read[2 * plane * (part + i) + group * L::COUNT..];
                lanes.store(real[i], to);
                lanes.store(imaginary[i], &mut to[plane..]);
            }
        }
    }
}

/// Interpolate in Doppler at every pixel, restore the carrier phase and add.
#[inline(always)]
fn read_stations<L: Lanes>(
    lanes: L,
    shape: &Shape,
    reading: &Reading,
    read: &[f32],
    pixels: &mut [f32],
) {
    let phasor = Polynomials::new(lanes);
    let (plane, pixel_plane) = (
        stride(reading.lines.len()),
        pixel_stride(reading.lines.len()),
    );
    let first_bin = shape.first_bin as f64;
    for (station, pixels) in reading
        .stations
        .iter()
        .zip(pixels.chunks_exact_mut(2 * pixel_plane))
    {
        let (pixels_re, pixels_im) = pixels.split_at_mut(pixel_plane);
        for (group, own) in reading.lines.chunks(GROUP).enumerate() {
            let mut at = [0.0f64; GROUP];
            at[..own.len()].copy_from_slice(own);
            // Lanes beyond the last line repeat it.
            at[own.len()..].fill(own[own.len() - 1]);
            let (mut turns, mut bins) = ([0.0f32; GROUP], [0.0f32; GROUP]);
            for ((turns, bins), &at) in turns.iter_mut().zip(&mut bins).zip(&at) {
                let mut cycles = station.cycles[TERMS - 1];
                let mut bin = station.bins[TERMS - 1];
                for i in (0..TERMS - 1).rev() {
                    cycles = cycles.mul_add(at, station.cycles[i]);
                    bin = bin.mul_add(at as f32, station.bins[i]);
                }
                *turns = (cycles - nearest(cycles)) as f32;
                *bins = bin;
            }
            for part in (0..GROUP).step_by(L::COUNT) {
                let start = station.start - first_bin;
                let window = Window::<L, DOPPLER_TAPS>::new(
                    lanes,
                    shape.doppler.polynomials(),
                    start,
                    lanes.load(&bins[part..]),
                );
                let first = usize::try_from(window.first).expect("a bin of the map") * 2 * plane;
                let at = first + group * GROUP + part;
                let [re, im] = sum_elements!(lanes, window, DOPPLER_TAPS, |i| {
                    let from = &read[at + 2 * plane * i..];
                    [from, &from[plane..]]
                });
                let [cos, sin] = phasor.at(lanes, lanes.load(&turns[part..]));
                let real = lanes.neg_mul_add(im, sin, lanes.mul(re, cos));
                let imaginary = lanes.mul_add(im, cos, lanes.mul(re, sin));
                let (to_re, to_im) = (
                    &mut pixels_re[group * GROUP + part..],
                    &mut pixels_im[group * GROUP + part..],
                );
                lanes.store(lanes.add(lanes.load(to_re), real), to_re);
                lanes.store(lanes.add(lanes.load(to_im), imaginary), to_im);
            }
        }
    }
}

/// Write pixels `[station][real, imaginary][stride of the lines]` as complex rows, one for each line of `stations` pixels, or one for each
/// station of `lines` pixels if `by_stations`.
///
/// # Panics
/// If `rows` or `pixels` do not have these pixels.
pub fn to_rows(
    instructions: Instructions,
    (pixels, stations, lines): (&[f32], usize, usize),
    by_stations: bool,
    rows: &mut [Complex32],
) {
    assert_eq!(pixels.len(), 2 * stations * pixel_stride(lines));
    assert_eq!(rows.len(), stations * lines);
    instructions.run(ToRows {
        pixels,
        stations,
        lines,
        by_stations,
        rows,
    });
}

struct ToRows<'a> {
    pixels: &'a [f32],
    stations: usize,
    lines: usize,
    by_stations: bool,
    rows: &'a mut [Complex32],
}

impl Kernel for ToRows<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self {
            pixels,
            stations,
            lines,
            by_stations,
            rows,
        } = self;
        let plane = pixel_stride(lines);
        if by_stations {
            let planes = pixels.chunks_exact(2 * plane);
            for (row, planes) in rows.chunks_exact_mut(lines).zip(planes) {
                let (re, im) = planes.split_at(plane);
                for (z, (&re, &im)) in row.iter_mut().zip(re.iter().zip(im)) {
                    *z = Complex32::new(re, im);
                }
            }
            return;
        }
        for line in (0..lines).step_by(L::COUNT) {
            for station in (0..stations).step_by(L::COUNT) {
                let [mut re, mut im] = [[lanes.splat(0.0); GROUP]; 2];
                for i in 0..L::COUNT.min(stations - station) {
                    let from = &pixels[2 * plane * (station + i) + line..];
                    re[i] = lanes.load(from);
                    im[i] = lanes.load(&from[plane..]);
                }
                transpose(lanes, &mut re);
                transpose(lanes, &mut im);
                for i in 0..L::COUNT.min(lines - line) {
                    let mut own = [0.0f32; 2 * GROUP];
                    let [low, high] = lanes.zip(re[i], im[i]);
                    lanes.store(low, &mut own);
                    lanes.store(high, &mut own[L::COUNT..]);
                    let first = (line + i) * stations + station;
                    let count = L::COUNT.min(stations - station);
                    let pairs = own.as_chunks::<2>().0.iter();
                    for (z, &[re, im]) in rows[first..first + count].iter_mut().zip(pairs) {
                        *z = Complex32::new(re, im);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Numbers, turned, wide};
    use num_complex::Complex64;

    /// A patch of 21 lines by 37 stations whose paths are exactly `alpha a + beta b`, with 100 pulses of 70 samples. The oracle is the
    /// defining sum in float64.
    #[test]
    fn image_of_patch_agrees_with_defining_sum() {
        let mut numbers = Numbers::new(7);
        let (num_pulses, count) = (100usize, 70usize);
        let layout = decimation::Layout::new(count, 2);
        let (step, centre) = (0.02, 35.0);
        // Frequencies in cycles per metre of path.
        let frequency = |k: f64| 30.0 + (k - centre) * step;
        let [a_m, b_m] = [13.0, 0.32];
        let ranges = |t: f64, s: f64| [a_m * t + 0.8 * s * s, b_m * s * (1.0 + 0.03 * t)];
        let pulses: Vec<[f64; 2]> = (0..num_pulses)
            .map(|n| {
                let u = (n as f64 - 49.5) / 49.5;
                let jitter = 0.02 * numbers.signed();
                [1.0 - 8e-4 * u * u, 2.1 * (u + jitter)]
            })
            .collect();
        let samples: Vec<Vec<Complex32>> = pulses.iter().map(|_| numbers.samples(count)).collect();
        // Oversampling of the columns 1 / (2 * 0.02 * 13.9) = 1.8.
        let flat = FlatKernel::new(12, 1.7);
        let doppler = FlatKernel::new(12, 1.6);
        let [gridding, kernel] = [1.6, 1.6].map(|s| KaiserBessel::oversampled(TAPS, s));
        let row_step = 1.0 / (1.65 * 2.0 * b_m * 1.03);
        let columns = 96;
        let lines: Vec<f64> = (0..21).map(|i| i as f64 / 10.0 - 1.0).collect();
        let stations: Vec<f64> = (0..37).map(|i| i as f64 / 18.0 - 1.0).collect();
        let rows = (30.7 * 2.2 * 2.0 / row_step) as usize + TAPS + 5;
        let bins = (1.62 * rows as f64 / 1.65) as usize / GROUP * GROUP + 2 * GROUP;
        let over_rows = ColumnFft::new(subaperture_signal::fast_length::fast_length(
            ((1.62 * rows as f64) as usize).max(bins),
        ));
        let over_columns = ColumnFft::new(160);
        let shape = Shape {
            samples: layout,
            first_column: -(columns as isize) / 2,
            columns,
            first_row: -(rows as isize) / 2,
            rows,
            first_bin: -(bins as isize) / 2,
            bins,
            over_rows: &over_rows,
            over_columns: &over_columns,
            flat: &flat,
            gridding: &gridding,
            range: &kernel,
            doppler: &doppler,
        };
        let weight = vec![1.0; count];
        let mut history = vec![0.0; num_pulses * layout.values()];
        let mut positions = Vec::new();
        let each = history.chunks_exact_mut(layout.values());
        for ((row, samples), &[alpha, beta]) in each.zip(&samples).zip(&pulses) {
            layout.spread(samples, &weight, 1.0, row);
            let ratio = beta / alpha;
            positions.push(PulseLine {
                column: (frequency(0.0) * alpha - 30.0) / step,
                columns_a_sample: alpha,
                row: 30.0 * ratio / row_step,
                rows_a_column: step * ratio / row_step,
            });
        }
        let bins_m = row_step * over_rows.len() as f64;
        let range_bins_m = step * over_columns.len() as f64;
        let curves: Vec<Curve> = lines
            .iter()
            .map(|&t| {
                let range = a_m * t * range_bins_m;
                let start = range.round();
                let bend = 0.8 / (b_m * (1.0 + 0.03 * t)).powi(2) * range_bins_m;
                Curve {
                    start,
                    terms: [(range - start) as f32, 0.0, bend as f32, 0.0, 0.0],
                }
            })
            .collect();
        let reading = Reading {
            curves: &curves,
            bin_scale: (1.0 / bins_m) as f32,
            clamp: [-0.4, 0.4],
            stations: &stations
                .iter()
                .map(|&s| {
                    let mut station = Station {
                        start: (b_m * s * bins_m).round(),
                        ..Station::default()
                    };
                    station.bins[0] = (b_m * s * bins_m - station.start) as f32;
                    station.bins[1] = (b_m * s * bins_m * 0.03) as f32;
                    station.cycles[0] = 30.0 * 0.8 * s * s;
                    station.cycles[1] = 30.0 * a_m;
                    station
                })
                .collect::<Vec<_>>(),
            lines: &lines,
        };
        let image = |instructions| {
            let mut pixels = vec![0.0; 2 * stations.len() * pixel_stride(lines.len())];
            let mut scratch = PatchMapScratch::default();
            for _ in 0..2 {
                pixels.fill(0.0);
                let all = (&positions[..], &history[..]);
                add_patch(
                    instructions,
                    &shape,
                    all,
                    &reading,
                    &mut scratch,
                    &mut pixels,
                );
            }
            let pixels = (&pixels[..], stations.len(), lines.len());
            let [mut by_line, mut by_station] = [(); 2].map(|()| vec![Complex32::ZERO; 21 * 37]);
            to_rows(instructions, pixels, false, &mut by_line);
            to_rows(instructions, pixels, true, &mut by_station);
            for (i, z) in by_line.iter().enumerate() {
                assert_eq!(*z, by_station[i % 37 * 21 + i / 37]);
            }
            by_line
        };
        let got = image(Instructions::Portable);
        for instructions in Instructions::available() {
            assert_eq!(image(instructions), got, "{instructions:?}");
        }
        let (mut error, mut power) = (0.0, 0.0);
        for (i, &s) in stations.iter().enumerate() {
            for (j, &t) in lines.iter().enumerate() {
                let [a, b] = ranges(t, s);
                let mut expected = Complex64::ZERO;
                for (samples, [alpha, beta]) in samples.iter().zip(&pulses) {
                    for (k, &z) in samples.iter().enumerate() {
                        expected += wide(z) * turned(frequency(k as f64) * (alpha * a + beta * b));
                    }
                }
                error += (wide(got[37 * j + i]) - expected).norm_sqr();
                power += expected.norm_sqr();
            }
        }
        let kernels = [
            flat.error(),
            gridding.error(0.5 / 1.65),
            kernel.error(0.5 / 1.62),
        ];
        let allowed = (kernels.iter().map(|e| e * e).sum::<f64>() + doppler.error().powi(2)).sqrt();
        let db = |x: f64| 20.0 * x.log10();
        let relative = (error / power).sqrt();
        println!("{:.1} dB, kernels {:.1} dB", db(relative), db(allowed));
        assert!(relative < 1.5 * allowed + 1e-6);
    }
}
