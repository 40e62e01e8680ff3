//! Keystone Doppler transform (axis scaled with frequency) as a matrix product.
//!
//! ```text
//! X_k[d] = sum_m a_k[m] x_k[m] exp(+j 2 pi s_k delta (m - m_k) (d - d_c)),    k = 0 .. K-1
//! ```
//!
//! It equals the chirp-z transform of [`subaperture_signal::scaled_dft`] for Doppler bins evenly about zero, `D = 2 d_c + 1`. A patch needs few
//! bins, and then the direct sum is cheaper than FFTs. Pulses symmetric about the middle share a cosine, and so
//! do bins `d_c + d` and `d_c - d`,
//!
//! ```text
//! X[d_c +- d] = sum_u cos(t u d) (a+ x+ + a- x-)  +-  j sum_u sin(t u d) (a+ x+ - a- x-),    u = m - m_c > 0
//! ```
//!
//! so that a pulse and bin need one real multiply-add instead of four. SIMD lanes hold adjacent frequencies. Input samples are pulse by pulse,
//! real and imaginary parts in separate planes; output rows are range-Doppler map rows for range FFTs. Sines advance from bin to bin by phasor recurrence.
//!
//! Where the reference slow time depends on frequency (intra-pulse motion), `m_k = m_c - kappa (k - K/2)`, each bin is multiplied
//! by the additional phase, which is independent of the pulse.
//!
//! **Cost** `M D K` real multiply-adds, and as many for the recurrence, with cache blocking by [`BLOCK`] frequencies. **Memory** a table of `2 M K` float32. **Accuracy**
//! recurrence steps are rounded to 2.5e-8 RMS, which accumulates over bins to 1e-6 at [`MAX_REACH`]; sums of `M` terms 6e-8 times the square root of their number.

use num_complex::Complex64;
use subaperture_signal::phase::phasor;
use subaperture_signal::scaled_dft::Shape;

use crate::lanes::{GROUP, Instructions, Kernel, Lanes};

/// Frequencies per cache block.
pub const BLOCK: usize = 4 * GROUP;

/// Largest Doppler bin to either side of zero; the error bound holds up to there.
pub const MAX_REACH: usize = 64;

/// Planes of the table per pair of pulses: two weights, cosine and sine of the first bin.
const PLANES: usize = 4;

/// Pairs of pulses per load and store of the sums.
const TOGETHER: usize = 2;

/// Doppler transform for all frequencies of a band.
pub struct DopplerProduct {
    inputs: usize,
    reach: usize,
    frequencies: usize,
    /// `[block][pair][plane][BLOCK]`.
    table: Vec<f32>,
    /// Phasor of the drift from bin to bin, `[block][cosine, sine][BLOCK]`; empty without drift.
    drift: Vec<f32>,
}

impl DopplerProduct {
    /// Whether a shape is supported: bins evenly about zero, at most [`MAX_REACH`] to either side.
    pub fn suits(shape: &Shape) -> bool {
        let reach = shape.outputs / 2;
        shape.outputs == 2 * reach + 1
            && shape.output_centre == reach as f64
            && reach <= MAX_REACH
            && shape.input_centre == (shape.inputs as f64 - 1.0) / 2.0
    }

