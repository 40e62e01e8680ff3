//! Range-dependent motion compensation of pulses to a radar on the line.
//!
//! ```text
//! c[m] = 1 / M sum_i g(rho_i + d(rho_i)) W_i exp(-j kappa'_m rho_i),   rho_i = middle + (i - M / 2) period / M
//! ```
//!
//! for the profile `g` of one pulse, the window `W` and the wavenumbers of [`super::profiles`]. The profile is transformed at twice
//! its length and interpolated with a Kaiser-Bessel kernel of 6 taps, whose roll-off is divided out in advance (-107 dB). Energy outside the
//! wavenumbers is below -90 dB (the test below). Cost per pulse: transforms of `2 K` and `M`, 6 taps and a
//! phasor for each of `M` positions, a phasor for each of `K` samples and `M` wavenumbers.

use std::f64::consts::TAU;
use std::sync::Arc;

use num_complex::Complex32;
use subaperture_fft::{Fft, Transforms};

use super::profiles::Profiles;
use crate::frequency_domain::taps::TAPS;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::Pulse;
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::phase::{narrow, phasor, phasor32};

/// Relative RMS error: the kernel (-107 dB), its table (-114 dB) and truncation by the guard.
pub(super) const ERROR: f64 = 3e-5;

/// Length of the transform of `samples` to a profile.
pub(in crate::frequency_domain) fn profile_length(samples: usize) -> usize {
    fast_length((2 * samples).max(TAPS))
}

/// Complex values of the [`Room`] for pulses with the given number of samples.
pub(super) fn room_length(samples: usize) -> usize {
    3 * profile_length(samples) + TAPS
}

/// Interpolator of range profiles.
pub(in crate::frequency_domain) struct Warp<'a> {
    profiles: &'a Profiles,
    kernel: KaiserBessel,
    /// Inverse roll-off `1 / Phi` of each frequency.
    roll_off: Vec<f32>,
    /// Cells of a profile's transform per metre.
    cells: f64,
    profile: Arc<dyn Fft<f32>>,
    spectrum: Arc<dyn Fft<f32>>,
}

/// Scratch buffers for one pulse.
pub(in crate::frequency_domain) struct Room {
    /// One period and a repetition of its first values, so that taps are contiguous.
    profile: Vec<Complex32>,
    scratch: Vec<Complex32>,
}

impl<'a> Warp<'a> {
    /// Prepare for pulses of the given wavenumbers, rad/m.
    pub(in crate::frequency_domain) fn new(
        profiles: &'a Profiles,
        wavenumbers: &[f64],
        transforms: Transforms,
    ) -> Self {
        let kernel = KaiserBessel::new(TAPS);
        let count = wavenumbers.len();
        let length = profile_length(count);
        let step = match wavenumbers {
            [first, .., last] => (last - first) / (count as f64 - 1.0),
            _ => 0.0,
        };
        Self {
            profiles,
            roll_off: kernel.emphasis(count, length),
            kernel,
            cells: step / TAU * length as f64,
            profile: transforms.inverse(length),
            spectrum: transforms.forward(profiles.window.len()),
        }
    }

    /// Allocate scratch buffers for one pulse.
    pub(in crate::frequency_domain) fn room(&self) -> Room {
        let lengths = [&self.profile, &self.spectrum].map(|fft| fft.get_inplace_scratch_len());
        Room {
            profile: vec![Complex32::ZERO; self.profile.len() + TAPS - 1],
            scratch: vec![Complex32::ZERO; lengths[0].max(lengths[1])],
        }
    }

    /// Compensate pulse `n` to the line, with its samples multiplied by `weights` and `weight` and phase-rotated by `turns`. The output has one value for
    /// each of the profiles' wavenumbers, referred to path zero.
    pub(in crate::frequency_domain) fn pulse(
        &self,
        (n, pulse): (usize, &Pulse),
        samples: &[Complex32],
        (weights, weight): (&[f64], f64),
        turns: f64,
        room: &mut Room,
        out: &mut [Complex32],
    ) {
        let profiles = self.profiles;
        let middle_m = profiles.middle_m(n);
        let middle_deviation_m = profiles.deviation_m(n, middle_m);
        let Room { profile, scratch } = room;
        let (length, half) = (self.profile.len(), samples.len() / 2);
        // Position 0 of the profile is the centre of the interval.
        let delay_s =
            (pulse.reference_path_m - 2.0 * (middle_m + middle_deviation_m)) / SPEED_OF_LIGHT_M_S;
        profile.fill(Complex32::ZERO);
        for (k, ((z, w), roll_off)) in samples.iter().zip(weights).zip(&self.roll_off).enumerate() {
            let turn = phasor(-pulse.frequency_hz(k) * delay_s) * (w * weight);
            let place = if k < half { k + length } else { k } - half;
            profile[place] = *z * narrow(turn) * *roll_off;
        }
        self.profile.process_with_scratch(
            &mut profile[..length],
            &mut scratch[..self.profile.get_inplace_scratch_len()],
        );
        profile.copy_within(..TAPS - 1, length);

        let period = Period::new(length);
        let size = out.len();
        for (i, (value, window)) in out.iter_mut().zip(&profiles.window).enumerate() {
            let from_middle_m = (i as f64 - (size / 2) as f64) * profiles.step_m;
            let deviation_m =
                profiles.deviation_m(n, middle_m + from_middle_m) - middle_deviation_m;
            let place = (from_middle_m + deviation_m) * self.cells;
            let whole = place.floor();
            let taps = self.kernel.weights::<TAPS>((place - whole) as f32);
            let first = period.within(whole - (TAPS / 2 - 1) as f64);
            let read = profile[first..first + TAPS].iter().zip(taps);
            let sum: Complex32 = read.map(|(z, w)| z * w).sum();
            // The carrier at the position is contained in the wavenumbers except for the deviation.
            *value = sum * phasor32(profiles.centre / TAU * deviation_m) * *window;
        }
        self.spectrum
            .process_with_scratch(out, &mut scratch[..self.spectrum.get_inplace_scratch_len()]);
        // Bin 0 is the centre wavenumber: move it to its place, and refer from the first position to path zero.
        out.rotate_right(size / 2);
        let start_m = middle_m - (size / 2) as f64 * profiles.step_m;
        let carrier = turns - profiles.centre / TAU * middle_m;
        let a_bin = -profiles.wavenumber_step / TAU * start_m;
        for (m, value) in out.iter_mut().enumerate() {
            let bin = m as f64 - (size / 2) as f64;
            *value *= narrow(phasor(carrier + bin * a_bin) / size as f64);
        }
    }
}

