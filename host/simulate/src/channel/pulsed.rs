//! Echoes of a pulse: from sums over the scene to samples of a window that all of them lie within.

use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;
use subaperture_fft::{Fft, Transforms};

use super::Experiment;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::radar::Waveform;
use subaperture_signal::phase::phasor;

/// What a pulse's echo takes.
pub(super) struct Pulsed {
    /// Its spectrum, frequencies rising from `-floor(N / 2)` steps, over `N`.
    spectrum: Vec<Complex64>,
    inverse: Arc<dyn Fft<f64>>,
}

impl Pulsed {
    /// `None` for waveforms without a pulse. The text of an error says what does not fit.
    pub(super) fn new(
        experiment: &Experiment,
        antennas: &[[DVec3; 2]],
    ) -> Result<Option<Self>, String> {
        let Waveform::Pulsed {
            sample_rate_hz,
            num_samples,
            window_start_s,
            ref shape,
            ..
        } = experiment.radar.waveform
        else {
            return Ok(None);
        };
        if let Some((least_s, most_s)) = delays(experiment, antennas) {
            let end_s = window_start_s + num_samples as f64 / sample_rate_hz;
            if least_s < window_start_s || most_s + shape.duration_s() > end_s {
                return Err(format!(
                    "echoes of the scene come from {least_s:.9} to {:.9} s after a pulse begins, the \
                     last of it included, and the window is open from {window_start_s:.9} to \
                     {end_s:.9} s: set [radar] window_start to {:.9} s or less, and samples to {} or more",
                    most_s + shape.duration_s(),
                    least_s.min(window_start_s),
                    ((most_s + shape.duration_s() - least_s.min(window_start_s)) * sample_rate_hz)
                        .ceil()
                ));
            }
        }
        let mut spectrum = shape.spectrum(sample_rate_hz, num_samples);
        spectrum.rotate_right(num_samples / 2);
        for p in &mut spectrum {
            *p /= num_samples as f64;
        }
        Ok(Some(Self {
            spectrum,
            inverse: Transforms::Portable.inverse(num_samples),
        }))
    }

    /// From sums over the scene to an echo, the oscillator's phase at the window's start being
    /// `turns`.
    pub(super) fn transmit(
        &self,
        turns: f64,
        work: &mut Vec<Complex64>,
        samples: &mut [Complex64],
    ) {
        let start = phasor(-turns);
        for (z, p) in samples.iter_mut().zip(&self.spectrum) {
            *z *= p * start;
        }
        samples.rotate_left(samples.len() / 2);
        work.resize(self.inverse.get_inplace_scratch_len(), Complex64::ZERO);
        self.inverse.process_with_scratch(samples, work);
    }
}

/// Smallest and largest delay of the scene's still parts and its reference point, seconds.
fn delays(experiment: &Experiment, antennas: &[[DVec3; 2]]) -> Option<(f64, f64)> {
    let scene = &experiment.scene;
    let points = scene.points.iter().map(|p| p.position_m);
    let corners = scene.corners.iter().map(|c| c.position_m);
    let all = points.chain(corners).map(|p| (p, p));
    let (low, high) = all.reduce(|(low, high), (p, q)| (low.min(p), high.max(q)))?;
    let of_pulse = |&[transmitter_m, receiver_m]: &[DVec3; 2]| {
        let delay_s =
            |p: DVec3| (p.distance(transmitter_m) + p.distance(receiver_m)) / SPEED_OF_LIGHT_M_S;
        // Delays are convex: largest at a corner of the box. Least near the box's point nearest to the
        // antennas, less than what these are apart.
        let corner = |i: usize| {
            let pick = |bit: usize, a: f64, b: f64| if i >> bit & 1 == 0 { a } else { b };
            DVec3::new(
                pick(0, low.x, high.x),
                pick(1, low.y, high.y),
                pick(2, low.z, high.z),
            )
        };
        let most_s = (0..8).map(|i| delay_s(corner(i))).fold(0.0, f64::max);
        let nearest = |antenna_m: DVec3| antenna_m.clamp(low, high).distance(antenna_m);
        let least_s = (nearest(transmitter_m) + nearest(receiver_m)) / SPEED_OF_LIGHT_M_S;
        (least_s, most_s)
    };
    let ranges = antennas.iter().map(of_pulse);
    ranges.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}
