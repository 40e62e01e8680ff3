//! Rasters read between their elements: `W x W` values by weights of rows and of columns.
//!
//! ```text
//! value = sum_i a[i] sum_j b[j] values[i][j]
//! ```
//!
//! and a range-Doppler map so read where many points have their paths and rates ([`Map`]): the second half of a type-2
//! non-uniform transform, with the phase of the carrier put back.
//!
//! Sums are float32: 6e-8 for each of `2 W` additions of the larger values. Kernels' weights come from tables good to
//! 2e-6 ([`subaperture_signal::kaiser_bessel`]). Cost: `W^2` complex multiply-adds a value.

use num_complex::Complex32;
use subaperture_signal::kaiser_bessel::KaiserBessel;

use crate::lanes::{GROUP, Instructions, Kernel, Lanes};
use crate::paths::Line;
use crate::phasor::{Polynomials, ROUND_F64};

/// Lines read at a time: other instructions cannot be entered for a few at no cost.
const RUN: usize = 4 * GROUP;

/// The weighted sum of the `W x W` elements of `values`, rows of `row_length`, from a row and column on.
///
/// # Panics
/// If they are not there.
#[inline(always)]
pub fn weighted<const W: usize>(
    values: &[Complex32],
    row_length: usize,
    [row, column]: [usize; 2],
    [row_weights, column_weights]: [&[f32; W]; 2],
) -> Complex32 {
    // Rows first: their elements lie beside each other.
    let mut columns = [Complex32::ZERO; W];
    for (i, &row_weight) in (row..).zip(row_weights) {
        let start = i * row_length + column;
        for (sum, value) in columns.iter_mut().zip(&values[start..start + W]) {
            sum.re += value.re * row_weight;
            sum.im += value.im * row_weight;
        }
    }
    let mut sum = Complex32::ZERO;
    for (column, weight) in columns.iter().zip(column_weights) {
        sum += column * weight;
    }
    sum
}

/// A range-Doppler map, to be read with a kernel of `W` taps whose roll-off is divided out of it.
pub struct Map<'a, const W: usize> {
    /// Doppler bin by Doppler bin, `length + W - 1` values of range each: one period, and its beginning once more.
    pub values: &'a [Complex32],
    /// Range bins of a period.
    pub length: usize,
    /// Of `W` taps.
    pub kernel: &'a KaiserBessel,
    /// Cycles of the carrier a metre.
    pub cycles_m: f64,
    /// Doppler bins for a cycle a pulse.
    pub bins_per_cycle: f64,
    /// Doppler bin of a point at rest.
    pub zero_bin: f64,
    /// Range bins a metre.
    pub range_bins_m: f64,
}

impl<const W: usize> Map<'_, W> {
    /// Adds to each pixel what its line reads, `map(rate, path) exp(+j 2 pi cycles_m path)`; to one whose Doppler is beyond the map what
    /// `beyond` says of its index. Ranges repeat.
    ///
    /// # Panics
    /// If there are not as many pixels as lines.
    pub fn add(
        &self,
        instructions: Instructions,
        lines: &[Line],
        pixels: &mut [Complex32],
        mut beyond: impl FnMut(usize) -> Complex32,
    ) {
        assert_eq!(lines.len(), pixels.len());
        let row_length = self.length + W - 1;
        let bins = self.values.len() / row_length;
        let mut read = Read {
            values: [Complex32::ZERO; RUN],
            missed: [true; RUN],
        };
        for (run, (lines, pixels)) in lines.chunks(RUN).zip(pixels.chunks_mut(RUN)).enumerate() {
            if bins >= W {
                read = instructions.run(At { map: self, lines });
            }
            for (i, pixel) in pixels.iter_mut().enumerate() {
                *pixel += match read.missed[i] {
                    false => read.values[i],
                    true => beyond(run * RUN + i),
                };
            }
        }
    }
}

/// The nearest whole number, of those below 2^51.
#[inline(always)]
fn nearest(x: f64) -> f64 {
    (x + ROUND_F64) - ROUND_F64
}

/// The largest whole number that is not larger.
#[inline(always)]
fn below(x: f64) -> f64 {
    let near = nearest(x);
    if near > x { near - 1.0 } else { near }
}

/// What some lines read, and which of them lie beyond the map.
struct Read {
    values: [Complex32; RUN],
    missed: [bool; RUN],
}

/// Up to [`RUN`] lines, to be read from a map of `W` Doppler bins or more.
struct At<'a, const W: usize> {
    map: &'a Map<'a, W>,
    lines: &'a [Line],
}

