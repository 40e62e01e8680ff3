//! Golden checksums of kernel results on deterministic input, identical in all instruction sets on every
//! machine. The tests of each kernel show accuracy; an intended change of arithmetic changes the checksums, and the failure message
//! prints the new ones.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};
use subaperture_kernels::compensation::{GroupRamp, Ramp, refer_to_planes};
use subaperture_kernels::doppler::{BLOCK, DopplerProduct, MapRows};
use subaperture_kernels::folded_sums::{self, folded_sums};
use subaperture_kernels::gridding::{self, Band};
use subaperture_kernels::horner::{TOGETHER, sums};
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::map::{Map, row_length};
use subaperture_kernels::paths::Line;
use subaperture_kernels::power::power;
use subaperture_kernels::tile::DEGREES;
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::scaled_dft::Shape;

use crate::decimation::{Case, MODES};
use crate::tile::{Trial, points};
use crate::trial::Numbers;

/// Order-dependent checksum (FNV-1a) over integers.
struct Sum(u64);

impl Sum {
    fn new() -> Self {
        Self(0xCBF2_9CE4_8422_2325)
    }

    fn add(&mut self, bits: u64) {
        self.0 = (self.0 ^ bits).wrapping_mul(0x0100_0000_01B3);
        // Fold the highest bits, which depend on all inputs, into the lowest.
        self.0 ^= self.0 >> 29;
    }

    fn narrow(&mut self, values: &[Complex32]) {
        let parts = values.iter().flat_map(|z| [z.re, z.im]);
        parts.for_each(|x| self.add(x.to_bits().into()));
    }

    fn wide(&mut self, values: &[Complex64]) {
        let parts = values.iter().flat_map(|z| [z.re, z.im]);
        parts.for_each(|x| self.add(x.to_bits()));
    }
}

fn held(name: &str, stated: u64, of: impl Fn(Instructions, &mut Sum)) {
    for instructions in Instructions::available() {
        let mut sum = Sum::new();
        of(instructions, &mut sum);
        let got = sum.0;
        assert!(
            got == stated,
            "{name} in {instructions:?}: expected checksum 0x{stated:016x}, found 0x{got:016x}"
        );
    }
}

#[test]
fn tile_backprojection_keeps_golden_bits() {
    held("tiles", 0x70FE_489A_1691_0085, |instructions, sum| {
        let mut numbers = Numbers::new(11);
        for index in 0..24 {
            let trial = Trial::new(&mut numbers, DEGREES[index % 2]);
            sum.narrow(&trial.form(instructions));
        }
    });
}

#[test]
fn point_backprojection_keeps_golden_bits() {
    held("points", 0x4EE9_DF4C_E5D1_CD5A, |instructions, sum| {
        let mut numbers = Numbers::new(12);
        for index in 0..8 {
            let trial = Trial::new(&mut numbers, 1 + index % 4);
            sum.narrow(&points(&trial, instructions));
        }
    });
}

#[test]
fn decimation_keeps_golden_bits() {
    let (by_two, by_three) = MODES.split_at(4);
    for (name, bits, modes) in [
        ("decimations by two", 0xF66F_0F65_9EB0_B84D, by_two),
        ("decimations by three", 0x7907_24EB_CE48_949D, by_three),
    ] {
        held(name, bits, |instructions, sum| {
            let case = Case::new(45, 150);
            for &mode in modes {
                for row in case.made(instructions, mode, 64, true) {
                    sum.narrow(&row);
                }
            }
        });
    }
}

#[test]
fn sums_keep_golden_bits() {
    held("sums", 0x0F02_0BDC_D036_5CAF, |instructions, sum| {
        let mut numbers = Numbers::new(13);
        for count in [1, 16, 77, 1000] {
            let samples = numbers.samples(count);
            let weights: Vec<f64> = (0..count).map(|_| numbers.unit()).collect();
            let narrow: Vec<f32> = weights.iter().map(|&weight| weight as f32).collect();
            let turns: [f64; folded_sums::TOGETHER] = std::array::from_fn(|_| numbers.unit());
            // The platform's sine has other last bits.
            let steps: [Complex64; TOGETHER] = std::array::from_fn(|i| {
                let (sin, cos) = libm::sincos(TAU * turns[i]);
                Complex64::new(cos, sin)
            });
            sum.wide(&sums(instructions, &samples, &weights, &steps));
            sum.wide(&folded_sums(instructions, &samples, &narrow, &turns));
            sum.add(power(instructions, &samples, &narrow).to_bits());
        }
    });
}

