use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};

use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::paths::{Antennas, Points};
use subaperture_kernels::tile::*;

use crate::trial::{Numbers, turned, wide};

/// Cardinal B-spline of degree `d`, by recurrence.
fn spline(d: usize, x: f64) -> f64 {
    match d {
        0 => f64::from(u8::from((-0.5..0.5).contains(&x))),
        _ => {
            let (d, half) = (d as f64, (d as f64 + 1.0) / 2.0);
            let below = |x| spline(d as usize - 1, x);
            ((half + x) * below(x + 0.5) + (half - x) * below(x - 0.5)) / d
        }
    }
}

/// Profile with carrier at a position in bins, from spline coefficients.
fn value(profile: &[Complex32], degree: usize, kappa: f64, t: f64) -> Complex64 {
    let reach = degree as i64 / 2 + 2;
    let first = t.floor() as i64;
    let terms = (first - reach..=first + reach).map(|i| {
        let c = profile[i.rem_euclid(profile.len() as i64) as usize];
        wide(c) * spline(degree, t - i as f64)
    });
    turned(kappa * t) * terms.sum::<Complex64>()
}

fn path_m(antennas: &Antennas, point: [f64; 3]) -> f64 {
    let leg = |a: [f64; 3]| {
        let across = (point[0] - a[0]).hypot(point[1] - a[1]);
        across.hypot(point[2] - a[2])
    };
    leg(antennas.transmitter_m) + leg(antennas.receiver_m) - antennas.datum_m
}

fn pixel(raster: &Raster, row: usize, column: usize) -> [f64; 3] {
    let i = column as f64 - (raster.columns as f64 - 1.0) / 2.0;
    let j = row as f64 - (raster.rows as f64 - 1.0) / 2.0;
    std::array::from_fn(|d| raster.centre_m[d] + i * raster.along_m[d] + j * raster.across_m[d])
}

/// Test case: pulses at `distance_m` over an arc.
pub(crate) struct Trial {
    raster: Raster,
    pulses: Vec<TilePulse>,
    profiles: Vec<Vec<Complex32>>,
    layout: Pieces,
}

impl Trial {
    /// Random case: near or far, monostatic or bistatic, any orientation, fine or coarse pixels.
    pub(crate) fn new(numbers: &mut Numbers, degree: usize) -> Self {
        let distance_m = libm::pow(10.0, 2.0 + 3.0 * numbers.unit());
        let bin_m = 0.02 + 0.2 * numbers.unit();
        let step_m = bin_m * libm::pow(10.0, 1.2 * numbers.unit() - 0.5);
        let mut direction = || {
            let v: [f64; 3] = std::array::from_fn(|_| numbers.signed());
            let length = v.iter().map(|x| x * x).sum::<f64>().sqrt().max(0.05);
            v.map(|x| x / length)
        };
        let (along, askew) = (direction(), direction());
        let line = direction();
        let product: f64 = (0..3).map(|d| along[d] * askew[d]).sum();
        let across: [f64; 3] = std::array::from_fn(|d| askew[d] - product * along[d]);
        let length = across.iter().map(|x| x * x).sum::<f64>().sqrt();
        let raster = Raster {
            centre_m: std::array::from_fn(|_| 30.0 * numbers.signed()),
            along_m: along.map(|x| x * step_m),
            across_m: across.map(|x| x / length * step_m * (0.7 + 0.6 * numbers.unit())),
            rows: 1 + (40.0 * numbers.unit()) as usize,
            columns: 1 + (40.0 * numbers.unit()) as usize,
        };
        let length = 40 + (300.0 * numbers.unit()) as usize;
        let margin = Pieces::margin_for(&raster, 1.0 / bin_m);
        let layout = Pieces::new(degree, length, margin);
        let carrier = 30.0 * numbers.signed();
        let alone = numbers.unit() < 0.5;
        let pulses: Vec<TilePulse> = (0..5)
            .map(|n| {
                let mut at = |shift: f64| {
                    std::array::from_fn(|d| {
                        line[d] * distance_m
                            + shift
                                * (0.02 * n as f64 + numbers.unit() * 1e-3)
                                * askew[d]
                                * distance_m
                    })
                };
                let transmitter_m = at(1.0);
                let receiver_m = if alone { transmitter_m } else { at(-3.0) };
                let bins_m = 1.0 / bin_m;
                TilePulse {
                    antennas: Antennas {
                        transmitter_m,
                        receiver_m,
                        datum_m: 2.0 * distance_m * (1.0 + 0.1 * numbers.signed()),
                    },
                    turns_m: bins_m / length as f64,
                    cycles_a_bin: carrier / bins_m,
                }
            })
            .collect();
        Self {
            profiles: pulses.iter().map(|_| numbers.samples(length)).collect(),
            raster,
            pulses,
            layout,
        }
    }

