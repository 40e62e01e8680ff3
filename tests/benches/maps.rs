//! Keystone and range-Doppler map of a sub-CPI: the embedded core's on this machine, and the host's. One thread.
//!
//! `cargo bench --bench maps`. An item is a recorded sample.

use divan::Bencher;
use divan::counter::ItemsCount;
use subaperture::module::range_doppler::RangeDopplerMapper;
use subaperture::num_complex::Complex32;
use subaperture::phase_history::Band;
use subaperture::signal::window::Window;
use subaperture_core::keystone::KeystoneTable;
use subaperture_core::{Params, Plan, Shape, Tables};

/// Seconds for one line of the table.
const LONGEST_S: f64 = 0.5;

/// Pulses and samples: a sub-CPI of Schone's Table 4.1, and one of GOTCHA.
const SIZES: [[usize; 2]; 2] = [[40, 256], [40, 424]];

const BAND: Band = Band {
    start_hz: 9.288e9,
    step_hz: 1.4714e6,
    count: 0,
};

fn main() {
    divan::main();
}

/// Maps twice as large as the data, as in `subap crosscheck`.
fn shape([num_pulses, num_frequencies]: [usize; 2]) -> Shape {
    Shape {
        num_pulses,
        num_frequencies,
        num_range_bins: (2 * num_frequencies).next_power_of_two(),
        num_doppler_bins: (2 * num_pulses).next_power_of_two(),
    }
}

fn samples(shape: &Shape) -> Vec<Complex32> {
    let phase = |i: usize| (i * i % 1009) as f32 * 0.01;
    let sample = |i| Complex32::new(phase(i).cos(), phase(i).sin());
    (0..shape.history_len()).map(sample).collect()
}

#[divan::bench(args = [0, 1], max_time = LONGEST_S)]
fn of_the_core(bencher: Bencher, size: usize) {
    let shape = shape(SIZES[size]);
    let params = Params {
        start_hz: BAND.start_hz,
        step_hz: BAND.step_hz,
        fast_window: subaperture_core::Window::Hamming,
        slow_window: subaperture_core::Window::Hamming,
    };
    let (mut fast, mut slow) = (
        vec![0.0; shape.num_frequencies],
        vec![0.0; shape.num_pulses],
    );
    let tables = Tables {
        fast_weights: &mut fast,
        slow_weights: &mut slow,
        keystone: KeystoneTable::ChirpZ {
            length: shape.chirp_length(),
        },
    };
    let plan = Plan::new(shape, &params, tables).expect("sizes that the core has");
    let samples = samples(&shape);
    let mut history = vec![Complex32::ZERO; shape.history_len()];
    let mut scratch = vec![Complex32::ZERO; plan.scratch_len()];
    let mut map = vec![Complex32::ZERO; shape.map_len()];
    bencher
        .counter(ItemsCount::new(samples.len()))
        .bench_local(|| {
            for (m, pulse) in samples.chunks_exact(shape.num_frequencies).enumerate() {
                plan.window(m, pulse, &mut history).unwrap();
            }
            plan.process(&history, &mut scratch, &mut map)
                .expect("buffers of the lengths it states");
        });
}

#[divan::bench(args = [0, 1], max_time = LONGEST_S)]
fn of_the_host(bencher: Bencher, size: usize) {
    let shape = shape(SIZES[size]);
    let window = Window::Hamming;
    let band = Band {
        count: shape.num_frequencies,
        ..BAND
    };
    let mut mapper = RangeDopplerMapper::new(
        &band,
        &window.weights(shape.num_frequencies),
        &window.weights(shape.num_pulses),
        shape.num_range_bins,
        shape.num_doppler_bins,
    );
    let samples = samples(&shape);
    let mut map = vec![Complex32::ZERO; shape.map_len()];
    bencher
        .counter(ItemsCount::new(samples.len()))
        .bench_local(|| mapper.map(&samples, &mut map));
}
