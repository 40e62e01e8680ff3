//! Single kernels on one thread, in each instruction set of the processor.
//!
//! `cargo bench --bench kernels [-- PATTERN]`, for instance `-- tile` or `-- "decimation.*avx512"`. An item is a sample, a point or, in
//! backprojection, a pixel of one pulse; kernels without the name of an instruction set are plain Rust. The line of sight is along the
//! columns of a tile, or rotated by the given degrees.

use std::fmt;

use divan::Bencher;
use divan::counter::ItemsCount;
use subaperture::num_complex::{Complex32, Complex64};
use subaperture::signal::kaiser_bessel::KaiserBessel;
use subaperture::signal::scaled_dft::Shape;
use subaperture_kernels::ceiling;
use subaperture_kernels::compensation::{self, GroupRamp, Ramp};
use subaperture_kernels::decimation::{
    Decimation, DecimationScratch, Layout, PhaseRamp, Rows, Taps, decimated,
};
use subaperture_kernels::doppler::{BLOCK, DopplerProduct, MapRows};
use subaperture_kernels::folded_sums;
use subaperture_kernels::gridding::{Band, Line};
use subaperture_kernels::horner;
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::map::{Map, row_length};
use subaperture_kernels::paths::{self, Antennas, Points};
use subaperture_kernels::power;
use subaperture_kernels::range_migration_blur::{self, Scale, SmearedPosition};
use subaperture_kernels::tile::{Pieces, Raster, TilePulse, TileScratch, add_points};

/// Seconds for one line of the table.
const LONGEST_S: f64 = 0.15;

const PULSES: usize = 64;
const BINS: usize = 12_288;
/// A quarter of the resolution of 600 MHz.
const BIN_M: f64 = 0.125;
const PIXEL_M: f64 = 0.2;
const CARRIER_CYCLES_M: f64 = 33.3;
/// Samples of a pulse.
const SAMPLES: usize = 4096;
/// Number of points: their coordinates stay in the first-level cache.
const POINTS: usize = 1024;

fn main() {
    divan::main();
}

/// A kernel's instruction set and parameters.
struct In<T> {
    instructions: Instructions,
    with: T,
}

impl<T: fmt::Display> fmt::Display for In<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.instructions.name();
        match self.with.to_string() {
            with if with.is_empty() => f.write_str(name),
            with => write!(f, "{name} {with}"),
        }
    }
}

/// Every instruction set with each of these parameters.
fn each<T: Clone>(with: &[T]) -> Vec<In<T>> {
    let all = Instructions::available();
    let each = all.into_iter().flat_map(|instructions| {
        with.iter().map(move |with| In {
            instructions,
            with: with.clone(),
        })
    });
    each.collect()
}

/// Pulses from 2 km away and above, 0.1 m apart.
fn pulses(turned_deg: f64) -> Vec<TilePulse> {
    let (sin, cos) = turned_deg.to_radians().sin_cos();
    let pulse = |n: usize| {
        let along_m = n as f64 * 0.1;
        let at_m = [
            1732.0 * sin + along_m * cos,
            1732.0 * cos - along_m * sin,
            1000.0,
        ];
        TilePulse {
            antennas: Antennas {
                transmitter_m: at_m,
                receiver_m: at_m,
                datum_m: 4000.0,
            },
            turns_m: 1.0 / (BIN_M * BINS as f64),
            cycles_a_bin: CARRIER_CYCLES_M * BIN_M,
        }
    };
    (0..PULSES).map(pulse).collect()
}

fn points() -> Points {
    let mut points = Points::default();
    for i in 0..POINTS {
        points.push([i as f64 * PIXEL_M, 3.0, 0.0]);
    }
    points
}

#[derive(Clone)]
struct Tile {
    degree: usize,
    side: usize,
    turned_deg: f64,
}

impl fmt::Display for Tile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            degree,
            side,
            turned_deg,
            ..
        } = self;
        write!(f, "degree {degree} side {side} at {turned_deg} deg")
    }
}

fn tiles() -> Vec<In<Tile>> {
    let mut tiles = Vec::new();
    for degree in [2, 3] {
        for (side, turned_deg) in [(64, 0.0), (32, 0.0), (16, 0.0), (64, 30.0), (64, 45.0)] {
            tiles.push(Tile {
                degree,
                side,
                turned_deg,
            });
        }
    }
    each(&tiles)
}

