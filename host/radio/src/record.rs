//! Recording wrapper around any radio. It records every burst, including those that a capture discards while the
//! reference settles.
//!
//! Each burst is a step of the recording. A new sweep begins when the receivers tune to a carrier that the sweep
//! already has. Step carriers are those reported by the receivers. [`Recorder::finish`] closes the recording; if the
//! recorder is dropped instead, the journal keeps the steps ([`crate::sigmf`]). All bursts must have the same number of
//! samples.

use crate::error::RadioError;
use crate::sigmf::{Setup, SigmfError, Step, Writer};
use crate::transceiver::{
    About, Burst, Configuration, Event, Received, Sample, Sensors, Side, Transceiver,
};

/// Radio whose bursts are recorded.
#[derive(Debug)]
pub struct Recorder<T> {
    radio: T,
    writer: Writer,
    setup: Setup,
    gain_db: [f64; 2],
    carrier_hz: f64,
    sweep: u64,
    /// Carriers already visited in the current sweep.
    had: Vec<bool>,
}

impl<T: Transceiver> Recorder<T> {
    /// Wrap `radio`, and record into `writer`, which was created with the same `setup`. The plan of `setup` must
    /// contain the carriers that will be tuned.
    pub fn new(radio: T, writer: Writer, setup: Setup) -> Self {
        Self {
            gain_db: setup.receive_gain_db,
            carrier_hz: setup.start_hz,
            radio,
            writer,
            sweep: 0,
            had: vec![false; setup.steps],
            setup,
        }
    }

    /// Index of the receivers' current carrier in the plan.
    fn place(&self) -> usize {
        let place = ((self.carrier_hz - self.setup.start_hz) / self.setup.step_hz).round();
        (place.max(0.0) as usize).min(self.setup.steps.saturating_sub(1))
    }

    /// Close the recording and return the radio.
    ///
    /// # Errors
    /// If writing fails; the journal then keeps the steps.
    pub fn finish(self) -> Result<T, SigmfError> {
        self.writer.finish()?;
        Ok(self.radio)
    }
}

impl<T: Transceiver> Transceiver for Recorder<T> {
    fn about(&self) -> &About {
        self.radio.about()
    }

    fn waits(&self) -> bool {
        self.radio.waits()
    }

    fn configure(&mut self, asked: &Configuration) -> Result<Configuration, RadioError> {
        let set = self.radio.configure(asked)?;
        self.gain_db = set.receive_gain_db;
        Ok(set)
    }

    fn now_s(&mut self) -> Result<f64, RadioError> {
        self.radio.now_s()
    }

    fn tune(&mut self, side: Side, carrier_hz: f64, at_s: Option<f64>) -> Result<f64, RadioError> {
        let tuned_hz = self.radio.tune(side, carrier_hz, at_s)?;
        if side == Side::Receive {
            self.carrier_hz = tuned_hz;
            let place = self.place();
            if self.had[place] {
                self.sweep += 1;
                self.had.fill(false);
            }
            self.had[place] = true;
        }
        Ok(tuned_hz)
    }

    fn burst(
        &mut self,
        burst: &Burst,
        receive: [&mut [Sample]; 2],
    ) -> Result<Received, RadioError> {
        let [reference, echo] = receive;
        let received = self.radio.burst(burst, [&mut *reference, &mut *echo])?;
        let samples = reference.len();
        let step = Step {
            sweep: self.sweep,
            step: self.place(),
            gain_db: self.gain_db,
            ..Step::received(&self.setup, &received, samples, self.carrier_hz)
        };
        let written = self.writer.append(step, [reference, echo]);
        written.map_err(|error| RadioError::File(error.to_string()))?;
        Ok(received)
    }

    fn sensors(&mut self) -> Result<Sensors, RadioError> {
        self.radio.sensors()
    }

    fn gps_locked(&mut self) -> Result<Option<bool>, RadioError> {
        self.radio.gps_locked()
    }

    fn events(&mut self, events: &mut Vec<Event>) {
        self.radio.events(events);
    }
}