/// Integer positions on a periodic axis.
#[derive(Clone, Copy)]
struct Period {
    length: f64,
    inverse: f64,
}

impl Period {
    fn new(length: usize) -> Self {
        let length = length as f64;
        Self {
            length,
            inverse: 1.0 / length,
        }
    }

    /// Position of an integer within the period, without division.
    #[inline]
    fn within(&self, whole: f64) -> usize {
        let left = whole - (whole * self.inverse).floor() * self.length;
        // The quotient of a whole number of periods may round down.
        let left = if left < self.length {
            left
        } else {
            left - self.length
        };
        left as usize
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;
    use subaperture_signal::phase::{cis, widen};

    use super::super::tests::{grid, swaying, wavenumbers};
    use super::super::{Bounds, Compensation, Motion};
    use super::*;
    use crate::straight_track::StraightTrack;

    #[test]
    fn positions_are_periodic() {
        for length in [6, 7, 48, 49, 1000, 15_625] {
            let period = Period::new(length);
            for whole in (-40_000i64..40_000).chain([-123_456_789_012, 987_654_321_098]) {
                let expected = whole.rem_euclid(length as i64);
                assert_eq!(period.within(whole as f64), expected as usize);
            }
        }
    }

    #[test]
    fn warp_interpolates_profile_at_shifted_ranges() {
        // 2 m of sway at 60 to 120 m stretches profiles by up to 1 %; bands from near zero to a third of the carrier.
        let mut errors = Vec::new();
        for samples in [1, 2, 65, 200] {
            let collection = swaying(2.0, samples);
            let grid = grid("x=-12:12:1,y=-20:20:1");
            let wavenumbers = wavenumbers(&collection);
            let track = StraightTrack::fit(&collection).unwrap();
            let bounds = Bounds::of(&track, &grid);
            let compensation = Compensation::Ranges;
            let motion = Motion::new(
                &collection,
                &grid,
                track,
                &bounds,
                &wavenumbers,
                compensation,
            );
            let motion = motion.unwrap();
            let profiles = motion.profiles().unwrap();
            let warp = Warp::new(profiles, &wavenumbers, Transforms::Fastest);
            let mut room = warp.room();
            let weights: Vec<f64> = (0..samples).map(|k| 1.0 + 0.5 * (k as f64).sin()).collect();
            let values: Vec<Complex32> = (0..samples)
                .map(|k| narrow(cis((k * k) as f64 * 0.41)))
                .collect();
            let out_wavenumbers = profiles.wavenumbers();
            let mut out = vec![Complex32::ZERO; out_wavenumbers.len()];
            let (mut error, mut power) = (0.0, 0.0);
            for n in [0, 13, 40] {
                let pulse = &collection.pulses[n];
                warp.pulse(
                    (n, pulse),
                    &values,
                    (&weights, 2.0),
                    0.125,
                    &mut room,
                    &mut out,
                );
                // Pixels are seen at these ranges and in between.
                let at = |x: f64, y: f64| motion.positions.range_m(n, glam::DVec3::new(x, y, 0.0));
                let (near_m, far_m) = (at(0.0, -20.0), at(12.0, 20.0).max(at(-12.0, 20.0)));
                for i in 0..=400 {
                    let range_m = near_m + (far_m - near_m) * f64::from(i) / 400.0;
                    let read_m = range_m + profiles.deviation_m(n, range_m);
                    let terms = values.iter().zip(&weights).zip(&wavenumbers);
                    let sum: Complex64 = terms
                        .map(|((value, weight), kappa)| {
                            widen(*value)
                                * cis(kappa * (read_m - pulse.reference_path_m / 2.0))
                                * (2.0 * weight)
                        })
                        .sum();
                    let got: Complex64 = out
                        .iter()
                        .zip(&out_wavenumbers)
                        .map(|(value, kappa)| widen(*value) * cis(kappa * range_m))
                        .sum();
                    // One eighth of a turn.
                    error += (got - sum * cis(TAU / 8.0)).norm_sqr();
                    power += sum.norm_sqr();
                }
            }
            let relative = (error / power).sqrt();
            println!("{samples}: {relative:e} with {} wavenumbers", out.len());
            errors.push(relative);
        }
        assert!(errors.iter().all(|&error| error < ERROR), "{errors:?}");
    }
}
