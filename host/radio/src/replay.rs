//! A recording in place of a radio: what was received is received again.
//!
//! A retune of the receivers goes on to the next step of that carrier; bursts then give its samples, steps of the same carrier that
//! follow at once in the same sweep (a recording of every burst), the last of them again and again. What is asked beyond a step's
//! length is lost, and told so. Times are the recording's: bursts come at once, at any time asked for.
//!
//! The plan that made a recording replays it, whatever the device rounded: gains may be a decibel off, the largest step that a receiver's gain
//! has, and rates half as much again, which is as far as a rate can be from the nearest whole part of a master clock. What
//! [`Replay::configure`](Transceiver::configure) says is what the device was set to. Other gains are refused, as is a waveform of another period than was sent.

use crate::error::RadioError;
use crate::sigmf::{Flag, Recording};
use crate::transceiver::{
    About, Burst, Configuration, Event, Range, Ranges, Received, Sample, Sensors, Side,
    Transceiver, check_burst,
};

/// Most that a device rounds a gain by, dB.
const GAIN_STEP_DB: f64 = 1.0;
/// Most that a rate is off the nearest of a clock over 1, 2, 3 ...: asked for 2/3 of it, the clock or half of it are as near.
const RATE_RATIO: f64 = 1.5;

/// A recording in place of a radio.
#[derive(Debug)]
pub struct Replay {
    recording: Recording,
    about: About,
    /// The first step that no retune has come to yet.
    next: usize,
    /// The step that a burst gives, after a retune.
    current: Option<usize>,
    /// Whether it has been given.
    given: bool,
    now_s: f64,
    channels: [Vec<Sample>; 2],
}

impl Replay {
    /// Of a recording.
    pub fn new(recording: Recording) -> Self {
        let setup = recording.setup();
        let near_db = |least: f64, most: f64| Range {
            from: least - GAIN_STEP_DB,
            to: most + GAIN_STEP_DB,
        };
        let [first_db, second_db] = setup.receive_gain_db;
        // Not in the recording, and of no consequence to it.
        let any = Range {
            from: 0.0,
            to: f64::MAX,
        };
        let last_hz = setup.start_hz + setup.step_hz * setup.steps as f64;
        let about = About {
            product: "replay".to_owned(),
            serial: setup.hardware.clone(),
            ranges: Ranges {
                carrier_hz: Range {
                    from: setup.start_hz,
                    to: last_hz,
                },
                master_clock_hz: any,
                bandwidth_hz: any,
                sample_rate_hz: Range {
                    from: setup.sample_rate_hz / RATE_RATIO,
                    to: setup.sample_rate_hz * RATE_RATIO,
                },
                transmit_gain_db: near_db(setup.transmit_gain_db, setup.transmit_gain_db),
                receive_gain_db: near_db(first_db.min(second_db), first_db.max(second_db)),
                transmit_antennas: Vec::new(),
                receive_antennas: setup.receive_antennas.to_vec(),
                retune_s: 0.0,
                timed_tune: false,
            },
        };
        let now_s = recording.steps().first().map_or(0.0, |step| step.time_s);
        Self {
            recording,
            about,
            next: 0,
            current: None,
            given: false,
            now_s,
            channels: [Vec::new(), Vec::new()],
        }
    }

    fn is_of(&self, index: usize, carrier_hz: f64) -> bool {
        let half_hz = 0.5 * self.recording.setup().step_hz;
        let step = self.recording.steps().get(index);
        step.is_some_and(|step| (step.carrier_hz - carrier_hz).abs() < half_hz)
    }
}

impl Transceiver for Replay {
    fn about(&self) -> &About {
        &self.about
    }