    pub(crate) fn form(&self, instructions: Instructions) -> Vec<Complex32> {
        self.form_from(instructions, 0)
    }

    /// Form with inputs and outputs at an offset of `shift` numbers in memory.
    fn form_from(&self, instructions: Instructions, shift: usize) -> Vec<Complex32> {
        let mut all_pieces = vec![0.0; shift + self.pulses.len() * self.layout.values()];
        let pieces = &mut all_pieces[shift..];
        let each = pieces.chunks_exact_mut(self.layout.values());
        for (profile, pieces) in self.profiles.iter().zip(each) {
            self.layout.make(instructions, profile, 0.75, pieces);
        }
        let pixels = self.raster.rows * self.raster.columns;
        let mut all_sums = vec![Complex32::new(1.0, -1.0); shift + pixels];
        let sums = &mut all_sums[shift..];
        let mut scratch = TileScratch::default();
        scratch.look(self.layout.length(), &self.pulses, &self.raster);
        scratch.add(instructions, &self.layout, &self.pulses, pieces, sums);
        all_sums.split_off(shift)
    }

    fn expected(&self) -> Vec<Complex64> {
        let pixels = (0..self.raster.rows * self.raster.columns).map(|index| {
            let (row, column) = (index / self.raster.columns, index % self.raster.columns);
            let point = pixel(&self.raster, row, column);
            let terms = self
                .pulses
                .iter()
                .zip(&self.profiles)
                .map(|(pulse, profile)| {
                    let t = path_m(&pulse.antennas, point) * pulse.turns_m * profile.len() as f64;
                    value(profile, self.layout.degree(), pulse.cycles_a_bin, t) * 0.75
                });
            Complex64::new(1.0, -1.0) + terms.sum::<Complex64>()
        });
        pixels.collect()
    }

    /// Bound on a pixel's error: phase errors of paths and positions, phasors, and rounding; for values up to 1, half that on
    /// average.
    fn allowed(&self) -> f64 {
        let mut scratch = TileScratch::default();
        let off_m = scratch.look(self.layout.length(), &self.pulses, &self.raster);
        // The largest phasor errors, at the ends of blocks, are about 4 times the RMS.
        let phasor = 4.0 * PHASOR_RMS;
        let terms = self.pulses.iter().map(|pulse| {
            let bins_m = (pulse.turns_m * self.layout.length() as f64).abs();
            // At corners up to 3 times the RMS of each of the two kinds of polynomial terms.
            let bins = 4.0 * off_m * bins_m + 5.0 * PLACE_RMS;
            // A position error changes the carrier phase, and the value by a slope of at most 2 per bin, more for pieces.
            0.75 * (0.5 * bins * (TAU * pulse.cycles_a_bin.abs() + 4.0) + phasor + 3e-6)
        });
        terms.sum()
    }
}

#[test]
fn tile_backprojection_agrees_with_defining_sum() {
    let mut numbers = Numbers::new(1);
    let (mut formed, mut worst) = (0, 0.0f64);
    for index in 0..120 {
        let trial = Trial::new(&mut numbers, DEGREES[index % 2]);
        let allowed = trial.allowed();
        // Tiles with so large a truncation error are not used.
        if allowed.is_nan() || allowed > 0.02 {
            continue;
        }
        formed += 1;
        let got = trial.form(Instructions::Portable);
        for (got, expected) in got.iter().zip(trial.expected()) {
            let error = (wide(*got) - expected).norm();
            assert!(error <= allowed, "{index}: {error} {allowed}");
            worst = worst.max(error / allowed);
        }
    }
    // The bound holds and is not loose.
    assert!(formed > 60 && worst > 0.2, "{formed} {worst}");
}

