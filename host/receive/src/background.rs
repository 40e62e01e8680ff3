//! Removal of what does not change from pulse to pulse: leakage from transmitter to receiver, ringing of the
//! antennas, the radar's own mount.
//!
//! ```text
//! s'[n][k] = s[n][k] - mean over the chosen pulses of s[.][k]
//! ```
//!
//! The mean is taken over pulses in which the scene's echoes turn many times, as they do while the radar
//! moves; of a radar that stands for a part of the recording, the mean of all would hold the scene as seen from
//! there. An echo that turns by `T` turns over the chosen pulses loses about `1 / (pi T)` of its amplitude.
//! Sums in float64.

use num_complex::{Complex32, Complex64};

use subaperture_signal::phase::{narrow, widen};

/// Takes the mean of the pulses chosen by `over` from every pulse of `samples`, `width` values each. Does nothing
/// if none is chosen.
///
/// # Panics
/// If the lengths disagree.
pub fn remove_background(samples: &mut [Complex32], width: usize, over: &[bool]) {
    assert_eq!(samples.len(), width * over.len(), "one choice a pulse");
    let chosen = over.iter().filter(|&&chosen| chosen).count();
    if chosen == 0 {
        return;
    }
    let mut mean = vec![Complex64::ZERO; width];
    for (pulse, _) in samples.chunks_exact(width).zip(over).filter(|p| *p.1) {
        for (sum, &s) in mean.iter_mut().zip(pulse) {
            *sum += widen(s);
        }
    }
    for pulse in samples.chunks_exact_mut(width) {
        for (s, sum) in pulse.iter_mut().zip(&mean) {
            *s = narrow(widen(*s) - sum / chosen as f64);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stays_goes_and_what_turns_stays() {
        // Sample 0 holds a constant, sample 1 one turn over the first four pulses, then a rest.
        let turns = [0.0, 0.25, 0.5, 0.75, 0.0];
        let moving = |t: f64| Complex32::from_polar(1.0, std::f32::consts::TAU * t as f32);
        let mut samples: Vec<Complex32> = turns
            .iter()
            .flat_map(|&t| [Complex32::new(7.0, -3.0), moving(t)])
            .collect();
        remove_background(&mut samples, 2, &[true, true, true, true, false]);
        for (pulse, &t) in samples.chunks_exact(2).zip(&turns) {
            assert_eq!(pulse[0], Complex32::ZERO);
            // A whole turn sums to zero but for float32's rounding of four values of size 1.
            assert!((pulse[1] - moving(t)).norm() < 1e-6);
        }
    }
}
