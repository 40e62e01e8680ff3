//! Faults of the way between a radio and its host, around any radio: each by its own chance a burst and one seed; unplugging at a burst
//! named.
//!
//! What is lost becomes zeros and is told, as a radio does that knows its samples' times. The same seed gives the same faults.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use subaperture_simulate::random::unit;

use crate::error::RadioError;
use crate::transceiver::{
    About, Burst, Configuration, Event, EventKind, Received, Sample, Sensors, Side, Transceiver,
};

/// Which faults, how often: chances from 0 to 1 a burst.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults {
    /// Of an overflow: the end of a burst is lost.
    pub overflow: f64,
    /// Of a lost packet within a burst.
    pub lost_packet: f64,
    /// Of a command that comes too late.
    pub late: f64,
    /// Of an underflow: the transmitter pauses, and the receivers hear nothing meanwhile.
    pub underflow: f64,
    /// Samples of a packet.
    pub packet: usize,
    /// The burst at which the device is unplugged.
    pub unplug_at: Option<u64>,
    /// Seed of all chances.
    pub seed: u64,
}

/// A radio with faults.
#[derive(Debug)]
pub struct Faulty<T> {
    radio: T,
    faults: Faults,
    burst: u64,
    gone: bool,
    events: Vec<Event>,
}

impl<T: Transceiver> Faulty<T> {
    /// Around `radio`.
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

    fn tell(&mut self, kind: EventKind, time_s: f64) {
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
        // Always as many numbers, so that one fault's chance does not move another's.
        let drawn: [f64; 6] = std::array::from_fn(|_| unit(&mut random));
        if self.faults.unplug_at.is_some_and(|at| self.burst >= at) {
            self.gone = true;
            self.tell(EventKind::Gone, burst.at_s);
            return self.here().map(|()| Received::default());
        }
        self.burst += 1;
        let [reference, echo] = receive;
        let count = reference.len();
        if drawn[0] < self.faults.late {
            // A moment that has passed: the radio itself knows what is late.
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
            self.tell(EventKind::LostPacket, received.first_s);
        }
        if drawn[3] < self.faults.overflow {
            gaps.push(at(drawn[4])..count);
            self.tell(EventKind::Overflow, received.first_s);
        }
        if drawn[5] < self.faults.underflow {
            // Nothing was sent for a packet from the start; what came is no echo.
            gaps.push(0..packet);
            self.tell(EventKind::Underflow, received.first_s);
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

/// The same samples as ascending ranges that do not touch.
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
    fn gaps_are_merged_where_they_touch() {
        assert_eq!(merged(vec![5..9, 0..2, 2..4, 7..12, 3..3]), [0..4, 5..12]);
    }
}
