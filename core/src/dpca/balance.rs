//! Complex gain between the channels, by medians over range bins.

use num_complex::Complex32;

use crate::stream::{Patch, PatchMap};

/// Smallest squared coherence of a range bin that counts.
const MIN_COHERENCE: f32 = 0.5;

/// Ratio of a range bin that does not count.
const LEFT_OUT: Complex32 = Complex32::new(f32::NAN, f32::NAN);

/// Estimate of the gain in steps of bounded duration. All steps take the same map of channel 1 and the same kept map of channel 0.
///
/// ```
/// # use subaperture_core::Complex32;
/// # use subaperture_core::dpca::Balance;
/// # use subaperture_core::stream::PatchMap;
/// # fn gain(map: &PatchMap<'_>, kept: &mut [Complex32]) -> Complex32 {
/// let mut balance = Balance::new();
/// while balance.step(map, kept) {
///     // Receive a pulse.
/// }
/// balance.gain()
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Balance {
    next: Step,
    gain: Complex32,
}

/// Next step of the estimate.
#[derive(Clone, Copy, Debug)]
enum Step {
    /// Ratio of a range bin.
    Ratio(usize),
    /// Number of range bins that count.
    Count,
    /// Next bit of both medians. Of the ordered ratios, the median is number `rank`.
    Median {
        rank: u32,
        bit: u32,
        found: [u32; 2],
    },
    Done,
}

impl Balance {
    /// Create an estimate at its first step.
    pub const fn new() -> Self {
        Self {
            next: Step::Ratio(0),
            gain: Complex32::ONE,
        }
    }

    /// Factor from channel 1 to channel 0, after the last step.
    pub const fn gain(&self) -> Complex32 {
        self.gain
    }

    /// Do one step: the cells of a range bin, or one pass over the ratios of the range bins, which are held after the kept map. Returns false
    /// after the last one.
    pub fn step(&mut self, map: &PatchMap<'_>, kept: &mut [Complex32]) -> bool {
        let patch = &map.header.patch;
        let bins = patch.num_range_bins();
        let Some((kept, rest)) = kept.split_at_mut_checked(patch.map_len()) else {
            return false;
        };
        let Some(ratios) = rest.get_mut(..bins) else {
            return false;
        };
        self.next = match self.next {
            Step::Ratio(column) => {
                if let Some(place) = ratios.get_mut(column) {
                    *place = ratio(map, patch, kept, column);
                }
                match column + 1 {
                    next if next < bins => Step::Ratio(next),
                    _ => Step::Count,
                }
            }
            Step::Count => match ratios.iter().filter(|ratio| !ratio.re.is_nan()).count() as u32 {
                0 => Step::Done,
                count => Step::Median {
                    rank: (count - 1) / 2,
                    bit: 1 << 31,
                    found: [0; 2],
                },
            },
            Step::Median { rank, bit, found } => {
                let [re, im] = found;
                let re = next_key(re | bit, re, rank, ratios.iter().map(|z| z.re));
                let im = next_key(im | bit, im, rank, ratios.iter().map(|z| z.im));
                match bit >> 1 {
                    0 => {
                        self.gain = Complex32::new(value(re), value(im));
                        Step::Done
                    }
                    bit => Step::Median {
                        rank,
                        bit,
                        found: [re, im],
                    },
                }
            }
            Step::Done => return false,
        };
        true
    }
}

impl Default for Balance {
    fn default() -> Self {
        Self::new()
    }
}

/// Key of the median with one more bit: `higher` if value number `rank` is not below it, else `key`.
fn next_key(higher: u32, key: u32, rank: u32, values: impl Iterator<Item = f32>) -> u32 {
    let below = values.filter(|value| order(*value) < higher).count();
    if below as u32 <= rank { higher } else { key }
}

/// Least-squares factor from channel 1 to channel 0 over the cells of a range bin.
fn ratio(map: &PatchMap<'_>, patch: &Patch, kept: &[Complex32], column: usize) -> Complex32 {
    let range_bin = column as i32 - i32::from(patch.range_reach);
    let cells = kept.iter().skip(column).step_by(patch.num_range_bins());
    let (mut cross, mut first, mut second) = (Complex32::ZERO, 0.0f32, 0.0f32);
    for (doppler_bin, cell) in (-i32::from(patch.doppler_reach)..).zip(cells) {
        let other = map.at(doppler_bin, range_bin);
        cross += cell * other.conj();
        first += cell.norm_sqr();
        second += other.norm_sqr();
    }
    let ratio = cross / second;
    let coherent = cross.norm_sqr() > MIN_COHERENCE * first * second;
    if coherent && ratio.re.is_finite() && ratio.im.is_finite() {
        ratio
    } else {
        LEFT_OUT
    }
}