/// Preparation and addition of the pulses on a tile.
#[divan::bench(args = tiles(), max_time = LONGEST_S)]
fn tile(bencher: Bencher, tile: &In<Tile>) {
    let &In {
        instructions,
        with: Tile {
            degree,
            side,
            turned_deg,
        },
    } = tile;
    let raster = Raster {
        centre_m: [0.0; 3],
        along_m: [PIXEL_M, 0.0, 0.0],
        across_m: [0.0, PIXEL_M, 0.0],
        rows: side,
        columns: side,
    };
    let layout = Pieces::new(degree, BINS, Pieces::margin_for(&raster, 1.0 / BIN_M));
    let pulses = pulses(turned_deg);
    let pieces = vec![0.5; PULSES * layout.values()];
    let mut scratch = TileScratch::default();
    let mut sums = vec![Complex32::ZERO; side * side];
    let pairs = PULSES * side * side;
    bencher.counter(ItemsCount::new(pairs)).bench_local(|| {
        scratch.look(BINS, &pulses, &raster);
        scratch.add(instructions, &layout, &pulses, &pieces, &mut sums);
    });
}

/// Spline coefficients of a pulse's range profile.
#[divan::bench(args = each(&[2, 3]), max_time = LONGEST_S)]
fn pieces(
    bencher: Bencher,
    &In {
        instructions,
        with: degree,
    }: &In<usize>,
) {
    let layout = Pieces::new(degree, BINS, 64);
    let profile = vec![Complex32::ONE; BINS];
    let mut pieces = vec![0.0; layout.values()];
    bencher
        .counter(ItemsCount::new(BINS))
        .bench_local(|| layout.make(instructions, &profile, 1.0, &mut pieces));
}

/// A pulse at scattered points.
#[divan::bench(args = each(&[2, 3]), max_time = LONGEST_S)]
fn scattered_points(
    bencher: Bencher,
    &In {
        instructions,
        with: degree,
    }: &In<usize>,
) {
    let layout = Pieces::new(degree, BINS, 64);
    let (pulses, points) = (pulses(0.0), points());
    let pieces = vec![0.5; layout.values()];
    let mut sums = vec![Complex32::ZERO; POINTS];
    bencher.counter(ItemsCount::new(POINTS)).bench_local(|| {
        add_points(
            instructions,
            &layout,
            &pulses[0],
            &pieces,
            &points,
            &mut sums,
        )
    });
}

#[derive(Clone, Copy)]
struct DecimationCase {
    name: &'static str,
    /// Decimation factor over pulses, and factor over samples if they are decimated.
    pulses: usize,
    samples: Option<usize>,
    num_pulses: usize,
    num_samples: usize,
}

impl fmt::Display for DecimationCase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            num_pulses,
            num_samples,
            ..
        } = self;
        write!(f, "{name} of {num_pulses} x {num_samples}")
    }
}

fn decimations() -> Vec<In<DecimationCase>> {
    let mut decimations = Vec::new();
    for [num_pulses, num_samples] in [[128, 4096], [256, 520], [112, 104], [64, 60]] {
        for (name, pulses, samples) in [
            ("turn", 1, None),
            ("pulses", 2, None),
            ("samples", 1, Some(2)),
            ("both", 2, Some(2)),
            ("both by three", 3, Some(3)),
            ("recorded", 2, Some(2)),
        ] {
            decimations.push(DecimationCase {
                name,
                pulses,
                samples,
                num_pulses,
                num_samples,
            });
        }
    }
    each(&decimations)
}

/// Items are samples before decimation.
#[divan::bench(args = decimations(), max_time = LONGEST_S)]
fn decimation(
    bencher: Bencher,
    &In {
        instructions,
        with: case,
    }: &In<DecimationCase>,
) {
    let (num_pulses, num_samples) = (case.num_pulses, case.num_samples);
    let layout = Layout::new(num_samples, case.samples.unwrap_or(2));
    let values = vec![0.5; num_pulses * layout.values()];
    let turning = PhaseRamp {
        start: 0.3,
        step: 0.01,
    };
    let phase_ramps = vec![turning; num_pulses];
    let recorded = vec![Complex32::ONE; num_pulses * num_samples];
    let [fast, slow] = [num_samples, num_pulses].map(|count| vec![1.0; count]);
    let decimation = Decimation {
        pulses: case.pulses,
        samples: case.samples.is_some(),
        layout,
        rows: match case.name {
            "recorded" => Rows::Samples {
                samples: &recorded,
                fast: &fast,
                slow: &slow,
            },
            _ => Rows::Planes(&values),
        },
        first: 0,
        phase_ramps: &phase_ramps,
    };
    let count = match case.pulses {
        1 => num_pulses,
        factor => decimated(num_pulses, factor, 8),
    };
    let mut out = vec![0.0; count * decimation.after(8).values()];
    let mut scratch = DecimationScratch::default();
    let taps = Taps {
        half: [0.1f32; 8],
        third: [0.1f32; 8],
    };
    bencher
        .counter(ItemsCount::new(num_pulses * num_samples))
        .bench_local(|| decimation.make(instructions, &taps, 0, &mut out, &mut scratch));
}

