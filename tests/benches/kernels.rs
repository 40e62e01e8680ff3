//! The kernels of backprojection by themselves, on one thread.
use std::time::Instant;
use subaperture::num_complex::Complex32;
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::paths::Antennas;
use subaperture_kernels::tile::{Pieces, Raster, TilePulse, TileScratch};

fn main() {
    let only = std::env::var("ONLY").unwrap_or_default();
    for instructions in Instructions::available() {
        for (degree, coarse) in [(1, true), (2, true), (2, false), (3, false), (4, false)] {
            for (side, angle_deg) in [
                (64usize, 0.0f64),
                (32, 0.0),
                (16, 0.0),
                (64, 30.0),
                (64, 45.0),
                (64, 90.0),
            ] {
                let name = format!(
                    "{} degree {degree} {coarse} side {side} {angle_deg}",
                    instructions.name()
                );
                if !name.starts_with(&only) {
                    continue;
                }
                let length = 4096 * 3;
                let bin_m = 0.5 / 4.0;
                let a = angle_deg.to_radians();
                let step = 0.2;
                let raster = Raster {
                    centre_m: [0.0; 3],
                    along_m: [step, 0.0, 0.0],
                    across_m: [0.0, step, 0.0],
                    rows: side,
                    columns: side,
                };
                let layout = Pieces::new(degree, length, 400);
                let pulses: Vec<TilePulse> = (0..64)
                    .map(|n| {
                        let x = n as f64 * 0.1;
                        let at = [
                            1732.0 * a.sin() + x * a.cos(),
                            1732.0 * a.cos() - x * a.sin(),
                            1000.0,
                        ];
                        TilePulse {
                            antennas: Antennas {
                                transmitter_m: at,
                                receiver_m: at,
                                datum_m: 4000.0,
                            },
                            turns_m: 1.0 / bin_m / length as f64,
                            cycles_a_bin: 33.3 * bin_m,
                        }
                    })
                    .collect();
                let pieces = vec![0.5; 64 * layout.values()];
                let mut scratch = TileScratch::default();
                let mut sums = vec![Complex32::ZERO; side * side];
                let mut best = f64::INFINITY;
                for _ in 0..if instructions == Instructions::Portable {
                    1
                } else {
                    7
                } {
                    let start = Instant::now();
                    let times = 4096 / side / side * if only.is_empty() { 4 } else { 1000 };
                    for _ in 0..times {
                        scratch.look(length, &pulses, &raster);
                        scratch.add(instructions, &layout, coarse, &pulses, &pieces, &mut sums);
                    }
                    best = best.min(start.elapsed().as_secs_f64() / times as f64);
                }
                let groups = 64.0 * (side * side / 16) as f64;
                println!(
                    "{:<9} degree {degree} {coarse} side {side} {angle_deg} deg: {:.2} ns a group, {:.2} GBP/s {:?}",
                    instructions.name(),
                    best / groups * 1e9,
                    groups * 16.0 / best * 1e-9,
                    scratch.grouping()
                );
            }
        }
    }
}
