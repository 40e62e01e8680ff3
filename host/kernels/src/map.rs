//! Interpolation of range-Doppler maps at the path and rate of many points: the second half of a type-2 NUFFT, with the carrier phase
//! restored.
//!
//! ```text
//! pixel += exp(+j 2 pi cycles_m path) sum_i a_i sum_j b_j map[bin + i][range + j]
//! ```
//!
//! with a Kaiser-Bessel kernel of `W` by `W` taps ([`subaperture_signal::kaiser_bessel`]), whose weights are polynomials with an error of 1e-6.
//! One register of lines, usually adjacent on the ground, is processed together. Where their ranges lie within 32 bins (or 8, which some processors look up at
//! a fourth of the cost) and their Doppler within a few bins, the values of a row are looked up in registers once for all lines, each with its
//! own weight or 0. Other lines are gathered one by one, with identical bits. **Accuracy** positions are float64, sums float32: 6e-8 for each of `2 W`
//! additions of the larger values. **Cost** `W^2` complex multiply-adds per line, and `W` more for each additional Doppler bin among the lines of a register.

use std::array;

use num_complex::Complex32;
use subaperture_signal::kaiser_bessel::KaiserBessel;

use crate::lanes::{GROUP, Instructions, Kernel, Lanes};
use crate::paths::Line;
use crate::phasor::{Polynomials, ROUND, nearest};
use crate::taps::{below, weights};

/// Lines per call of a kernel, to amortise the switch of instruction sets.
const RUN: usize = 4 * GROUP;

/// Values of a row in a register lookup.
const WINDOW: usize = 32;
/// Values of a row in a short register lookup, for close ranges, as of lines along the track.
const SHORT: usize = 8;

/// Largest number of first Doppler bins among a register's lines for row lookup.
const MAX_BINS: usize = 6;
/// Largest number of rows looked up, for kernels of at most 6 taps.
const MAX_ROWS: usize = 6 + MAX_BINS - 1;

/// Offset in range bins that stands for distant lines.
const FAR: f32 = 1e6;

/// Range-Doppler map for a kernel of `W` taps; the kernel's roll-off is already compensated.
pub struct Map<'a, const W: usize> {
    /// `[Doppler bin][real, imaginary][row_length]`: one period of range bins and its continuation.
    pub values: &'a [f32],
    /// Range bins per period.
    pub length: usize,
    /// Kernel of `W` taps.
    pub kernel: &'a KaiserBessel,
    /// Carrier cycles per metre of path.
    pub cycles_m: f64,
    /// Doppler bins per cycle per pulse.
    pub bins_per_cycle: f64,
    /// Doppler bin of zero rate.
    pub zero_bin: f64,
    /// Range bins per metre of path.
    pub range_bins_m: f64,
}

/// Row length of either plane for `length` range bins: one period and its continuation from the first bin.
#[inline]
pub fn row_length(length: usize) -> usize {
    length + WINDOW
}

impl<const W: usize> Map<'_, W> {
    /// Add to each pixel `map(rate, path) exp(+j 2 pi cycles_m path)` of its line, or `beyond(index)` where its Doppler is outside the
    /// map. Ranges are periodic.
    ///
    /// # Panics
    /// If the numbers of pixels and lines differ, the kernel does not have `W` taps, or the values are not whole rows.
    pub fn add(
        &self,
        instructions: Instructions,
        lines: &[Line],
        pixels: &mut [Complex32],
        mut beyond: impl FnMut(usize) -> Complex32,
    ) {
        const { assert!(W >= 2 && W.is_multiple_of(2) && W < SHORT) };
        assert_eq!(lines.len(), pixels.len());
        assert_eq!(self.kernel.taps(), W);
        assert!(
            self.values
                .len()
                .is_multiple_of(2 * row_length(self.length))
        );
        let bins = self.bins();
        let mut read = Read {
            values: [[0.0; RUN]; 2],
            missed: [true; RUN],
        };
        for (run, (lines, pixels)) in lines.chunks(RUN).zip(pixels.chunks_mut(RUN)).enumerate() {
            if bins >= W {
                read = instructions.run(At { map: self, lines });
            }
            for (i, pixel) in pixels.iter_mut().enumerate() {
                *pixel += match read.missed[i] {
                    false => Complex32::new(read.values[0][i], read.values[1][i]),
                    true => beyond(run * RUN + i),
                };
            }
        }
    }

    /// Number of Doppler bins.
    #[inline(always)]
    fn bins(&self) -> usize {
        self.values.len() / (2 * row_length(self.length))
    }

    /// Real and imaginary plane of a row.
    #[inline(always)]
    fn row(&self, bin: usize) -> [&[f32]; 2] {
        let length = row_length(self.length);
        let row = &self.values[2 * bin * length..2 * (bin + 1) * length];
        [&row[..length], &row[length..]]
    }

    /// Range bin modulo the period.
    #[inline(always)]
    fn wrapped(&self, bin: f64) -> usize {
        (bin as i64).rem_euclid(self.length as i64) as usize
    }
}