/// Lines in all directions, in bands.
#[test]
fn gridding_keeps_golden_bits() {
    const W: usize = 6;
    const COLUMNS: usize = 41;
    let kernel = KaiserBessel::new(W);
    held("spreading", 0x2C7A_B1CF_B25A_50D7, |instructions, sum| {
        let mut numbers = Numbers::new(15);
        let mut raster = vec![0.0; 2 * 60 * COLUMNS];
        for _ in 0..9 {
            let samples = numbers.samples(70);
            let line = gridding::Line {
                start: [30.0 + 25.0 * numbers.signed(), 20.0 + numbers.signed()],
                step: [0; 2].map(|_| 0.2 * numbers.signed()),
            };
            for (band, cells) in raster.chunks_mut(2 * 17 * COLUMNS).enumerate() {
                let mut band = Band {
                    first_row: 17 * band,
                    columns: COLUMNS,
                    cells,
                };
                band.spread::<W>(instructions, &kernel, &line, &samples);
            }
        }
        raster.iter().for_each(|x| sum.add(x.to_bits().into()));
    });
}

/// Compensation of several pulses, Doppler transform, and interpolation of lines.
#[test]
fn range_doppler_map_interpolation_keeps_golden_bits() {
    const W: usize = 4;
    let (pulses, reach, count) = (21, 6, 90);
    let shape = Shape {
        inputs: pulses,
        input_centre: (pulses as f64 - 1.0) / 2.0,
        input_drift: 1e-3,
        outputs: 2 * reach + 1,
        output_centre: reach as f64,
        spacing: 1.0 / 42.0,
    };
    let scales: Vec<f64> = (0..count).map(|k| 0.97 + 7e-4 * k as f64).collect();
    let product = DopplerProduct::new(&scales, &shape, |k, m| 1.0 - 1e-3 * (k + m) as f64);
    let kernel = KaiserBessel::new(W);
    let row = row_length(count);
    held("maps", 0x6B4B_50BA_A341_0413, |instructions, sum| {
        let mut numbers = Numbers::new(14);
        let samples = numbers.samples(pulses * count);
        let weights: Vec<f32> = (0..count).map(|_| numbers.unit() as f32).collect();
        let mut ramps: Vec<GroupRamp> = (0..pulses)
            .map(|_| GroupRamp::new(Ramp::new(9.0 * numbers.signed(), numbers.signed(), 0.7)))
            .collect();
        let mut planes = vec![0.0; 2 * BLOCK * pulses];
        let mut scratch = vec![0.0; product.scratch_length()];
        let mut values = vec![0.0; 2 * shape.outputs * row];
        for block in 0..2 {
            let from = block * BLOCK;
            let own = &weights[from..count.min(from + BLOCK)];
            let rest = &samples[from..];
            refer_to_planes(
                instructions,
                rest,
                count,
                own,
                &mut ramps,
                &mut planes,
                BLOCK,
            );
            let mut map = MapRows {
                values: &mut values,
                row_length: row,
                length: count,
                first: 50,
            };
            product.transform(instructions, block, &planes, &mut scratch, &mut map);
        }
        values.iter().for_each(|x| sum.add(x.to_bits().into()));
        // One period of range bins and its continuation.
        for ranges in values.chunks_exact_mut(row) {
            ranges.copy_within(..row - count, count);
        }
        let map = Map::<W> {
            values: &values,
            length: count,
            kernel: &kernel,
            cycles_m: 31.7,
            bins_per_cycle: 3.9,
            zero_bin: reach as f64,
            range_bins_m: 0.83,
        };
        let lines: Vec<Line> = (0..200)
            .map(|i| Line {
                path_m: if i < 100 {
                    0.6 * f64::from(i)
                } else {
                    300.0 * numbers.signed()
                },
                rate_m: 0.03 * numbers.signed(),
            })
            .collect();
        let mut pixels = vec![Complex32::ZERO; lines.len()];
        map.add(instructions, &lines, &mut pixels, |_| Complex32::ONE);
        sum.narrow(&pixels);
    });
}
