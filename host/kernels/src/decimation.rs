//! One sample of several, one pulse of several: a band-limited history on fewer places.
//!
//! With `q` old places for a new one, a value at the old place `k = q l + f` goes to the `W` new places about it, by the weights of a
//! kernel at the fraction `f / q`:
//!
//! ```text
//! new[l + i] += h[f][i] old[q l + f],    i = 0 .. W-1,  f = 0 .. q-1
//! ```
//!
//! so new place 0 is that of the old place `-(W/2 - 1) q`, and `N` old places make `(N - 1) / q + W` new ones. This is the
//! transpose of interpolation: what a sum makes of the old places it makes of the new ones.
//!
//! Sums are float32, of at most `W q` values each: some `sqrt(W q)` roundings of 6e-8.

use num_complex::Complex32;
use subaperture_signal::phase::narrow;

use crate::compensation::Ramp;

/// Adds samples, each turned by the ramp, to the new places of their pulse: `weights` for each fraction, `W` of them.
///
/// # Panics
/// If `new` has fewer than `(samples.len() - 1) / weights.len() + W` places.
#[inline]
pub fn add_samples<const W: usize>(
    samples: &[Complex32],
    mut ramp: Ramp,
    weights: &[[f32; W]],
    new: &mut [Complex32],
) {
    for (first, group) in samples.chunks(weights.len()).enumerate() {
        let places = &mut new[first..first + W];
        for ((z, weights), turn) in group.iter().zip(weights).zip(&mut ramp) {
            let value = z * narrow(turn);
            for (place, weight) in places.iter_mut().zip(weights) {
                *place += value * weight;
            }
        }
    }
}

/// Adds a pulse to the `W` new pulses about it, one after another in `new`.
///
/// # Panics
/// If `new` is not `W` times as long as `pulse`.
#[inline]
pub fn add_pulse<const W: usize>(pulse: &[Complex32], weights: &[f32; W], new: &mut [Complex32]) {
    assert_eq!(new.len(), W * pulse.len());
    for (new, &weight) in new.chunks_exact_mut(pulse.len()).zip(weights) {
        for (sum, value) in new.iter_mut().zip(pulse) {
            *sum += value * weight;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Numbers, turned, wide};
    use num_complex::Complex64;

    #[test]
    fn samples_go_where_the_sum_says() {
        let mut numbers = Numbers::new(1);
        for (count, by) in [(100, 3), (101, 4), (1, 2), (64, 64), (12, 1)] {
            let samples = numbers.samples(count);
            let weights: Vec<[f32; 6]> = (0..by)
                .map(|_| [0; 6].map(|_| numbers.signed() as f32))
                .collect();
            let mut new = vec![Complex32::ZERO; (count - 1) / by + 6];
            let (start, step) = (17.3, 0.21);
            add_samples(&samples, Ramp::new(start, step, 1.0), &weights, &mut new);
            for (place, got) in new.iter().enumerate() {
                // All old places that reach this one: from six groups.
                let mut expected = Complex64::ZERO;
                for k in 0..count {
                    if let Some(tap) = place.checked_sub(k / by)
                        && tap < 6
                    {
                        let weight = f64::from(weights[k % by][tap]);
                        expected += wide(samples[k]) * turned(start + step * k as f64) * weight;
                    }
                }
                // Each of 6 q values turned (3e-7) and weighted (6e-8), and rounded into a sum that they bound.
                let terms = 6.0 * by as f64;
                let allowed = terms * (3.6e-7 + 8.5e-8 * terms / 2.0);
                let error = (wide(*got) - expected).norm();
                assert!(error < allowed, "{count} {by} {place}: {error} {allowed}");
            }
        }
    }

    #[test]
    fn pulses_go_where_the_sum_says() {
        let mut numbers = Numbers::new(2);
        let before = numbers.samples(4 * 33);
        let pulse = numbers.samples(33);
        let weights = [0.1, -0.7, 0.9, 0.3];
        let mut new = before.clone();
        add_pulse(&pulse, &weights, &mut new);
        for (i, (got, old)) in new.iter().zip(before).enumerate() {
            let expected = wide(old) + wide(pulse[i % 33]) * f64::from(weights[i / 33]);
            // A product and a sum of numbers up to 2.
            assert!((wide(*got) - expected).norm() < 3e-7, "{i}");
        }
    }
}
