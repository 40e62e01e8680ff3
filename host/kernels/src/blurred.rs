//! The profiles of a pulse that motion from sample to sample has blurred, read and added at many points.
//!
//! ```text
//! sum[i] += w exp(+j 2 pi cycles_m path[i]) profile_level[i](L turns[i])
//! ```
//!
//! Each profile has `L` values of one turn, the first once more at the end ([`subaperture_signal::range_profile`], of degree 1), is
//! periodic and is read linearly between values, and between the two profiles about a point's level. Paths are metres less the
//! pulse's datum.
//!
//! **Rounding.** Paths, places and phases are float64 up to the fraction of a bin and the reduced phase, which are float32, as are
//! reading, phasor and sums: for values of magnitude 1 a term is good to 2e-6, mostly to 4e-7, whatever the path.
//! A sum grows by one term a call: whoever adds many pulses bounds their number between sums by what it adds up.
//!
//! Cost a point: a sine and cosine, four values read.

use num_complex::Complex32;
use subaperture_signal::phase::phasor32;

/// What a pulse's profiles mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Cycles of the carrier a metre of path: the centre's frequency over the speed of light.
    pub cycles_m: f64,
    /// Factor of what is added.
    pub weight: f32,
}

/// Where a point reads the profiles of a pulse that motion from sample to sample has blurred.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blurred {
    /// Path less the datum, metres: of the phase.
    pub path_m: f64,
    /// Place in a profile, turns.
    pub turns: f64,
    /// Place among the profiles, the first at 0, the next at 1.
    pub level: f64,
}

/// Adds a pulse with several profiles of `length + 1` values, one after another, read linearly between the two about
/// a point's level; beyond the last by those two. Of one profile alone the level must be 0.
///
/// # Panics
/// If there are not as many sums as points, or a level is read that is not there.
pub fn add(
    profiles: &[Complex32],
    length: usize,
    scale: &Scale,
    points: &[Blurred],
    sums: &mut [Complex32],
) {
    assert_eq!(points.len(), sums.len());
    let last = (profiles.len() / (length + 1)).saturating_sub(2);
    for (point, sum) in points.iter().zip(sums) {
        let (whole, fraction) = place(point.turns, length);
        let read = |level: usize| between(profiles, level * (length + 1) + whole, fraction);
        let level = (point.level as usize).min(last);
        let part = (point.level - level as f64) as f32;
        let mut value = read(level);
        if part > 0.0 {
            value += (read(level + 1) - value) * part;
        }
        *sum += phasor32(point.path_m * scale.cycles_m) * value * scale.weight;
    }
}

/// The bin of a profile before a place in turns, and the part of a bin beyond it.
#[inline]
fn place(turns: f64, length: usize) -> (usize, f32) {
    let bin = (turns - turns.floor()) * length as f64;
    // `turns - floor` may round to 1; the last whole bin then, where the repeated value stands.
    let whole = (bin as usize).min(length - 1);
    (whole, (bin - whole as f64) as f32)
}

/// A fraction of the way from a value to the next.
#[inline]
fn between(values: &[Complex32], at: usize, fraction: f32) -> Complex32 {
    values[at] + (values[at + 1] - values[at]) * fraction
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Numbers, turned, wide};
    use num_complex::Complex64;

    /// One term for values of magnitude 1: the phase is rounded to float32 (half a unit of pi, 1.2e-7), its sine and cosine to
    /// one unit each (8e-8 together); a value is read by a difference, a product and a sum of numbers up to 2, at a fraction that
    /// is rounded (4 times 8e-8); two products follow (3e-7 and 6e-8).
    const TERM: f64 = 1e-6;

    fn profile(numbers: &mut Numbers, length: usize) -> Vec<Complex32> {
        let mut profile = numbers.samples(length);
        profile.push(profile[0]);
        profile
    }

    /// A profile at any place, in float64: from the left value to the right, around the end.
    fn read(profile: &[Complex32], turns: f64) -> Complex64 {
        let length = profile.len() - 1;
        let bin = turns.rem_euclid(1.0) * length as f64;
        let left = bin.floor();
        let part = bin - left;
        let value = |i: usize| wide(profile[i % length]);
        value(left as usize) * (1.0 - part) + value(left as usize + 1) * part
    }

    /// A place that is a hair short of a whole turn rounds to its end, where the first value stands again.
    #[test]
    fn a_profile_joins_at_its_ends() {
        let mut numbers = Numbers::new(2);
        let profile = profile(&mut numbers, 8);
        let scale = Scale {
            cycles_m: 0.0,
            weight: 1.0,
        };
        let points = [-1e-18, 0.0, 1.0, -1.0, 5.0 - 1e-15].map(|turns| Blurred {
            path_m: 0.0,
            turns,
            level: 0.0,
        });
        let mut sums = [Complex32::ZERO; 5];
        add(&profile, 8, &scale, &points, &mut sums);
        for sum in sums {
            assert!((wide(sum) - wide(profile[0])).norm() < TERM, "{sum}");
        }
    }

    #[test]
    fn blurred_profiles_are_read_between_levels() {
        let mut numbers = Numbers::new(3);
        let (length, count) = (30, 4);
        let each: Vec<Vec<Complex32>> = (0..count).map(|_| profile(&mut numbers, length)).collect();
        let scale = Scale {
            cycles_m: 7.7,
            weight: 0.5,
        };
        // From the first to a little beyond the last.
        let points: Vec<Blurred> = (0..300)
            .map(|i| Blurred {
                path_m: 1e3 * numbers.signed(),
                turns: 40.0 * numbers.signed(),
                level: f64::from(i) / 299.0 * 3.01,
            })
            .collect();
        let mut sums = vec![Complex32::ZERO; points.len()];
        add(&each.concat(), length, &scale, &points, &mut sums);
        for (point, got) in points.iter().zip(sums) {
            let low = (point.level.floor() as usize).min(count - 2);
            let part = point.level - low as f64;
            let [low, high] = [low, low + 1].map(|i| read(&each[i], point.turns));
            let value = low * (1.0 - part) + high * part;
            let expected = turned(point.path_m * scale.cycles_m) * value * 0.5;
            // Two values are read, and one between them.
            let error = (wide(got) - expected).norm();
            assert!(error < 2.0 * TERM, "{point:?}: {error}");
        }
        let alone = [Blurred {
            level: 0.0,
            ..points[7]
        }];
        let mut sum = [Complex32::ZERO];
        add(&each[2], length, &scale, &alone, &mut sum);
        let expected = turned(alone[0].path_m * 7.7) * read(&each[2], alone[0].turns) * 0.5;
        assert!((wide(sum[0]) - expected).norm() < TERM);
    }
}