/// Interpolated values, real and imaginary, and lines outside the map.
struct Read {
    values: [[f32; RUN]; 2],
    missed: [bool; RUN],
}

/// Interpolation of up to [`RUN`] lines on a map of at least `W` Doppler bins.
struct At<'a, const W: usize> {
    map: &'a Map<'a, W>,
    lines: &'a [Line],
}

/// Positions of lines on the map.
struct Places {
    /// Carrier phase modulo one cycle.
    turns: [f32; RUN],
    /// Fraction above the lower bin, minus a half.
    across: [f32; RUN],
    along: [f32; RUN],
    /// First bins: integers kept as floats, because conversions would be scalar.
    bins: [f32; RUN],
    ranges: [f64; RUN],
}

impl Places {
    #[inline(always)]
    fn new<const W: usize>(map: &Map<W>, lines: &[Line], missed: &mut [bool; RUN]) -> Self {
        let last_bin = (map.bins() - W) as f64;
        let before = (W / 2 - 1) as f64;
        let doppler_bins = map.cycles_m * map.bins_per_cycle;
        let mut places = Self {
            turns: [0.0; RUN],
            across: [0.0; RUN],
            along: [0.0; RUN],
            bins: [0.0; RUN],
            ranges: [0.0; RUN],
        };
        for (i, line) in lines.iter().enumerate() {
            let cycles = line.path_m * map.cycles_m;
            places.turns[i] = (cycles - nearest(cycles)) as f32;
            let doppler = line.rate_m * doppler_bins + map.zero_bin;
            let range = line.path_m * map.range_bins_m;
            let [bin, whole] = [doppler, range].map(below);
            places.across[i] = (doppler - bin - 0.5) as f32;
            places.along[i] = (range - whole - 0.5) as f32;
            // NaN is outside, too.
            missed[i] = !(bin - before >= 0.0 && bin - before <= last_bin);
            // Positions outside, and NaN, are clamped.
            places.bins[i] = (bin - before).max(0.0).min(last_bin) as f32;
            places.ranges[i] = whole - before;
        }
        // Missing lines of a group copy the last one, so that they do not cause gathers.
        if let Some(last) = lines.len().checked_sub(1) {
            let end = lines.len().next_multiple_of(GROUP);
            let (bin, range) = (places.bins[last], places.ranges[last]);
            places.bins[lines.len()..end].fill(bin);
            places.ranges[lines.len()..end].fill(range);
        }
        places
    }
}

/// Minimum and maximum of the first `count` numbers of a group (`count` a power of two), by pairwise reduction.
#[inline(always)]
fn ends(of: &[f32; GROUP], mut count: usize) -> [f32; 2] {
    let (mut least, mut most) = (*of, *of);
    count /= 2;
    while count > 0 {
        for i in 0..count {
            let (low, high) = (least[i + count], most[i + count]);
            least[i] = if low < least[i] { low } else { least[i] };
            most[i] = if high > most[i] { high } else { most[i] };
        }
        count /= 2;
    }
    [least[0], most[0]]
}

/// One register of lines.
struct Few<'a, L: Lanes, const W: usize> {
    map: &'a Map<'a, W>,
    /// First Doppler bin of each line.
    bins: &'a [f32],
    ranges: &'a [f64],
    /// Weights over Doppler and over range.
    across: [L::Numbers; W],
    along: [L::Numbers; W],
}