    /// Build the table for `scales[k] = f_k / f_c`; `weight(k, m)` is `a_k[m]`.
    ///
    /// # Panics
    /// If the shape is not supported ([`Self::suits`]).
    pub fn new(scales: &[f64], shape: &Shape, weight: impl Fn(usize, usize) -> f64) -> Self {
        assert!(Self::suits(shape));
        let (inputs, frequencies) = (shape.inputs, scales.len());
        let blocks = frequencies.div_ceil(BLOCK);
        let pairs = pairs(inputs);
        let mut table = vec![0.0; blocks * pairs * PLANES * BLOCK];
        let mut drift = match shape.input_drift != 0.0 {
            true => vec![0.0; blocks * 2 * BLOCK],
            false => Vec::new(),
        };
        for (k, &scale) in scales.iter().enumerate() {
            let (block, lane) = (k / BLOCK, k % BLOCK);
            let a_bin = scale * shape.spacing;
            let part = &mut table[block * pairs * PLANES * BLOCK..][..pairs * PLANES * BLOCK];
            for (pair, row) in part.chunks_exact_mut(PLANES * BLOCK).enumerate() {
                let Some([before, after]) = pulses(inputs, pair) else {
                    continue;
                };
                let turn = phasor(a_bin * (after as f64 - shape.input_centre));
                // The middle pulse forms a pair with itself, with half the weight.
                let share = if before == after { 0.5 } else { 1.0 };
                let of = |m| (share * weight(k, m)) as f32;
                let planes = [of(before), of(after), turn.re as f32, turn.im as f32];
                for (plane, value) in planes.into_iter().enumerate() {
                    row[plane * BLOCK + lane] = value;
                }
            }
            if let Some(drift) = drift.chunks_exact_mut(2 * BLOCK).nth(block) {
                let later = shape.input_centre - shape.centre_of(k, frequencies);
                let Complex64 { re, im } = phasor(a_bin * later);
                (drift[lane], drift[BLOCK + lane]) = (re as f32, im as f32);
            }
        }
        Self {
            inputs,
            reach: shape.outputs / 2,
            frequencies,
            table,
            drift,
        }
    }

    /// Size of the table for a band of `frequencies`, bytes.
    pub fn table_bytes(frequencies: usize, inputs: usize) -> u64 {
        let row = 4 * (frequencies.next_multiple_of(BLOCK) * PLANES) as u64;
        row * pairs(inputs) as u64 + row
    }

    /// Number of Doppler bins.
    #[inline]
    pub fn outputs(&self) -> usize {
        2 * self.reach + 1
    }

    /// Length of the scratch of [`Self::transform`].
    pub fn scratch_length(&self) -> usize {
        4 * GROUP * (self.reach + 1)
    }

    /// Transform block `block` of frequencies, from frequency `BLOCK block` on. `samples` are `[pulse][real, imaginary][BLOCK]`;
    /// values beyond the band must be finite and are ignored. Frequency `k` of bin `d` is stored at `(first + k) % length` of its row of `map`.
    ///
    /// # Panics
    /// If lengths are inconsistent.
    pub fn transform(
        &self,
        instructions: Instructions,
        block: usize,
        samples: &[f32],
        scratch: &mut [f32],
        map: &mut MapRows,
    ) {
        assert_eq!(samples.len(), self.inputs * 2 * BLOCK);
        assert!(scratch.len() >= self.scratch_length());
        assert!(map.values.len() >= 2 * self.outputs() * map.row_length);
        assert!(map.length <= map.row_length && self.frequencies <= map.length);
        instructions.run(Block {
            product: self,
            block,
            samples,
            scratch,
            map,
        });
    }
}

/// Rows of a range-Doppler map before the range FFT.
pub struct MapRows<'a> {
    /// `[Doppler bin][real, imaginary][row_length]`.
    pub values: &'a mut [f32],
    /// Length of a row of either plane.
    pub row_length: usize,
    /// Length of the range FFT, at most `row_length`.
    pub length: usize,
    /// Index of frequency 0 in the range FFT.
    pub first: usize,
}

/// Number of pairs in the table, padded.
fn pairs(inputs: usize) -> usize {
    inputs.div_ceil(2).next_multiple_of(TOGETHER)
}

/// Pulses of a pair, symmetric about the middle; `None` for padding.
#[inline(always)]
fn pulses(inputs: usize, pair: usize) -> Option<[usize; 2]> {
    (pair < inputs.div_ceil(2)).then(|| [(inputs - 1) / 2 - pair, inputs / 2 + pair])
}

/// Kernel of one block of frequencies.
struct Block<'a, 'b> {
    product: &'a DopplerProduct,
    block: usize,
    samples: &'a [f32],
    scratch: &'a mut [f32],
    map: &'a mut MapRows<'b>,
}

/// Weighted sum and difference of two pulses, phasor of the bin, and its step.
#[derive(Clone, Copy)]
struct Pair<L: Lanes> {
    even: [L::Numbers; 2],
    odd: [L::Numbers; 2],
    at: [L::Numbers; 2],
    step: [L::Numbers; 2],
}

