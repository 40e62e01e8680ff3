//! Sum over scatterers as defined, in float64, scatterer by scatterer and sample by sample.
//!
//! With stop-and-go, a phasor recurrence over frequency is used, accurate to 1e-13. With intra-pulse motion the delay
//! is solved for every sample. Cost: 8 operations per scatterer and sample, or about five poses of the body.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex64;

use super::View;
use super::illumination::Illumination;
use crate::scene::Scene;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::radar::Motion;
use subaperture_signal::phase::phasor;

/// Set `out` to the sum over `scene`.
pub(super) fn pulse(scene: &Scene, view: &View, out: &mut [Complex64]) {
    out.fill(Complex64::ZERO);
    let illumination = Illumination::new(view, scene);
    let adder = Adder::of_samples(view, 0..out.len());
    for point in &scene.points {
        let gain = illumination.of(point.position_m);
        adder.add(point.amplitude * gain, |_| point.position_m, out);
    }
    for point in &scene.moving_points {
        let gain = illumination.of(point.position_m(view.middle_s()));
        adder.add(point.start.amplitude * gain, |t| point.position_m(t), out);
    }
    for facet in &scene.facets {
        let gain = illumination.of(facet.position_m(view.middle_s()));
        let amplitude = illumination.facet(facet).start.amplitude * gain;
        adder.add(amplitude, |t| facet.position_m(t), out);
    }
    for corner in &scene.corners {
        let gain = illumination.of(corner.position_m);
        let amplitude = Complex64::from(illumination.corner(corner) * gain);
        adder.add(amplitude, |_| corner.position_m, out);
    }
    for mover in &scene.movers {
        let place = |t| mover.motion.pose(t).position_m;
        let gain = illumination.of(place(view.middle_s()));
        adder.add(mover.amplitude * gain, place, out);
    }
}

/// Accumulator of single scatterers into the samples of a pulse.
pub(super) struct Adder<'a> {
    view: &'a View<'a>,
    /// Index of the first sample.
    first: usize,
    /// Receiver position at each sample; a single one with stop-and-go.
    receivers_m: Vec<DVec3>,
}

impl<'a> Adder<'a> {
    /// Make an accumulator for a block of the pulse's samples.
    pub(super) fn of_samples(view: &'a View<'a>, samples: Range<usize>) -> Self {
        let first = samples.start;
        let receivers_m = match view.motion {
            Motion::StopAndGo => vec![view.receiver_m(view.time_s)],
            Motion::True => samples
                .map(|k| view.receiver_m(view.sample_s(k as f64)))
                .collect(),
        };
        Self {
            view,
            first,
            receivers_m,
        }
    }

    /// Add a scatterer at `place(t)`.
    pub(super) fn add(
        &self,
        amplitude: Complex64,
        place: impl Fn(f64) -> DVec3,
        out: &mut [Complex64],
    ) {
        let view = self.view;
        let sweep = &view.sweep;
        let residual = |d: f64| 0.5 * sweep.residual_hz_s * d * d;
        match view.motion {
            Motion::StopAndGo => {
                let point_m = place(view.time_s);
                let path_m = view.transmitter_m(view.time_s).distance(point_m)
                    + self.receivers_m[0].distance(point_m);
                let d = path_m / SPEED_OF_LIGHT_M_S - view.reference_s;
                let start_hz = sweep.start_hz + self.first as f64 * sweep.step_hz;
                let mut value = amplitude * phasor(residual(d) - start_hz * d);
                let step = phasor(-sweep.step_hz * d);
                for z in out.iter_mut() {
                    *z += value;
                    value *= step;
                }
            }
            Motion::True => {
                let mut delay_s = 0.0;
                for (i, (z, &receiver_m)) in out.iter_mut().zip(&self.receivers_m).enumerate() {
                    let k = self.first + i;
                    delay_s = view.delay_s(&place, view.sample_s(k as f64), receiver_m, delay_s);
                    let d = delay_s - view.reference_s;
                    let frequency_hz = sweep.start_hz + k as f64 * sweep.step_hz;
                    *z += amplitude * phasor(residual(d) - frequency_hz * d);
                }
            }
        }
    }
}