impl<const W: usize> Kernel for At<'_, W> {
    type Output = Read;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Read {
        let Self { map, lines } = self;
        let row_length = map.length + W - 1;
        let last_bin = (map.values.len() / row_length - W) as f64;
        let before = (W / 2 - 1) as f64;
        let doppler_bins = map.cycles_m * map.bins_per_cycle;
        let mut read = Read {
            values: [Complex32::ZERO; RUN],
            missed: [false; RUN],
        };
        let [mut turns, mut cos, mut sin, mut across, mut along] = [[0.0f32; RUN]; 5];
        let [mut bins, mut ranges] = [[0.0f64; RUN]; 2];
        for (i, line) in lines.iter().enumerate() {
            let cycles = line.path_m * map.cycles_m;
            turns[i] = (cycles - nearest(cycles)) as f32;
            let doppler = line.rate_m * doppler_bins + map.zero_bin;
            let range = line.path_m * map.range_bins_m;
            let [bin, whole] = [doppler, range].map(below);
            (across[i], along[i]) = ((doppler - bin) as f32, (range - whole) as f32);
            (bins[i], ranges[i]) = (bin - before, whole - before);
            // Not a number is beyond it, too.
            read.missed[i] = !(bins[i] >= 0.0 && bins[i] <= last_bin);
        }
        let phasor = Polynomials::new(lanes);
        for part in (0..lines.len().next_multiple_of(GROUP)).step_by(L::COUNT) {
            let [c, s] = phasor.at(lanes, lanes.load(&turns[part..]));
            lanes.store(c, &mut cos[part..]);
            lanes.store(s, &mut sin[part..]);
        }
        for i in 0..lines.len() {
            if read.missed[i] {
                continue;
            }
            let doppler_weights = map.kernel.weights::<W>(across[i]);
            let range_weights = map.kernel.weights::<W>(along[i]);
            let first = (ranges[i] as i64).rem_euclid(map.length as i64) as usize;
            let first = [bins[i] as usize, first];
            let weights = [&doppler_weights, &range_weights];
            let value = weighted(map.values, row_length, first, weights);
            read.values[i] = value * Complex32::new(cos[i], sin[i]);
        }
        read
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Numbers, kaiser_bessel, turned, wide};
    use num_complex::Complex64;

    #[test]
    fn weighted_is_the_double_sum() {
        let mut numbers = Numbers::new(1);
        let values = numbers.samples(11 * 9);
        let [rows, columns] = [0; 2].map(|_| [0; 5].map(|_| numbers.signed() as f32));
        for first in [[0, 0], [6, 4], [3, 1]] {
            let got = weighted(&values, 9, first, [&rows, &columns]);
            let mut expected = Complex64::ZERO;
            for i in 0..5 {
                for j in 0..5 {
                    let weight = f64::from(rows[i]) * f64::from(columns[j]);
                    expected += wide(values[(first[0] + i) * 9 + first[1] + j]) * weight;
                }
            }
            // 25 terms of magnitude 1 at most, each through two products and ten sums.
            assert!((wide(got) - expected).norm() < 25.0 * 12.0 * 8.5e-8);
        }
    }

    fn check<const W: usize>() {
        let mut numbers = Numbers::new(W as u64);
        let kernel = KaiserBessel::new(W);
        // A period may be shorter than the kernel.
        for (length, bins) in [(48, 20), (3, 12)] {
            let rows: Vec<Vec<Complex32>> = (0..bins).map(|_| numbers.samples(length)).collect();
            let repeated = |row: &Vec<Complex32>| {
                let again = row.iter().cycle().take(length + W - 1);
                again.copied().collect::<Vec<_>>()
            };
            let values: Vec<Complex32> = rows.iter().flat_map(repeated).collect();
            let map = Map::<W> {
                values: &values,
                length,
                kernel: &kernel,
                cycles_m: 31.7,
                bins_per_cycle: 3.9,
                zero_bin: (bins / 2) as f64,
                range_bins_m: 0.83,
            };
            let lines: Vec<Line> = (0..400)
                .map(|_| Line {
                    path_m: 300.0 * numbers.signed(),
                    rate_m: bins as f64 / 2.0 / 3.9 / 31.7 * 1.1 * numbers.signed(),
                })
                .collect();
            let mut pixels = vec![Complex32::ONE; lines.len()];
            let mut missed = Vec::new();
            map.add(Instructions::Portable, &lines, &mut pixels, |i| {
                missed.push(i);
                Complex32::ONE
            });
            for instructions in Instructions::available() {
                let mut other = vec![Complex32::ONE; lines.len()];
                map.add(instructions, &lines, &mut other, |_| Complex32::ONE);
                assert!(other == pixels, "{}", instructions.name());
            }
            let mut read = 0;
            for (i, (line, got)) in lines.iter().zip(&pixels).enumerate() {
                let doppler = line.rate_m * 31.7 * 3.9 + (bins / 2) as f64;
                let range = line.path_m * 0.83;
                // The bins that a kernel of W taps needs: W/2 to either side.
                let needed = [
                    doppler.floor() - W as f64 / 2.0 + 1.0,
                    doppler.floor() + W as f64 / 2.0,
                ];
                if needed[0] < 0.0 || needed[1] > (bins - 1) as f64 {
                    assert!(
                        missed.contains(&i) && *got == Complex32::new(2.0, 0.0),
                        "{i}"
                    );
                    continue;
                }
                read += 1;
                let (mut sum, mut reach, mut magnitude) = (Complex64::ZERO, 0.0, 0.0);
                for (d, row) in rows.iter().enumerate() {
                    let a = kaiser_bessel(W, doppler - d as f64);
                    let middle = range.floor() as i64;
                    for l in middle - W as i64..=middle + W as i64 {
                        let b = kaiser_bessel(W, range - l as f64);
                        sum += wide(row[l.rem_euclid(length as i64) as usize]) * (a * b);
                        magnitude += a * b;
                        if a * b > 0.0 {
                            reach += a + b;
                        }
                    }
                }
                let expected = sum * turned(line.path_m * 31.7) + 1.0;
                // Weights are off by the table's 2e-6 in either direction. Roundings: fractions, products, 2 W sums and the phasor (3e-7).
                let allowed =
                    2e-6 * reach + magnitude * (8.5e-8 * (2 * W + 4) as f64 + 3e-7) + 2e-7;
                let error = (wide(*got) - expected).norm();
                assert!(error < allowed, "{W} {i}: {error} {allowed}");
            }
            assert_eq!(read + missed.len(), lines.len());
            assert!(read > 150 && missed.len() > 20, "{read} {}", missed.len());
        }
    }

    #[test]
    fn maps_are_read_as_the_sum_says() {
        check::<4>();
        check::<6>();
    }
}