impl<L: Lanes> Pair<L> {
    #[inline(always)]
    fn new(lanes: L, samples: &[f32], inputs: usize, pair: usize, row: &[f32]) -> Self {
        // Padding pairs have weight 0.
        let [before, after] = pulses(inputs, pair).unwrap_or([0, 0]);
        let (a, b) = (lanes.load(row), lanes.load(&row[BLOCK..]));
        let [mut even, mut odd] = [[lanes.splat(0.0); 2]; 2];
        for (part, (even, odd)) in even.iter_mut().zip(&mut odd).enumerate() {
            let early = lanes.mul(a, lanes.load(&samples[(2 * before + part) * BLOCK..]));
            let late = lanes.load(&samples[(2 * after + part) * BLOCK..]);
            *even = lanes.mul_add(b, late, early);
            *odd = lanes.sub(lanes.mul(b, late), early);
        }
        Self {
            even,
            odd,
            at: [lanes.splat(1.0), lanes.splat(0.0)],
            step: [lanes.load(&row[2 * BLOCK..]), lanes.load(&row[3 * BLOCK..])],
        }
    }

    /// Advance to the next bin.
    #[inline(always)]
    fn turn(&mut self, lanes: L) {
        self.at = turned(lanes, self.at, self.step);
    }
}

/// Complex product.
#[inline(always)]
fn turned<L: Lanes>(
    lanes: L,
    [re, im]: [L::Numbers; 2],
    [cos, sin]: [L::Numbers; 2],
) -> [L::Numbers; 2] {
    [
        lanes.neg_mul_add(im, sin, lanes.mul(re, cos)),
        lanes.mul_add(im, cos, lanes.mul(re, sin)),
    ]
}

impl Kernel for Block<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self {
            product,
            block,
            samples,
            scratch,
            map,
        } = self;
        let DopplerProduct {
            inputs,
            reach,
            frequencies,
            ref table,
            ref drift,
        } = *product;
        let part = pairs(inputs) * PLANES * BLOCK;
        let table = &table[block * part..(block + 1) * part];
        let count = BLOCK.min(frequencies - block * BLOCK);
        let sums = &mut scratch[..(reach + 1) * 4 * L::COUNT];
        for lane in (0..count).step_by(L::COUNT) {
            sums.fill(0.0);
            for (few, rows) in table.chunks_exact(TOGETHER * PLANES * BLOCK).enumerate() {
                let (row, next) = rows.split_at(PLANES * BLOCK);
                let own = &samples[lane..];
                let first = few * TOGETHER;
                let mut one = Pair::new(lanes, own, inputs, first, &row[lane..]);
                let mut other = Pair::new(lanes, own, inputs, first + 1, &next[lane..]);
                let (zero, others) = sums.split_at_mut(4 * L::COUNT);
                let cosines = zero[..2 * L::COUNT].chunks_exact_mut(L::COUNT);
                for (i, sum) in cosines.enumerate() {
                    let both = lanes.add(one.even[i], other.even[i]);
                    lanes.store(lanes.add(lanes.load(sum), both), sum);
                }
                for bin in others.chunks_exact_mut(4 * L::COUNT) {
                    one.turn(lanes);
                    other.turn(lanes);
                    let [[cos, sin], [other_cos, other_sin]] = [one.at, other.at];
                    let (cosines, sines) = bin.split_at_mut(2 * L::COUNT);
                    for (i, sum) in cosines.chunks_exact_mut(L::COUNT).enumerate() {
                        let first = lanes.mul_add(cos, one.even[i], lanes.load(sum));
                        lanes.store(lanes.mul_add(other_cos, other.even[i], first), sum);
                    }
                    for (i, sum) in sines.chunks_exact_mut(L::COUNT).enumerate() {
                        let first = lanes.mul_add(sin, one.odd[i], lanes.load(sum));
                        lanes.store(lanes.mul_add(other_sin, other.odd[i], first), sum);
                    }
                }
            }
            let mut later = [lanes.splat(1.0), lanes.splat(0.0)];
            let drift = (!drift.is_empty()).then(|| &drift[block * 2 * BLOCK + lane..]);
            let width = L::COUNT.min(count - lane);
            let first = (map.first + block * BLOCK + lane) % map.length;
            for (d, bin) in sums.chunks_exact(4 * L::COUNT).enumerate() {
                let [re, im] = [lanes.load(bin), lanes.load(&bin[L::COUNT..])];
                let sines = &bin[2 * L::COUNT..];
                let [sin_re, sin_im] = [lanes.load(sines), lanes.load(&sines[L::COUNT..])];
                let mut above = [lanes.sub(re, sin_im), lanes.add(im, sin_re)];
                let mut below = [lanes.add(re, sin_im), lanes.sub(im, sin_re)];
                if let Some(drift) = drift {
                    if d > 0 {
                        let step = [lanes.load(drift), lanes.load(&drift[BLOCK..])];
                        later = turned(lanes, later, step);
                    }
                    let earlier = [later[0], lanes.sub(lanes.splat(0.0), later[1])];
                    above = turned(lanes, above, later);
                    below = turned(lanes, below, earlier);
                }
                put(lanes, above, map, reach + d, first, width);
                if d > 0 {
                    put(lanes, below, map, reach - d, first, width);
                }
            }
        }
    }
}

