//! A radio whose every burst is recorded, around any radio: also those that a capture throws away while it settles.
//!
//! Steps of the recording are bursts; a sweep ends where a carrier is tuned to that it has had; carriers are those that the receivers were tuned to. The recording is closed by
//! [`Recorder::finish`]; of one that is dropped, its journal tells the steps ([`crate::sigmf`]). All bursts have as many samples.

use crate::error::RadioError;
use crate::sigmf::{Setup, SigmfError, Step, Writer};
use crate::transceiver::{
    About, Burst, Configuration, Event, Received, Sample, Sensors, Side, Transceiver,
};

/// A radio that is recorded.
#[derive(Debug)]
pub struct Recorder<T> {
    radio: T,
    writer: Writer,
    setup: Setup,
    gain_db: [f64; 2],
    carrier_hz: f64,
    sweep: u64,
    /// Carriers that it has had.
    had: Vec<bool>,
}

impl<T: Transceiver> Recorder<T> {
    /// Around `radio`, into a recording that was begun with this set-up, whose carriers are those that will be tuned to.
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

    /// Of the carrier that the receivers are tuned to, among those of the plan.
    fn place(&self) -> usize {
        let place = ((self.carrier_hz - self.setup.start_hz) / self.setup.step_hz).round();
        (place.max(0.0) as usize).min(self.setup.steps.saturating_sub(1))
    }

    /// Closes the recording; the radio goes on.
    ///
    /// # Errors
    /// If the disk refuses; the journal then keeps the steps.
    pub fn finish(self) -> Result<T, SigmfError> {
        self.writer.finish()?;
        Ok(self.radio)
    }
}

impl<T: Transceiver> Transceiver for Recorder<T> {
    fn about(&self) -> &About {
        self.radio.about()
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