/// A pulse at 64 delays in float32; an item is a sample for all delays.
#[divan::bench(args = each(&[""]), max_time = LONGEST_S)]
fn folded_sums_of_64(bencher: Bencher, &In { instructions, .. }: &In<&str>) {
    let row = vec![Complex32::ONE; SAMPLES];
    let weights = vec![1.0; SAMPLES];
    let turns = [0.25; folded_sums::TOGETHER];
    bencher
        .counter(ItemsCount::new(SAMPLES))
        .bench_local(|| folded_sums::folded_sums(instructions, &row, &weights, &turns));
}

/// A pulse at 16 delays in float64; an item is a sample for all delays.
#[divan::bench(args = each(&[""]), max_time = LONGEST_S)]
fn sums_of_16(bencher: Bencher, &In { instructions, .. }: &In<&str>) {
    let row = vec![Complex32::ONE; SAMPLES];
    let weights = vec![1.0; SAMPLES];
    let steps = [Complex64::ONE; horner::TOGETHER];
    bencher
        .counter(ItemsCount::new(SAMPLES))
        .bench_local(|| horner::sums(instructions, &row, &weights, &steps));
}

#[divan::bench(args = each(&[""]), max_time = LONGEST_S)]
fn power(bencher: Bencher, &In { instructions, .. }: &In<&str>) {
    let row = vec![Complex32::ONE; SAMPLES];
    let weights = vec![1.0; SAMPLES];
    bencher
        .counter(ItemsCount::new(SAMPLES))
        .bench_local(|| power::power(instructions, &row, &weights));
}

#[divan::bench(max_time = LONGEST_S)]
fn paths_of_a_pulse(bencher: Bencher) {
    let (pulses, points) = (pulses(0.0), points());
    let mut paths_m = vec![0.0; POINTS];
    bencher.counter(ItemsCount::new(POINTS)).bench_local(|| {
        paths::paths(&pulses[0].antennas, points.part(0..POINTS), &mut paths_m);
    });
}

#[divan::bench(args = each(&[""]), max_time = LONGEST_S)]
fn lines_of_a_sub_cpi(bencher: Bencher, &In { instructions, .. }: &In<&str>) {
    let (pulses, points) = (pulses(0.0), points());
    let ends = [pulses[0].antennas, pulses[PULSES - 1].antennas];
    let mut lines = vec![paths::Line::default(); POINTS];
    bencher.counter(ItemsCount::new(POINTS)).bench_local(|| {
        paths::lines(
            instructions,
            &ends,
            (PULSES - 1) as f64,
            &points,
            &mut lines,
        );
    });
}

/// Interpolation between two profiles of a pulse (range migration blur).
#[divan::bench(max_time = LONGEST_S)]
fn blurred_points(bencher: Bencher) {
    let profiles = vec![Complex32::ONE; 2 * (BINS + 1)];
    let scale = Scale {
        cycles_m: CARRIER_CYCLES_M,
        weight: 1.0,
    };
    let point = |i: usize| SmearedPosition {
        path_m: i as f64 * PIXEL_M,
        turns: i as f64 * 1e-4,
        level: 0.5,
    };
    let points: Vec<SmearedPosition> = (0..POINTS).map(point).collect();
    let mut sums = vec![Complex32::ZERO; POINTS];
    bencher
        .counter(ItemsCount::new(POINTS))
        .bench_local(|| range_migration_blur::add(&profiles, BINS, &scale, &points, &mut sums));
}

#[divan::bench(max_time = LONGEST_S)]
fn compensation_of_a_pulse(bencher: Bencher) {
    let mut samples = vec![Complex32::ONE; SAMPLES];
    let weights = vec![1.0; SAMPLES];
    let ramp = Ramp::new(0.3, 0.01, 1.0);
    bencher
        .counter(ItemsCount::new(SAMPLES))
        .bench_local(|| compensation::refer(&mut samples, &weights, ramp));
}

