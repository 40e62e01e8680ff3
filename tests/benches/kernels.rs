//! The kernel of backprojection by itself, on one thread, in each instruction set that the processor has.
//!
//! `cargo bench --bench kernels [-- PREFIX]`: of the lines that begin so, at greater length. A group is 16 pixels of one pulse. The beam
//! comes along the columns, and turned by so many degrees.

use std::hint::black_box;
use std::time::Instant;

use subaperture::num_complex::Complex32;
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

fn main() {
    let prefix = std::env::args().skip(1).find(|arg| !arg.starts_with("--"));
    let prefix = prefix.unwrap_or_default();
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
