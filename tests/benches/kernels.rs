//! Kernels by themselves, on one thread, in each instruction set that the processor has.
//!
//! `cargo bench --bench kernels [-- PREFIX]`: of the lines that begin so, at greater length. Of backprojection a group is 16 pixels of one pulse. The beam
//! comes along the columns, and turned by so many degrees.

use std::hint::black_box;
use std::time::Instant;

use subaperture::num_complex::{Complex32, Complex64};
use subaperture_kernels::halving::{Halving, HalvingScratch, Layout, Rows, Turning, halved};
use subaperture_kernels::horner;
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::paths::Antennas;
use subaperture_kernels::tile::{Pieces, Raster, TilePulse, TileScratch};

const PULSES: usize = 64;
const BINS: usize = 12_288;
/// A quarter of the resolution of 600 MHz.
const BIN_M: f64 = 0.125;
const PIXEL_M: f64 = 0.2;
const CARRIER_CYCLES_M: f64 = 33.3;

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

/// Halving and narrow sums: nanoseconds a sample before.
fn samples(prefix: &str) {
    println!("instructions kernel    ways    pulses x samples    a sample");
    for instructions in Instructions::available() {
        for [num_pulses, num_samples] in [[128, 4096], [256, 520], [112, 104], [64, 60]] {
            let layout = Layout::new(num_samples);
            let values = vec![0.5; num_pulses * layout.values()];
            let turning = Turning {
                start: 0.3,
                step: 0.01,
            };
            let turnings = vec![turning; num_pulses];
            let recorded = vec![Complex32::ONE; num_pulses * num_samples];
            let [fast, slow] = [num_samples, num_pulses].map(|count| vec![1.0; count]);
            for (ways, pulses, samples) in [
                ("turn", false, false),
                ("pulses", true, false),
                ("samples", false, true),
                ("both", true, true),
                ("recorded", true, true),
            ] {
                let name = format!(
                    "{:<12} halving   {ways:<8} {num_pulses:>5} x {num_samples:<5}",
                    instructions.name()
                );
                if !name.starts_with(prefix) {
                    continue;
                }
                let halving = Halving {
                    pulses,
                    samples,
                    layout,
                    rows: match ways {
                        "recorded" => Rows::Samples {
                            samples: &recorded,
                            fast: &fast,
                            slow: &slow,
                        },
                        _ => Rows::Planes(&values),
                    },
                    first: 0,
                    turnings: &turnings,
                };
                let count = if pulses {
                    halved(num_pulses, 8)
                } else {
                    num_pulses
                };
                let mut out = vec![0.0; count * halving.after(8).values()];
                let mut scratch = HalvingScratch::default();
                let ns = shortest_ns(num_pulses * num_samples, || {
                    halving.make(instructions, &[0.1f32; 8], 0, &mut out, &mut scratch);
                });
                println!("{name} {ns:>12.3} ns");
            }
            let name = format!("{:<12} narrow sums of 64", instructions.name());
            if name.starts_with(prefix) && num_samples == 4096 {
                let row = vec![Complex32::ONE; num_samples];
                let weights = vec![1.0; num_samples];
                let steps = [Complex64::ONE; horner::NARROW_TOGETHER];
                let ns = shortest_ns(num_samples, || {
                    black_box(horner::narrow_sums(instructions, &row, &weights, &steps));
                });
                println!("{name:<40} {ns:>12.3} ns");
            }
        }
    }
}

/// Nanoseconds each of `count` that `work` does, in the best of some turns.
fn shortest_ns(count: usize, mut work: impl FnMut()) -> f64 {
    let times = 4_000_000 / count + 1;
    let turns = (0..5).map(|_| {
        let start = Instant::now();
        (0..times).for_each(|_| work());
        start.elapsed().as_secs_f64() / (times * count) as f64
    });
    1e9 * turns.fold(f64::INFINITY, f64::min)
}

fn main() {
    let prefix = std::env::args().skip(1).find(|arg| !arg.starts_with("--"));
    let prefix = prefix.unwrap_or_default();
    samples(&prefix);
    println!("instructions degree phasors  tile   turned    a group     GBP/s");
    for instructions in Instructions::available() {
        for (degree, coarse) in [(2, true), (2, false), (3, true), (3, false)] {
            for (side, turned_deg) in [(64, 0.0), (32, 0.0), (16, 0.0), (64, 30.0), (64, 45.0)] {
                let phasors = if coarse { "coarse" } else { "fine" };
                let name = format!(
                    "{:<12} {degree:>6} {phasors:>7} {side:>5} {turned_deg:>4} deg",
                    instructions.name()
                );
                if !name.starts_with(&prefix) {
                    continue;
                }
                let raster = Raster {
                    centre_m: [0.0; 3],
                    along_m: [PIXEL_M, 0.0, 0.0],
                    across_m: [0.0, PIXEL_M, 0.0],
                    rows: side,
                    columns: side,
                };
                let margin = Pieces::margin_for(&raster, 1.0 / BIN_M);
                let layout = Pieces::new(degree, BINS, margin);
                let pulses = pulses(turned_deg);
                let pieces = vec![0.5; PULSES * layout.values()];
                let mut scratch = TileScratch::default();
                let mut sums = vec![Complex32::ZERO; side * side];
                let tiles = 4096 / (side * side) * if prefix.is_empty() { 4 } else { 400 };
                let turns = if instructions == Instructions::Portable {
                    1
                } else {
                    5
                };
                let seconds = (0..turns).map(|_| {
                    let start = Instant::now();
                    for _ in 0..tiles {
                        scratch.look(BINS, &pulses, &raster);
                        scratch.add(instructions, &layout, coarse, &pulses, &pieces, &mut sums);
                    }
                    start.elapsed().as_secs_f64() / tiles as f64
                });
                let shortest = seconds.fold(f64::INFINITY, f64::min);
                black_box(&sums);
                let pairs = (PULSES * side * side) as f64;
                println!(
                    "{name} {:>7.2} ns {:>9.2}",
                    shortest / pairs * 16e9,
                    pairs / shortest * 1e-9
                );
            }
        }
    }
}
