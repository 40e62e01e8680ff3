//! The sum as defined, in float64, scatterer by scatterer and sample by sample.
//!
//! With the radar standing still a phasor recurrence over frequency is used, exact to 1e-13; with
//! true motion the delay is solved for every sample. Cost: 8 operations a scatterer and sample, or
//! some five poses of the body.

use glam::DVec3;
use num_complex::Complex64;

use super::View;
use crate::SPEED_OF_LIGHT_M_S;
use crate::signal::phase::phasor;
use crate::simulate::radar::Motion;
use crate::simulate::scene::Scene;

/// Sets `out` to the sum over `scene`.
pub(super) fn pulse(scene: &Scene, view: &View, out: &mut [Complex64]) {
    out.fill(Complex64::ZERO);
    let mut adder = Adder::new(view);
    for point in &scene.points {
        adder.add(point.amplitude, |_| point.position_m, out);
    }
    for mover in &scene.movers {
        adder.add(mover.amplitude, |t| mover.motion.pose(t).position_m, out);
    }
}

/// Adds single scatterers to the samples of a pulse.
pub(super) struct Adder<'a> {
    view: &'a View<'a>,
    /// Where the receiver is at each sample; once, if it stands still.
    receivers_m: Vec<DVec3>,
}

impl<'a> Adder<'a> {
    pub(super) fn new(view: &'a View<'a>) -> Self {
        let receivers_m = match view.motion {
            Motion::StopAndGo => vec![view.receiver_m(view.time_s)],
            Motion::True => (0..view.sweep.count)
                .map(|k| view.receiver_m(view.sample_s(k as f64)))
                .collect(),
        };
        Self { view, receivers_m }
    }

    /// Adds a scatterer at `place(t)`.
    pub(super) fn add(
        &mut self,
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
                let mut value = amplitude * phasor(residual(d) - sweep.start_hz * d);
                let step = phasor(-sweep.step_hz * d);
                for z in out.iter_mut() {
                    *z += value;
                    value *= step;
                }
            }
            Motion::True => {
                let mut delay_s = 0.0;
                for (k, (z, &receiver_m)) in out.iter_mut().zip(&self.receivers_m).enumerate() {
                    delay_s = view.delay_s(&place, view.sample_s(k as f64), receiver_m, delay_s);
                    let d = delay_s - view.reference_s;
                    let frequency_hz = sweep.start_hz + k as f64 * sweep.step_hz;
                    *z += amplitude * phasor(residual(d) - frequency_hz * d);
                }
            }
        }
    }
}