impl<L: Lanes, const W: usize> Few<'_, L, W> {
    /// Interpolated values, real and imaginary.
    #[inline(always)]
    fn read(&self, lanes: L) -> [L::Numbers; 2] {
        let [mut offsets, mut bins] = [[0.0; GROUP]; 2];
        // Relative to the first line's range; distant ranges and NaN are never near.
        for (offset, range) in offsets.iter_mut().zip(&self.ranges[..L::COUNT]) {
            *offset = ((range - self.ranges[0]) as f32).clamp(-FAR, FAR);
        }
        bins[..L::COUNT].copy_from_slice(&self.bins[..L::COUNT]);
        let [least, most] = ends(&offsets, L::COUNT);
        let [lowest, highest] = ends(&bins, L::COUNT).map(|bin| bin as usize);
        // Comparisons with NaN are false.
        let within = |window: usize| most - least <= (window - W) as f32;
        if !(L::LOOKS_UP && within(WINDOW) && highest - lowest < MAX_BINS) {
            return self.fetch(lanes);
        }
        let base = self.map.wrapped(self.ranges[0] + f64::from(least));
        // Integers in the lowest mantissa bits.
        let from_base = lanes.sub(lanes.load(&offsets), lanes.splat(least));
        let from_base = lanes.add(from_base, lanes.splat(ROUND));
        let places = array::from_fn(|b| lanes.add(from_base, lanes.splat(b as f32)));
        let rows = highest - lowest + W;
        let mut weights = [lanes.splat(0.0); MAX_ROWS];
        for bin in lowest..=highest {
            let mut own = [0.0f32; GROUP];
            for (own, &at) in own.iter_mut().zip(&bins[..L::COUNT]) {
                *own = if at == bin as f32 { 1.0 } else { 0.0 };
            }
            let own = lanes.load(&own);
            // A line has one first bin: weights are added to 0.
            for (weight, &across) in weights[bin - lowest..].iter_mut().zip(&self.across) {
                *weight = lanes.mul_add(across, own, *weight);
            }
        }
        let weights = &weights[..rows.min(MAX_ROWS)];
        if L::LIKES_SHORT && within(SHORT) {
            self.look_up(lanes, lowest, weights, |plane| {
                let values = plane[base..base + SHORT].first_chunk();
                let values = lanes.short(values.unwrap_or(&[0.0; SHORT]));
                self.along_row(lanes, &places, |at| lanes.of_short(values, at))
            })
        } else {
            self.look_up(lanes, lowest, weights, |plane| {
                let values = plane[base..base + WINDOW].first_chunk();
                let values = lanes.wide(values.unwrap_or(&[0.0; WINDOW]));
                self.along_row(lanes, &places, |at| lanes.of_wide(values, at))
            })
        }
    }

    /// Look up rows from `lowest` on, with their `weights`.
    #[inline(always)]
    fn look_up(
        &self,
        lanes: L,
        lowest: usize,
        weights: &[L::Numbers],
        of_row: impl Fn(&[f32]) -> L::Numbers,
    ) -> [L::Numbers; 2] {
        let mut sums = [lanes.splat(0.0); 2];
        for (row, &weight) in weights.iter().enumerate() {
            for (plane, total) in self.map.row(lowest + row).into_iter().zip(&mut sums) {
                *total = lanes.mul_add(weight, of_row(plane), *total);
            }
        }
        sums
    }

    /// Interpolate a row at each line's range.
    #[inline(always)]
    fn along_row(
        &self,
        lanes: L,
        places: &[L::Numbers; W],
        value: impl Fn(L::Numbers) -> L::Numbers,
    ) -> L::Numbers {
        let mut sum = lanes.splat(0.0);
        for (&place, &along) in places.iter().zip(&self.along) {
            sum = lanes.mul_add(value(place), along, sum);
        }
        sum
    }

    /// Gather line by line.
    #[inline(always)]
    fn fetch(&self, lanes: L) -> [L::Numbers; 2] {
        let mut starts = [0; GROUP];
        for (start, &range) in starts.iter_mut().zip(&self.ranges[..L::COUNT]) {
            *start = self.map.wrapped(range);
        }
        let mut sums = [lanes.splat(0.0); 2];
        for (a, &across) in self.across.iter().enumerate() {
            for (plane, total) in sums.iter_mut().enumerate() {
                let mut sum = lanes.splat(0.0);
                for (b, &along) in self.along.iter().enumerate() {
                    let mut value = [0.0f32; GROUP];
                    for (i, value) in value[..L::COUNT].iter_mut().enumerate() {
                        let row = self.map.row(self.bins[i] as usize + a);
                        *value = row[plane][starts[i] + b];
                    }
                    sum = lanes.mul_add(lanes.load(&value), along, sum);
                }
                *total = lanes.mul_add(across, sum, *total);
            }
        }
        sums
    }
}