/// A block of samples of some pulses, into planes.
#[divan::bench(args = each(&[""]), max_time = LONGEST_S)]
fn compensation_of_a_block(bencher: Bencher, &In { instructions, .. }: &In<&str>) {
    let samples = vec![Complex32::ONE; PULSES * BLOCK];
    let weights = vec![1.0; BLOCK];
    let mut ramps = vec![GroupRamp::new(Ramp::new(0.3, 0.01, 1.0)); PULSES];
    let mut planes = vec![0.0; 2 * BLOCK * PULSES];
    bencher
        .counter(ItemsCount::new(samples.len()))
        .bench_local(|| {
            let out = &mut planes;
            compensation::refer_to_planes(
                instructions,
                &samples,
                BLOCK,
                &weights,
                &mut ramps,
                out,
                BLOCK,
            );
        });
}

/// Doppler transform of a block; items are pulses times bins.
#[divan::bench(args = each(&[17, 33, 65]), max_time = LONGEST_S)]
fn doppler_product(bencher: Bencher, of: &In<usize>) {
    let outputs = of.with;
    let shape = Shape {
        inputs: PULSES,
        input_centre: (PULSES as f64 - 1.0) / 2.0,
        input_drift: 0.0,
        outputs,
        output_centre: (outputs / 2) as f64,
        spacing: 0.5 / PULSES as f64,
    };
    let product = DopplerProduct::new(&[1.0; BLOCK], &shape, |_, _| 1.0);
    let planes = vec![0.5; 2 * BLOCK * PULSES];
    let mut scratch = vec![0.0; product.scratch_length()];
    let mut values = vec![0.0; 2 * outputs * BLOCK];
    bencher
        .counter(ItemsCount::new(BLOCK * PULSES * outputs))
        .bench_local(|| {
            let mut map = MapRows {
                values: &mut values,
                row_length: BLOCK,
                length: BLOCK,
                first: 0,
            };
            product.transform(of.instructions, 0, &planes, &mut scratch, &mut map);
        });
}

/// Gridding of a pulse's samples along a slanted line of a raster; the constant is the number of taps.
#[divan::bench(consts = [4, 6, 8], args = each(&[""]), max_time = LONGEST_S)]
fn spreading<const W: usize>(bencher: Bencher, &In { instructions, .. }: &In<&str>) {
    const COLUMNS: usize = 1024;
    const ROWS: usize = 512;
    let kernel = KaiserBessel::new(W);
    let samples = vec![Complex32::ONE; 1000];
    let line = Line {
        start: [100.3, 10.7],
        step: [0.31, 0.97],
    };
    let mut cells = vec![0.0; 2 * ROWS * COLUMNS];
    bencher
        .counter(ItemsCount::new(samples.len()))
        .bench_local(|| {
            let mut band = Band {
                first_row: 0,
                columns: COLUMNS,
                cells: &mut cells,
            };
            band.spread::<W>(instructions, &kernel, &line, &samples);
        });
}

/// Interpolation of points in a range-Doppler map; the constant is the number of taps.
#[divan::bench(consts = [4, 6], args = each(&[""]), max_time = LONGEST_S)]
fn map_reading<const W: usize>(bencher: Bencher, &In { instructions, .. }: &In<&str>) {
    const DOPPLER: usize = 128;
    const LENGTH: usize = 512;
    let kernel = KaiserBessel::new(W);
    let values = vec![1.0; 2 * DOPPLER * row_length(LENGTH)];
    let map = Map::<W> {
        values: &values,
        length: LENGTH,
        kernel: &kernel,
        cycles_m: CARRIER_CYCLES_M,
        bins_per_cycle: DOPPLER as f64,
        zero_bin: DOPPLER as f64 / 2.0,
        range_bins_m: 1.0 / BIN_M,
    };
    let line = |i: usize| paths::Line {
        path_m: i as f64 * PIXEL_M,
        rate_m: (i % 64) as f64 * 1e-4,
    };
    let lines: Vec<paths::Line> = (0..POINTS).map(line).collect();
    let mut pixels = vec![Complex32::ZERO; POINTS];
    bencher
        .counter(ItemsCount::new(POINTS))
        .bench_local(|| map.add(instructions, &lines, &mut pixels, |_| Complex32::ZERO));
}

/// Upper limit of every kernel: items are products with sums.
#[divan::bench(args = each(&[""]), max_time = LONGEST_S)]
fn ceiling_of_multiply_adds(bencher: Bencher, &In { instructions, .. }: &In<&str>) {
    const ROUNDS: usize = 10_000;
    let count = ceiling::a_round(instructions) * ROUNDS;
    bencher.counter(ItemsCount::new(count)).bench_local(|| {
        ceiling::multiply_adds(
            instructions,
            divan::black_box(0.5),
            divan::black_box(1.0),
            ROUNDS,
        )
    });
}
