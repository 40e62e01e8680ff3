//! Echoes of pulsed waveforms: from sums over the scene to samples of a receive window that contains all echoes.

use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;
use subaperture_fft::{Fft, Transforms};

use super::Experiment;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::radar::Waveform;
use subaperture_signal::phase::phasor;

/// Spectrum and FFT of a pulsed waveform.
pub(super) struct Pulsed {
    /// Spectrum by ascending frequency from `-floor(N / 2)` steps, divided by `N`.
    spectrum: Vec<Complex64>,
    inverse: Arc<dyn Fft<f64>>,
}

impl Pulsed {
    /// Make the spectrum; `None` for waveforms that are not pulsed. The error is a message.
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
                    "echoes of the scene arrive from {least_s:.9} to {:.9} s after the start of a pulse, the \
                                        end of the pulse included, but the receive window extends from {window_start_s:.9} to \
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

    /// Convert sums over the scene into an echo. `turns` is the oscillator's phase at the start of the window, in
    /// turns.
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

/// Smallest and largest delay of points and corners, seconds; `None` for a scene without them. Points of constant
/// velocity are between their places at the first and at the last pulse.
fn delays(experiment: &Experiment, antennas: &[[DVec3; 2]]) -> Option<(f64, f64)> {
    let scene = &experiment.scene;
    let points = scene.points.iter().map(|p| p.position_m);
    let corners = scene.corners.iter().map(|c| c.position_m);
    let radar = &experiment.radar;
    let last_s = radar.start_s + radar.num_pulses as f64 * radar.pri_s;
    let moving = [radar.start_s, last_s]
        .into_iter()
        .flat_map(|t| scene.moving_points.iter().map(move |p| p.position_m(t)));
    let all = points.chain(corners).chain(moving).map(|p| (p, p));
    let (low, high) = all.reduce(|(low, high), (p, q)| (low.min(p), high.max(q)))?;
    let of_pulse = |&[transmitter_m, receiver_m]: &[DVec3; 2]| {
        let delay_s =
            |p: DVec3| (p.distance(transmitter_m) + p.distance(receiver_m)) / SPEED_OF_LIGHT_M_S;
        // Delays are convex: the largest is at a corner of the bounding box. The smallest is bounded below by the
        // distances from both antennas to their nearest points of the box.
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