impl<const W: usize> Kernel for At<'_, W> {
    type Output = Read;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Read {
        let Self { map, lines } = self;
        let mut read = Read {
            values: [[0.0; RUN]; 2],
            missed: [false; RUN],
        };
        let places = Places::new(map, lines, &mut read.missed);
        let phasor = Polynomials::new(lanes);
        for at in (0..lines.len()).step_by(L::COUNT) {
            let few = Few {
                map,
                bins: &places.bins[at..],
                ranges: &places.ranges[at..],
                across: weights(
                    lanes,
                    map.kernel.polynomials(),
                    lanes.load(&places.across[at..]),
                ),
                along: weights(
                    lanes,
                    map.kernel.polynomials(),
                    lanes.load(&places.along[at..]),
                ),
            };
            let [re, im] = few.read(lanes);
            let [cos, sin] = phasor.at(lanes, lanes.load(&places.turns[at..]));
            let real = lanes.neg_mul_add(im, sin, lanes.mul(re, cos));
            let imaginary = lanes.mul_add(im, cos, lanes.mul(re, sin));
            lanes.store(real, &mut read.values[0][at..]);
            lanes.store(imaginary, &mut read.values[1][at..]);
        }
        read
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Numbers, kaiser_bessel, turned, wide};
    use num_complex::Complex64;

    fn check<const W: usize>() {
        let mut numbers = Numbers::new(W as u64);
        let kernel = KaiserBessel::new(W);
        // The period may be shorter than the kernel.
        for (length, bins) in [(48, 20), (3, 12)] {
            let rows: Vec<Vec<Complex32>> = (0..bins).map(|_| numbers.samples(length)).collect();
            let plane = |row: &[Complex32], of: fn(&Complex32) -> f32| -> Vec<f32> {
                row.iter()
                    .cycle()
                    .take(row_length(length))
                    .map(of)
                    .collect()
            };
            let values: Vec<f32> = rows
                .iter()
                .flat_map(|row| [plane(row, |z| z.re), plane(row, |z| z.im)])
                .flatten()
                .collect();
            let map = Map::<W> {
                values: &values,
                length,
                kernel: &kernel,
                cycles_m: 31.7,
                bins_per_cycle: 3.9,
                zero_bin: (bins / 2) as f64,
                range_bins_m: 0.83,
            };
            // Random lines, and adjacent lines, mostly in register lookup, some across a period's end.
            let mut lines: Vec<Line> = (0..400)
                .map(|_| Line {
                    path_m: 300.0 * numbers.signed(),
                    rate_m: bins as f64 / 2.0 / 3.9 / 31.7 * 1.1 * numbers.signed(),
                })
                .collect();
            lines.extend((0..400).map(|i| Line {
                path_m: 0.7 * f64::from(i) + 0.3 * numbers.unit(),
                rate_m: bins as f64 / 2.0 / 3.9 / 31.7 * (0.004 * f64::from(i) - 0.787),
            }));
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
                // Bins that a kernel of W taps needs: W/2 to either side.
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
                // Weight error 5e-7 per dimension by the polynomials, and the same by rounding. Rounding: fractions, products, 2 W sums
                // and the phasor (3e-7).
                let allowed =
                    1e-6 * reach + magnitude * (8.5e-8 * (2 * W + 4) as f64 + 3e-7) + 2e-7;
                let error = (wide(*got) - expected).norm();
                assert!(error < allowed, "{W} {i}: {error} {allowed}");
            }
            assert_eq!(read + missed.len(), lines.len());
            assert!(read > 150 && missed.len() > 20, "{read} {}", missed.len());
        }
    }

    /// A line's result is independent of the lines in its register.
    #[test]
    fn interpolation_is_independent_of_grouping() {
        const W: usize = 4;
        let kernel = KaiserBessel::new(W);
        let (length, bins) = (100, 20);
        let mut numbers = Numbers::new(9);
        let samples = numbers.samples(bins * length);
        let values: Vec<f32> = samples
            .chunks_exact(length / 2)
            .flat_map(|plane| {
                let numbers: Vec<f32> = plane.iter().flat_map(|z| [z.re, z.im]).collect();
                numbers.into_iter().cycle().take(row_length(length))
            })
            .collect();
        let map = Map::<W> {
            values: &values,
            length,
            kernel: &kernel,
            cycles_m: 1.0,
            bins_per_cycle: 1.0,
            zero_bin: 10.0,
            range_bins_m: 1.0,
        };
        let lines: Vec<Line> = (0..90)
            .map(|i| Line {
                path_m: 0.9 * f64::from(i) + numbers.unit(),
                rate_m: 0.1 * f64::from(i) - 4.0,
            })
            .collect();
        let read = |lines: &[Line]| {
            let mut pixels = vec![Complex32::ZERO; lines.len()];
            map.add(Instructions::best(), lines, &mut pixels, |_| unreachable!());
            pixels
        };
        let together = read(&lines);
        let order = |i: usize| i * 37 % lines.len();
        let scattered: Vec<Line> = (0..lines.len()).map(|i| lines[order(i)]).collect();
        for (i, pixel) in read(&scattered).into_iter().enumerate() {
            assert_eq!(pixel, together[order(i)]);
            assert_eq!(read(&scattered[i..=i]), [pixel]);
        }
    }

    #[test]
    fn map_interpolation_agrees_with_defining_sum() {
        check::<4>();
        check::<6>();
    }
}
