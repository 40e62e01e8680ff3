//! Received signal of a periodic waveform: one period.

use std::sync::Arc;

use num_complex::{Complex32, Complex64};
use subaperture_fft::{Fft, Transforms};
use subaperture_model::radar::{Antenna, Motion, Reference};
use subaperture_signal::phase::phasor;
use subaperture_simulate::Experiment;
use subaperture_simulate::engine::{Engine, Scratch, Sweep, View};

use super::wiring::Wiring;

/// Relative amplitude below which spectral lines are rounding errors of float32.
const NEGLIGIBLE: f64 = 1e-6;

/// Scene with the wiring in front of it.
pub(super) struct Echo<'a> {
    experiment: &'a Experiment,
    engine: Engine<'a>,
    scratch: Scratch,
    wiring: Wiring,
    reference_range_m: f64,
    spectrum: Vec<Complex64>,
    response: Vec<Complex64>,
    transforms: Option<[Arc<dyn Fft<f64>>; 2]>,
}

impl<'a> Echo<'a> {
    /// Make the echo simulation; the error is a message.
    pub(super) fn new(experiment: &'a Experiment, wiring: &Wiring) -> Result<Self, String> {
        let radar = &experiment.radar;
        let Some(transmitter) = radar.transmitters.first() else {
            return Err("the experiment has no transmitter: add one to its radar".to_owned());
        };
        for antenna in wiring.receive.iter().filter_map(|path| path.antenna) {
            if antenna >= radar.receivers.len() {
                return Err(format!(
                    "receive antenna {antenna} requested, but the experiment has {}: add receivers to its radar",
                    radar.receivers.len()
                ));
            }
        }
        // Range at which amplitudes are 1, as in the simulator's own channels.
        let pose = experiment.track.pose(radar.start_s);
        let origin_m = match experiment.reference {
            Reference::Point(point_m) => point_m,
            Reference::Range(_) => Default::default(),
        };
        let reference_range_m = pose.point_m(transmitter.offset_m).distance(origin_m);
        if reference_range_m < 1e-3 {
            return Err(
                "the radio is at the scene's reference point: move scene.reference".to_owned(),
            );
        }
        Ok(Self {
            engine: Engine::new(&experiment.scene, experiment.method),
            experiment,
            scratch: Scratch::default(),
            wiring: wiring.clone(),
            reference_range_m,
            spectrum: Vec::new(),
            response: Vec::new(),
            transforms: None,
        })
    }

    /// Forward and inverse FFTs, planned again when the waveform's length changes.
    fn transforms(&mut self, count: usize) -> [Arc<dyn Fft<f64>>; 2] {
        let planned = self.transforms.take().filter(|both| both[0].len() == count);
        let plan = || {
            [
                Transforms::Portable.forward(count),
                Transforms::Portable.inverse(count),
            ]
        };
        self.transforms.insert(planned.unwrap_or_else(plan)).clone()
    }

    /// Range at which amplitudes are 1, metres.
    pub(super) fn reference_range_m(&self) -> f64 {
        self.reference_range_m
    }

    /// One period of the signal received by `channel` at the true time `true_s`. Frequencies are true ones, not those
    /// of the device clock.
    pub(super) fn period(
        &mut self,
        channel: usize,
        waveform: &[Complex32],
        carrier_hz: f64,
        rate_hz: f64,
        true_s: f64,
    ) -> &[Complex64] {
        let count = waveform.len();
        let half = count / 2;
        self.spectrum.clear();
        self.spectrum.extend(
            waveform
                .iter()
                .map(|z| Complex64::new(f64::from(z.re), f64::from(z.im))),
        );
        let [forward, inverse] = self.transforms(count);
        forward.process(&mut self.spectrum);
        // Bin of line `i`, counted from the lowest frequency.
        let bin = |i: usize| (i + count - half) % count;
        let strongest = self
            .spectrum
            .iter()
            .map(|z| z.norm_sqr())
            .fold(0.0, f64::max);
        let strong =
            |i: &usize| self.spectrum[bin(*i)].norm_sqr() > NEGLIGIBLE * NEGLIGIBLE * strongest;
        let first = (0..count).find(strong).unwrap_or(0);
        let last = (0..count).rfind(strong).unwrap_or(0);
        let line_hz = rate_hz / count as f64;
        let sweep = Sweep {
            start_hz: carrier_hz + (first as f64 - half as f64) * line_hz,
            step_hz: line_hz,
            count: last - first + 1,
            start_s: 0.0,
            step_s: 0.0,
            residual_hz_s: 0.0,
        };
        self.response.clear();
        self.response.resize(sweep.count, Complex64::ZERO);
        let path = &self.wiring.receive[channel];
        if let Some(antenna) = path.antenna {
            let radar = &self.experiment.radar;
            let receiver: &Antenna = &radar.receivers[antenna];
            let view = View {
                body: self.experiment.track.as_ref(),
                transmitter: &radar.transmitters[0],
                receiver,
                time_s: true_s,
                sweep,
                reference_s: 0.0,
                motion: Motion::StopAndGo,
                spreading_from_m: radar.spreading.then_some(self.reference_range_m),
            };
            self.engine
                .pulse(&view, &mut self.scratch, &mut self.response);
        }
        let scale = path.response / count as f64;
        for (i, z) in self.response.iter_mut().enumerate() {
            let frequency_hz = sweep.start_hz + i as f64 * line_hz;
            let direct = path.coupled.map_or(Complex64::ZERO, |coupled| {
                phasor(-frequency_hz * coupled.delay_s) * coupled.amplitude
            });
            *z = (*z * phasor(-frequency_hz * path.cable_s) + direct) * scale;
        }
        for i in 0..count {
            let response = match (first..=last).contains(&i) {
                true => self.response[i - first],
                false => Complex64::ZERO,
            };
            self.spectrum[bin(i)] *= response;
        }
        inverse.process(&mut self.spectrum);
        &self.spectrum
    }
}
