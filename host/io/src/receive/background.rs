//! Background subtraction: removal of static clutter that is constant from pulse to pulse, such as leakage from
//! transmitter to receiver, antenna ringing, and the radar's own mount.
//!
//! ```text
//! s'[n][k] = s[n][k] - mean over the chosen pulses of s[.][k]
//! ```
//!
//! The mean is taken over pulses during which the scene's echoes rotate by many turns, as they do while the radar
//! moves. If the radar stands still for part of the recording, the mean of all pulses would contain the scene as seen
//! from there. An echo that rotates by `T` turns over the chosen pulses loses about `1 / (pi T)` of its amplitude. Sums
//! are float64.

use num_complex::{Complex32, Complex64};

use subaperture_signal::phase::{narrow, widen};

/// Subtract the mean of the pulses chosen by `over` from every pulse of `samples`, with `width` values per pulse. Does
/// nothing if no pulse is chosen.
///
/// # Panics
/// Panics if `samples.len()` is not `width * over.len()`.
pub fn remove_background(samples: &mut [Complex32], width: usize, over: &[bool]) {
    assert_eq!(samples.len(), width * over.len(), "one choice per pulse");
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
    fn background_subtraction_removes_static_clutter_and_keeps_rotating_target() {
        // Sample 0 is constant. Sample 1 rotates by one turn over the first four pulses, and then stands still.
        let turns = [0.0, 0.25, 0.5, 0.75, 0.0];
        let moving = |t: f64| Complex32::from_polar(1.0, std::f32::consts::TAU * t as f32);
        let mut samples: Vec<Complex32> = turns
            .iter()
            .flat_map(|&t| [Complex32::new(7.0, -3.0), moving(t)])
            .collect();
        remove_background(&mut samples, 2, &[true, true, true, true, false]);
        for (pulse, &t) in samples.chunks_exact(2).zip(&turns) {
            assert_eq!(pulse[0], Complex32::ZERO);
            // A whole turn sums to zero, except for float32 rounding of four values of magnitude 1.
            assert!((pulse[1] - moving(t)).norm() < 1e-6);
        }
    }
}
