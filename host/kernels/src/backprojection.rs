//! A pulse's range profile, read and added at many pixels.
//!
//! ```text
//! sum[i] += w exp(+j 2 pi cycles_m path[i]) profile(bins_m path[i])
//! ```
//!
//! `profile` has `L` values of one turn, the first once more at the end ([`subaperture_signal::range_profile`]), is periodic and
//! is read linearly between values. Paths are metres less the pulse's datum.
//!
//! **Rounding.** Paths, places and phases are float64 up to the fraction of a bin and the reduced phase, which are float32, as are
//! reading, phasor and sums: for values of magnitude 1 a term is good to 1e-6, mostly to 2e-7, whatever the path.
//! A sum grows by one term a call: whoever adds many pulses bounds their number between sums by what it adds up.
//!
//! Cost a point: a square root for each antenna that stands apart, a sine and cosine, two neighbouring values read.

use num_complex::Complex32;
use subaperture_signal::phase::phasor32;

use crate::paths::{Antennas, Points, paths};

/// Points whose paths are held at a time: 2 KiB.
const RUN: usize = 256;

/// What a pulse's profile means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Cycles of the carrier a metre of path: the centre's frequency over the speed of light.
    pub cycles_m: f64,
    /// Turns of the profile a metre of path: the step of frequency over the speed of light.
    pub bins_m: f64,
    /// Factor of what is added.
    pub weight: f32,
}

/// Adds a pulse to the sums of `points`: [`paths`], then [`add_profile`].
///
/// # Panics
/// If there are not as many sums as points, or `profile` has fewer than two values.
pub fn add_pulse(
    profile: &[Complex32],
    scale: &Scale,
    antennas: &Antennas,
    points: &Points,
    sums: &mut [Complex32],
) {
    assert_eq!(points.len(), sums.len());
    let mut paths_m = [0.0; RUN];
    for (run, sums) in sums.chunks_mut(RUN).enumerate() {
        let first = run * RUN;
        let paths_m = &mut paths_m[..sums.len()];
        paths(antennas, points.part(first..first + sums.len()), paths_m);
        add_profile(profile, scale, paths_m, sums);
    }
}

/// Adds a pulse's profile, `L + 1` values, to the sums of points at these paths.
///
/// # Panics
/// If there are not as many sums as paths, or `profile` has fewer than two values.
pub fn add_profile(profile: &[Complex32], scale: &Scale, paths_m: &[f64], sums: &mut [Complex32]) {
    assert_eq!(paths_m.len(), sums.len());
    let length = profile.len() - 1;
    assert!(length > 0);
    for (&path_m, sum) in paths_m.iter().zip(sums) {
        let (whole, fraction) = place(path_m * scale.bins_m, length);
        let value = between(profile, whole, fraction);
        *sum += phasor32(path_m * scale.cycles_m) * value * scale.weight;
    }
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

/// [`add_profile`] of a pulse with several profiles of `length + 1` values, one after another, read linearly between the two about
/// a point's level; beyond the last by those two. Of one profile alone the level must be 0.
///
/// # Panics
/// If there are not as many sums as points, or a level is read that is not there.
pub fn add_blurred(
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

    #[test]
    fn pulses_are_added_as_the_sum_says() {
        let mut numbers = Numbers::new(1);
        for (length, num_pulses, num_points) in [(1, 1, 3), (97, 1, 1000), (240, 9, 700)] {
            let mut place_m = |reach_m: f64| [0; 3].map(|_| reach_m * numbers.signed());
            let places: Vec<[f64; 3]> = (0..num_points).map(|_| place_m(60.0)).collect();
            let antennas: Vec<[[f64; 3]; 2]> = (0..num_pulses)
                .map(|n| {
                    let one = place_m(9000.0);
                    [one, if n % 2 == 0 { one } else { place_m(9000.0) }]
                })
                .collect();
            let mut points = Points::default();
            places.iter().for_each(|&point| points.push(point));
            let mut sums = vec![Complex32::ZERO; num_points];
            let mut expected = vec![Complex64::ZERO; num_points];
            for (n, [transmitter_m, receiver_m]) in antennas.into_iter().enumerate() {
                let profile = profile(&mut numbers, length);
                let datum_m = 9000.0 + n as f64;
                let scale = Scale {
                    cycles_m: 33.4,
                    // Backwards where frequencies fall.
                    bins_m: if n == 4 { -0.0077 } else { 0.0077 },
                    weight: 1.0 - n as f32 / 16.0,
                };
                let from = Antennas {
                    transmitter_m,
                    receiver_m,
                    datum_m,
                };
                add_pulse(&profile, &scale, &from, &points, &mut sums);
                for (point, sum) in places.iter().zip(&mut expected) {
                    let leg = |a: [f64; 3]| {
                        let square = |i: usize| (point[i] - a[i]).powi(2);
                        (square(0) + square(1) + square(2)).sqrt()
                    };
                    let path_m = leg(transmitter_m) + leg(receiver_m) - datum_m;
                    let value = read(&profile, path_m * scale.bins_m);
                    *sum += turned(path_m * scale.cycles_m) * value * f64::from(scale.weight);
                }
            }
            // A sum of magnitude n is rounded when a term is added; what is rounded in float64 (1e-11 m here) turns a
            // phase by 2e-9.
            let count = num_pulses as f64;
            let allowed = count * TERM + 8.5e-8 * count * count / 2.0;
            for (got, expected) in sums.iter().zip(expected) {
                let error = (wide(*got) - expected).norm();
                assert!(error < allowed, "{length} {num_pulses}: {error} {allowed}");
            }
        }
    }

    /// A path that is a hair short of a whole turn rounds to its end, where the first value stands again.
    #[test]
    fn a_profile_joins_at_its_ends() {
        let mut numbers = Numbers::new(2);
        let profile = profile(&mut numbers, 8);
        let scale = Scale {
            cycles_m: 0.0,
            bins_m: 1.0,
            weight: 1.0,
        };
        let paths_m = [-1e-18, 0.0, 1.0, -1.0, 5.0 - 1e-15];
        let mut sums = [Complex32::ZERO; 5];
        add_profile(&profile, &scale, &paths_m, &mut sums);
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
            bins_m: 0.0,
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
        add_blurred(&each.concat(), length, &scale, &points, &mut sums);
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
        add_blurred(&each[2], length, &scale, &alone, &mut sum);
        let expected = turned(alone[0].path_m * 7.7) * read(&each[2], alone[0].turns) * 0.5;
        assert!((wide(sum[0]) - expected).norm() < TERM);
    }
}
