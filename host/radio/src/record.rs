//! A radio whose every burst is recorded, around any radio: also those that a capture throws away while it settles.
//!
//! Steps of the recording are bursts, sweeps as many retunes as there are carriers; carriers are those that the receivers were tuned to. The recording is closed by
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
    /// Retunes of the receivers.
    tunes: u64,
}

impl<T: Transceiver> Recorder<T> {
    /// Around `radio`, into a recording that was begun with this set-up, whose carriers are those that will be tuned to.
    pub fn new(radio: T, writer: Writer, setup: Setup) -> Self {
        Self {
            gain_db: setup.receive_gain_db,
            carrier_hz: setup.start_hz,
            radio,
            writer,
            setup,
            tunes: 0,
        }
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
            self.tunes += 1;
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
        let place = ((self.carrier_hz - self.setup.start_hz) / self.setup.step_hz).round();
        let samples = reference.len();
        let step = Step {
            sweep: self.tunes.saturating_sub(1) / self.setup.steps as u64,
            step: (place.max(0.0) as usize).min(self.setup.steps - 1),
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

    fn events(&mut self, events: &mut Vec<Event>) {
        self.radio.events(events);
    }
}