/// Store the first `width` values in a row of the map from index `first`, wrapping at its end.
#[inline(always)]
fn put<L: Lanes>(
    lanes: L,
    parts: [L::Numbers; 2],
    map: &mut MapRows,
    row: usize,
    first: usize,
    width: usize,
) {
    let rows = &mut map.values[2 * row * map.row_length..][..2 * map.row_length];
    for (numbers, row) in parts.into_iter().zip(rows.chunks_exact_mut(map.row_length)) {
        let row = &mut row[..map.length];
        if width == L::COUNT && first + L::COUNT <= map.length {
            lanes.store(numbers, &mut row[first..]);
            continue;
        }
        let mut values = [0.0f32; GROUP];
        lanes.store(numbers, &mut values);
        for (i, &value) in values[..width].iter().enumerate() {
            row[(first + i) % map.length] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Numbers, turned, wide};
    use num_complex::Complex32;

    /// Shapes of either parity, one pulse, one bin, with and without drift, bands that fill no block.
    const SHAPES: [(usize, usize, usize, f64, f64); 6] = [
        (1, 0, 5, 0.5, 0.0),
        (2, 7, 64, 0.03, 0.0),
        (39, 11, 77, 1.0 / 78.0, 0.0),
        (130, MAX_REACH, 3, -1.0 / 256.0, 0.0),
        (33, 5, 130, 1.0 / 70.0, -4e-3),
        (8, 9, 30, -1.0 / 17.0, 0.02),
    ];

    struct Trial {
        scales: Vec<f64>,
        shape: Shape,
        samples: Vec<Complex32>,
    }

    fn weight(k: usize, m: usize) -> f64 {
        1.0 + 0.003 * (k as f64) - 0.002 * m as f64
    }

    impl Trial {
        fn new(
            (inputs, reach, count, spacing, input_drift): (usize, usize, usize, f64, f64),
        ) -> Self {
            Self {
                scales: (0..count).map(|k| 0.96 + 6e-4 * k as f64).collect(),
                shape: Shape {
                    inputs,
                    input_centre: (inputs as f64 - 1.0) / 2.0,
                    input_drift,
                    outputs: 2 * reach + 1,
                    output_centre: reach as f64,
                    spacing,
                },
                samples: Numbers::new(inputs as u64).samples(inputs * count),
            }
        }

        /// Map with rows of `length`, frequency 0 at `first`.
        fn map(&self, instructions: Instructions, length: usize, first: usize) -> Vec<Complex32> {
            let Self {
                scales,
                shape,
                samples,
            } = self;
            let product = DopplerProduct::new(scales, shape, weight);
            let row_length = length + 3;
            let mut values = vec![0.0; 2 * shape.outputs * row_length];
            let mut scratch = vec![f32::NAN; product.scratch_length()];
            for block in 0..scales.len().div_ceil(BLOCK) {
                let mut planes = vec![0.0; shape.inputs * 2 * BLOCK];
                for (m, row) in samples.chunks_exact(scales.len()).enumerate() {
                    for (i, z) in row.iter().skip(block * BLOCK).take(BLOCK).enumerate() {
                        planes[2 * m * BLOCK + i] = z.re;
                        planes[(2 * m + 1) * BLOCK + i] = z.im;
                    }
                }
                let mut map = MapRows {
                    values: &mut values,
                    row_length,
                    length,
                    first,
                };
                product.transform(instructions, block, &planes, &mut scratch, &mut map);
            }
            let rows = values.chunks_exact(2 * row_length);
            let both = rows.flat_map(|row| row[..row_length].iter().zip(&row[row_length..]));
            both.map(|(&re, &im)| Complex32::new(re, im)).collect()
        }
    }

    #[test]
    fn doppler_product_agrees_with_defining_sum() {
        for of in SHAPES {
            let trial = Trial::new(of);
            let Trial {
                scales,
                shape,
                samples,
            } = &trial;
            let count = scales.len();
            let (length, first) = (2 * count + 1, 2 * count - count / 2);
            let map = trial.map(Instructions::Portable, length, first);
            let (mut error, mut power) = (0.0, 0.0);
            for (d, row) in map.chunks_exact(length + 3).enumerate() {
                for (place, &got) in row.iter().enumerate() {
                    let k = (place + length - first) % length;
                    if place >= length || k >= count {
                        // Other elements are unchanged.
                        assert_eq!(got, Complex32::ZERO);
                        continue;
                    }
                    let later = shape.input_drift * (k as f64 - (count / 2) as f64);
                    let mut expected = Complex64::ZERO;
                    for m in 0..shape.inputs {
                        let u = m as f64 - (shape.inputs as f64 - 1.0) / 2.0 + later;
                        let off = d as f64 - (shape.outputs / 2) as f64;
                        let turn = turned(scales[k] * shape.spacing * u * off);
                        expected += wide(samples[m * count + k]) * weight(k, m) * turn;
                    }
                    error += (wide(got) - expected).norm_sqr();
                    power += expected.norm_sqr();
                }
            }
            let relative = (error / power).sqrt();
            println!("{of:?}: {relative:.1e}");
            // Phasor error of bin d: d times the step's rounding, 2.5e-8 RMS, plus d product roundings, 6e-8 times the square root of d, and the same again
            // with drift; sums of M / 4 roundings at a fraction of their value each: 1.7e-8 times the square root of M. RMS of d over bins: reach / 1.7.
            let [reach, inputs] = [of.1, of.0].map(|count| count as f64);
            let drifts = if of.4 == 0.0 { 1.0 } else { 2.0 };
            let phasors = drifts * (2.5e-8 * reach / 1.7 + 6e-8 * reach.sqrt());
            let allowed = 1.5e-7 + phasors + 1.7e-8 * inputs.sqrt();
            assert!(relative < allowed, "{of:?}: {relative} {allowed}");
        }
    }

    #[test]
    fn doppler_product_is_bit_identical_in_all_instruction_sets() {
        for of in SHAPES {
            let trial = Trial::new(of);
            let plain = trial.map(Instructions::Portable, 300, 290);
            for instructions in Instructions::available() {
                let other = trial.map(instructions, 300, 290);
                assert!(other == plain, "{of:?} {}", instructions.name());
            }
        }
    }

    #[test]
    fn doppler_product_supports_few_bins_evenly_about_zero() {
        let shape = Trial::new(SHAPES[2]).shape;
        assert!(DopplerProduct::suits(&shape));
        for wrong in [
            Shape {
                outputs: 2 * MAX_REACH + 3,
                output_centre: MAX_REACH as f64 + 1.0,
                ..shape
            },
            Shape {
                outputs: shape.outputs + 1,
                ..shape
            },
            Shape {
                input_centre: 0.0,
                ..shape
            },
        ] {
            assert!(!DopplerProduct::suits(&wrong), "{wrong:?}");
        }
    }
}
