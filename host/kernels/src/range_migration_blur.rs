//! Backprojection of a pulse whose range profiles are smeared by intra-pulse motion, onto arbitrary points.
//!
//! ```text
//! sum[i] += w exp(+j 2 pi cycles_m path[i]) profile_level[i](L turns[i])
//! ```
//!
//! Each profile has `L` values over one period, the first repeated at the end ([`subaperture_signal::range_profile`], degree 1).
//! It is interpolated linearly in range, and linearly between the two profiles adjacent to a point's level. Paths are in metres minus the
//! pulse's datum.
//!
//! **Accuracy** Paths, positions and phases are float64 up to the fraction of a bin and the reduced phase, which are float32, as are
//! interpolation, phasor and sums. For values of magnitude 1 the error of a term is below 2e-6, mostly 4e-7, for any path.
//! A sum grows by one term per call; the caller bounds the number of pulses per float32 sum.
//!
//! **Cost** per point: one sine and cosine, four values.

use num_complex::Complex32;
use subaperture_signal::phase::phasor32;

/// Scale of a pulse's profiles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Carrier cycles per metre of path: centre frequency over the speed of light.
    pub cycles_m: f64,
    /// Weight of the pulse.
    pub weight: f32,
}

/// Position of a point in the profiles of a pulse with intra-pulse motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmearedPosition {
    /// Path minus the datum, metres; determines the phase.
    pub path_m: f64,
    /// Position in a profile, periods.
    pub turns: f64,
    /// Position among the profiles; the first is at 0, the next at 1.
    pub level: f64,
}

/// Add a pulse with several profiles of `length + 1` values, stored consecutively, with linear interpolation between the two profiles adjacent to
/// a point's level and linear extrapolation beyond the last. With one profile the level must be 0.
///
/// # Panics
/// If the numbers of sums and points differ, or a level is out of range.
pub fn add(
    profiles: &[Complex32],
    length: usize,
    scale: &Scale,
    points: &[SmearedPosition],
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

/// Bin below a position in periods, and the fraction to the next bin.
#[inline]
fn place(turns: f64, length: usize) -> (usize, f32) {
    let bin = (turns - turns.floor()) * length as f64;
    // `turns - floor` may round to 1: use the last bin, whose next value is the repeated one.
    let whole = (bin as usize).min(length - 1);
    (whole, (bin - whole as f64) as f32)
}

/// Linear interpolation between a value and the next.
#[inline]
fn between(values: &[Complex32], at: usize, fraction: f32) -> Complex32 {
    values[at] + (values[at + 1] - values[at]) * fraction
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Numbers, turned, wide};
    use num_complex::Complex64;

    /// Error bound of a term for values of magnitude 1: phase rounded to float32 (half a unit of pi, 1.2e-7), sine and cosine
    /// one unit each (8e-8 together); interpolation by a difference, a product and a sum of numbers up to 2, with a rounded fraction
    /// (4 times 8e-8); two products (3e-7 and 6e-8).
    const TERM: f64 = 1e-6;

    fn profile(numbers: &mut Numbers, length: usize) -> Vec<Complex32> {
        let mut profile = numbers.samples(length);
        profile.push(profile[0]);
        profile
    }

    /// Periodic linear interpolation of a profile, float64.
    fn read(profile: &[Complex32], turns: f64) -> Complex64 {
        let length = profile.len() - 1;
        let bin = turns.rem_euclid(1.0) * length as f64;
        let left = bin.floor();
        let part = bin - left;
        let value = |i: usize| wide(profile[i % length]);
        value(left as usize) * (1.0 - part) + value(left as usize + 1) * part
    }

    /// A position just below a whole period rounds to the repeated value.
    #[test]
    fn profile_is_periodic_at_its_ends() {
        let mut numbers = Numbers::new(2);
        let profile = profile(&mut numbers, 8);
        let scale = Scale {
            cycles_m: 0.0,
            weight: 1.0,
        };
        let points = [-1e-18, 0.0, 1.0, -1.0, 5.0 - 1e-15].map(|turns| SmearedPosition {
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
    fn smeared_profiles_are_interpolated_between_levels() {
        let mut numbers = Numbers::new(3);
        let (length, count) = (30, 4);
        let each: Vec<Vec<Complex32>> = (0..count).map(|_| profile(&mut numbers, length)).collect();
        let scale = Scale {
            cycles_m: 7.7,
            weight: 0.5,
        };
        // Levels from the first profile to slightly beyond the last.
        let points: Vec<SmearedPosition> = (0..300)
            .map(|i| SmearedPosition {
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
            // Two interpolations in range and one between levels.
            let error = (wide(got) - expected).norm();
            assert!(error < 2.0 * TERM, "{point:?}: {error}");
        }
        let alone = [SmearedPosition {
            level: 0.0,
            ..points[7]
        }];
        let mut sum = [Complex32::ZERO];
        add(&each[2], length, &scale, &alone, &mut sum);
        let expected = turned(alone[0].path_m * 7.7) * read(&each[2], alone[0].turns) * 0.5;
        assert!((wide(sum[0]) - expected).norm() < TERM);
    }
}
