//! Fault injection for the link between a radio and its host. Each fault has its own probability per burst;
//! disconnection happens at a given burst.
//!
//! Lost samples become zeros and are reported in [`Received::lost`], as by a radio with timestamps. The same seed gives
//! the same faults.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use subaperture_describe::declare::section;
use subaperture_simulate::random::unit;

use crate::error::RadioError;
use crate::transceiver::{
    About, Burst, Configuration, Event, EventKind, Received, Sample, Sensors, Side, Transceiver,
};

/// Injected faults of the link between the radio and this machine, as probabilities per burst.
#[section]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults {
    /// Probability of an overrun, which loses the end of a burst.
    #[key(default = 0, within(0.0, 1.0, "0 to 1"))]
    pub overflow: f64,
    /// Probability that a packet within a burst is lost.
    #[key(default = 0, within(0.0, 1.0, "0 to 1"))]
    pub lost_packet: f64,
    /// Probability of a late command.
    #[key(default = 0, within(0.0, 1.0, "0 to 1"))]
    pub late: f64,
    /// Probability of an underrun: the transmitter pauses for one packet.
    #[key(default = 0, within(0.0, 1.0, "0 to 1"))]
    pub underflow: f64,
    /// Samples per packet.
    #[key(default = 200, whole(1, 1 << 20))]
    pub packet: usize,
    /// Burst at which the radio is disconnected.
    #[key(example = 500)]
    pub unplug_at: Option<u64>,
    /// Seed of the random faults.
    #[key(default = 0, whole(0, i64::MAX as u64))]
    pub seed: u64,
}

/// Radio with injected faults.
#[derive(Debug)]
pub struct Faulty<T> {
    radio: T,
    faults: Faults,
    burst: u64,
    gone: bool,
    events: Vec<Event>,
}

impl<T: Transceiver> Faulty<T> {
    /// Wrap `radio` with fault injection.
    pub fn new(radio: T, faults: Faults) -> Self {
        Self {
            radio,
            faults,
            burst: 0,
            gone: false,
            events: Vec::new(),
        }
    }

    fn here(&self) -> Result<(), RadioError> {
        match self.gone {
            true => Err(RadioError::Gone("it was unplugged".to_owned())),
            false => Ok(()),
        }
    }

    fn report(&mut self, kind: EventKind, time_s: f64) {
        self.events.push(Event {
            kind,
            time_s: Some(time_s),
            count: 1,
        });
    }
}

impl<T: Transceiver> Transceiver for Faulty<T> {
    fn about(&self) -> &About {
        self.radio.about()
    }

    fn waits(&self) -> bool {
        self.radio.waits()
    }

    fn configure(&mut self, asked: &Configuration) -> Result<Configuration, RadioError> {
        self.here()?;
        self.radio.configure(asked)
    }

    fn now_s(&mut self) -> Result<f64, RadioError> {
        self.here()?;
        self.radio.now_s()
    }

    fn tune(&mut self, side: Side, carrier_hz: f64, at_s: Option<f64>) -> Result<f64, RadioError> {
        self.here()?;
        self.radio.tune(side, carrier_hz, at_s)
    }

    fn burst(
        &mut self,
        burst: &Burst,
        receive: [&mut [Sample]; 2],
    ) -> Result<Received, RadioError> {
        self.here()?;
        let mut random = ChaCha8Rng::seed_from_u64(self.faults.seed);
        random.set_stream(self.burst);
        // Always draws the same number of values, so that the probability of one fault does not shift the random
        // numbers of another.
        let drawn: [f64; 6] = std::array::from_fn(|_| unit(&mut random));
        if self.faults.unplug_at.is_some_and(|at| self.burst >= at) {
            self.gone = true;
            self.report(EventKind::Gone, burst.at_s);
            return self.here().map(|()| Received::default());
        }
        self.burst += 1;
        let [reference, echo] = receive;
        let count = reference.len();
        if drawn[0] < self.faults.late {
            // A start time in the past: the wrapped radio then reports the burst as late.
            let passed = Burst {
                at_s: self.radio.now_s()? - 1e-3,
                ..*burst
            };
            return self.radio.burst(&passed, [reference, echo]);
        }
        let mut received = self.radio.burst(burst, [&mut *reference, &mut *echo])?;
        if received.late {
            return Ok(received);
        }
        let at = |part: f64| (part * count as f64) as usize;
        let packet = self.faults.packet.clamp(1, count);
        let mut gaps = Vec::new();
        if drawn[1] < self.faults.lost_packet {
            let first = at(drawn[2]) / packet * packet;
            gaps.push(first..(first + packet).min(count));
            self.report(EventKind::LostPacket, received.first_s);
        }
        if drawn[3] < self.faults.overflow {
            gaps.push(at(drawn[4])..count);
            self.report(EventKind::Overflow, received.first_s);
        }
        if drawn[5] < self.faults.underflow {
            // Nothing was sent for the first packet, so the samples received there contain no echo.
            gaps.push(0..packet);
            self.report(EventKind::Underflow, received.first_s);
        }
        for gap in &gaps {
            reference[gap.clone()].fill(Sample::ZERO);
            echo[gap.clone()].fill(Sample::ZERO);
        }
        received.lost.extend(gaps);
        received.lost = merged(received.lost);
        Ok(received)
    }

    fn sensors(&mut self) -> Result<Sensors, RadioError> {
        self.here()?;
        self.radio.sensors()
    }

    fn gps_locked(&mut self) -> Result<Option<bool>, RadioError> {
        self.here()?;
        self.radio.gps_locked()
    }

    fn events(&mut self, events: &mut Vec<Event>) {
        self.radio.events(events);
        events.append(&mut self.events);
    }
}

/// Merge ranges into ascending ranges that do not touch.
fn merged(mut gaps: Vec<std::ops::Range<usize>>) -> Vec<std::ops::Range<usize>> {
    gaps.retain(|gap| !gap.is_empty());
    gaps.sort_by_key(|gap| gap.start);
    let mut merged: Vec<std::ops::Range<usize>> = Vec::with_capacity(gaps.len());
    for gap in gaps {
        match merged.last_mut() {
            Some(last) if gap.start <= last.end => last.end = last.end.max(gap.end),
            _ => merged.push(gap),
        }
    }
    merged
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touching_gaps_are_merged() {
        assert_eq!(merged(vec![5..9, 0..2, 2..4, 7..12, 3..3]), [0..4, 5..12]);
    }
}