/// Key with the order of the values; NaN comes last.
fn order(value: f32) -> u32 {
    match value.to_bits() {
        _ if value.is_nan() => u32::MAX,
        bits if bits >> 31 == 1 => !bits,
        bits => bits | 1 << 31,
    }
}

/// Value of a key.
fn value(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 { key ^ 1 << 31 } else { !key })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{MapHeader, MapSamples, Node};

    /// Map of three Doppler bins and `2 reach + 1` range bins.
    fn map(samples: &[Complex32], range_reach: u16) -> PatchMap<'_> {
        PatchMap {
            header: MapHeader {
                sub_cpi: 0,
                patch_index: 0,
                channel: 1,
                num_pulses: 4,
                patch: Patch {
                    centre_m: [0.0; 3],
                    range_reach,
                    doppler_reach: 1,
                },
                time_s: [0.0; 2],
                weight_sum: 4.0,
                nodes: [Node::default(); 2],
            },
            samples: MapSamples::Float(samples),
        }
    }

    fn gain(samples: &[Complex32], kept: &mut [Complex32], range_reach: u16) -> Complex32 {
        let mut balance = Balance::new();
        let mut steps = 0;
        while balance.step(&map(samples, range_reach), kept) {
            steps += 1;
        }
        assert!(steps <= 2 * usize::from(range_reach) + 1 + 33);
        balance.gain()
    }

    #[test]
    fn gain_is_the_median_over_range_bins() {
        // Ratios -2 - 3j, ..., 2 + j in the five range bins, in another order.
        let order = [3, 0, 4, 1, 2];
        let ratio =
            |place: usize| Complex32::new(order[place] as f32 - 2.0, order[place] as f32 - 3.0);
        let mut samples = [Complex32::ZERO; 15];
        let mut kept = [Complex32::ZERO; 20];
        for row in 0..3 {
            for place in 0..5 {
                let sample = Complex32::new(1.0 + row as f32, 0.5 * place as f32);
                samples[5 * row + place] = sample;
                kept[5 * row + place] = sample * ratio(place);
            }
        }
        // Rounding of sums of three products.
        assert!((gain(&samples, &mut kept, 2) - Complex32::new(0.0, -1.0)).l1_norm() < 1e-5);
        // Two range bins with a strong target.
        for row in 0..3 {
            samples[5 * row] *= 1e6;
            kept[5 * row + 2] *= Complex32::new(0.0, -1e6);
        }
        let robust = gain(&samples, &mut kept, 2);
        assert!(
            (-2.01..=2.01).contains(&robust.re) && (-3.01..=1.01).contains(&robust.im),
            "{robust}"
        );
    }

    #[test]
    fn gain_of_channels_without_coherence_is_one() {
        let samples = [Complex32::ONE, Complex32::ONE, Complex32::ONE];
        for kept in [[0.0; 3], [1.0, -1.0, 0.0], [f32::NAN; 3], [f32::MAX; 3]] {
            let [a, b, c] = kept.map(Complex32::from);
            assert_eq!(
                gain(&samples, &mut [a, b, c, Complex32::ZERO], 0),
                Complex32::ONE
            );
        }
        let silent = [Complex32::ZERO; 3];
        assert_eq!(gain(&silent, &mut [Complex32::ONE; 4], 0), Complex32::ONE);
    }

    #[test]
    fn keys_have_the_order_of_the_values() {
        let values = [
            f32::NEG_INFINITY,
            -2.5,
            -1e-30,
            0.0,
            1e-30,
            3.0,
            f32::INFINITY,
        ];
        for pair in values.windows(2) {
            assert!(order(pair[0]) < order(pair[1]), "{pair:?}");
        }
        for number in values {
            assert_eq!(value(order(number)), number);
        }
        assert!(order(f32::NAN) > order(f32::INFINITY) && order(-f32::NAN) > order(f32::INFINITY));
    }
}