/// Pixels of a test case as separate points.
pub(crate) fn points(trial: &Trial, instructions: Instructions) -> Vec<Complex32> {
    let Trial { raster, layout, .. } = trial;
    let pixels = (0..raster.rows).flat_map(|j| (0..raster.columns).map(move |i| (j, i)));
    let mut points = Points::default();
    pixels.for_each(|(row, column)| points.push(pixel(raster, row, column)));
    let mut sums = vec![Complex32::new(1.0, -1.0); points.len()];
    let mut pieces = vec![0.0; layout.values()];
    for (pulse, profile) in trial.pulses.iter().zip(&trial.profiles) {
        layout.make(instructions, profile, 0.75, &mut pieces);
        add_points(instructions, layout, pulse, &pieces, &points, &mut sums);
    }
    sums
}

#[test]
fn point_backprojection_agrees_with_defining_sum() {
    let mut numbers = Numbers::new(4);
    for index in 0..24 {
        let trial = Trial::new(&mut numbers, 1 + index % MAX_DEGREE);
        let portable = points(&trial, Instructions::Portable);
        for instructions in Instructions::available() {
            assert!(points(&trial, instructions) == portable, "{index}");
        }
        for (got, expected) in portable.iter().zip(trial.expected()) {
            // Paths up to 1e5 m in float64: 1e-10 m change a carrier of 30 cycles per metre by 2e-8. A sum is rounded five times.
            let error = (wide(*got) - expected).norm();
            assert!(error < 5.0 * 0.75 * 2e-6 + 2e-6, "{index}: {error}");
        }
    }
}

/// Results are independent of memory alignment.
#[test]
fn backprojection_is_bit_identical_in_all_instruction_sets() {
    let mut numbers = Numbers::new(2);
    for index in 0..120 {
        let trial = Trial::new(&mut numbers, DEGREES[index % 2]);
        let portable = trial.form(Instructions::Portable);
        for instructions in Instructions::available() {
            let got = trial.form_from(instructions, index % 17);
            assert!(got == portable, "{index} {}", instructions.name());
        }
    }
}

/// Infinite, NaN and denormal samples give the same bits, and NaN in the same places.
#[test]
fn non_finite_samples_give_same_result_in_all_instruction_sets() {
    let mut numbers = Numbers::new(6);
    let wild = [
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MAX,
        -1e-45,
        1e-39,
        -0.0,
    ];
    let bits = |sums: Vec<Complex32>| -> Vec<u32> {
        let parts = sums.into_iter().flat_map(|z| [z.re, z.im]);
        // One representative NaN.
        let one = |x: f32| if x.is_nan() { f32::NAN } else { x };
        parts.map(|x| one(x).to_bits()).collect()
    };
    let mut without_number = 0;
    for index in 0..24 {
        let mut trial = Trial::new(&mut numbers, DEGREES[index % 2]);
        for (profile, wild) in trial
            .profiles
            .iter_mut()
            .zip(wild.iter().cycle().skip(index))
        {
            let place = (numbers.unit() * profile.len() as f64) as usize;
            profile[place].re = *wild;
        }
        let portable = bits(trial.form(Instructions::Portable));
        for instructions in Instructions::available() {
            let got = bits(trial.form(instructions));
            assert!(got == portable, "{index} {}", instructions.name());
        }
        without_number += portable
            .iter()
            .filter(|x| f32::from_bits(**x).is_nan())
            .count();
    }
    assert!(without_number > 0);
}

#[test]
fn antennas_at_nan_give_infinite_error_bound() {
    let mut trial = Trial::new(&mut Numbers::new(5), 2);
    trial.pulses[3].antennas.receiver_m[1] = f64::NAN;
    let off_m = TileScratch::default().look(trial.layout.length(), &trial.pulses, &trial.raster);
    assert_eq!(off_m, f64::INFINITY);
}