    fn configure(&mut self, asked: &Configuration) -> Result<Configuration, RadioError> {
        asked.check(&self.about.ranges)?;
        let setup = self.recording.setup();
        for (asked_db, set_db) in asked.receive_gain_db.iter().zip(setup.receive_gain_db) {
            let near = Range {
                from: set_db - GAIN_STEP_DB,
                to: set_db + GAIN_STEP_DB,
            };
            near.check("a receiving gain", *asked_db, "dB")?;
        }
        Ok(Configuration {
            sample_rate_hz: setup.sample_rate_hz,
            transmit_gain_db: setup.transmit_gain_db,
            receive_gain_db: setup.receive_gain_db,
            ..asked.clone()
        })
    }

    fn now_s(&mut self) -> Result<f64, RadioError> {
        Ok(self.now_s)
    }

    fn tune(&mut self, side: Side, carrier_hz: f64, at_s: Option<f64>) -> Result<f64, RadioError> {
        self.about
            .ranges
            .carrier_hz
            .check("a carrier", carrier_hz, "Hz")?;
        if at_s.is_some() {
            return Err(RadioError::Unsupported(
                "retune at a time: a recording knows its own".to_owned(),
            ));
        }
        if side == Side::Transmit {
            return Ok(carrier_hz);
        }
        let found =
            (self.next..self.recording.steps().len()).find(|&index| self.is_of(index, carrier_hz));
        let Some(index) = found else {
            return Err(RadioError::Ended(format!(
                "no further step of a carrier of {carrier_hz} Hz"
            )));
        };
        self.current = Some(index);
        self.next = index + 1;
        self.given = false;
        Ok(self.recording.steps()[index].carrier_hz)
    }

    fn burst(
        &mut self,
        burst: &Burst,
        mut receive: [&mut [Sample]; 2],
    ) -> Result<Received, RadioError> {
        check_burst(burst, &receive)?;
        let period = self.recording.setup().period;
        if burst.waveform.len() != period {
            return Err(RadioError::Burst(format!(
                "a waveform of {} samples, and the recording's has {period}: replay it with its own tone and rate",
                burst.waveform.len()
            )));
        }
        let Some(mut index) = self.current else {
            return Err(RadioError::NotReady("tune the receivers first"));
        };
        let steps = self.recording.steps();
        let same_sweep = steps
            .get(index + 1)
            .is_some_and(|next| next.sweep == steps[index].sweep);
        // A sweep that turns begins with the carrier that the last one ended with.
        if self.given && same_sweep && self.is_of(index + 1, steps[index].carrier_hz) {
            index += 1;
            self.current = Some(index);
            self.next = index + 1;
        }
        self.given = true;
        let read = self.recording.read(index, &mut self.channels);
        read.map_err(|error| RadioError::File(error.to_string()))?;
        let step = &self.recording.steps()[index];
        let asked = receive[0].len();
        let there = asked.min(step.samples);
        for (out, channel) in receive.iter_mut().zip(&self.channels) {
            out[..there].copy_from_slice(&channel[..there]);
            out[there..].fill(Sample::ZERO);
        }
        let gaps = step
            .lost
            .iter()
            .map(|&(from, to)| from.min(there)..to.min(there));
        let mut lost: Vec<_> = gaps.filter(|gap| !gap.is_empty()).collect();
        if there < asked {
            lost.push(there..asked);
        }
        self.now_s = step.time_s + step.samples as f64 / self.recording.setup().sample_rate_hz;
        // Of how many samples were clipped the recording says only whether any was.
        let clipped = u32::from(step.flags.contains(&Flag::Clipped));
        Ok(Received {
            first_s: step.time_s,
            late: step.flags.contains(&Flag::Late),
            lost,
            clipped: [clipped; 2],
        })
    }

    fn sensors(&mut self) -> Result<Sensors, RadioError> {
        let flags = self
            .current
            .map(|index| &self.recording.steps()[index].flags);
        let locked = flags.is_none_or(|flags| !flags.contains(&Flag::Unlocked));
        Ok(Sensors {
            transmit_locked: locked,
            receive_locked: locked,
            reference_locked: None,
            temperature_c: None,
        })
    }

    fn events(&mut self, _events: &mut Vec<Event>) {}
}
