//! Replay of a recording in place of a radio.
//!
//! A retune of the receivers advances to the next step with that carrier, and bursts return its samples. Directly
//! following steps with the same carrier and sweep (from a recording of every burst) are returned one per burst; the
//! last of them is repeated. Samples requested beyond a step's length are reported as lost. Times are those of the
//! recording: bursts return at once, whatever start time is requested.
//!
//! The plan that made a recording also replays it, although the device rounded its settings: gains may differ by up to
//! 1 dB, the largest gain step of a receiver, and sample rates by a factor of up to 1.5, the largest distance of a rate
//! from an integer fraction of a master clock. [`Replay::configure`](Transceiver::configure) returns the recorded
//! settings. Other gains are refused, as are waveforms with another period than the recorded one.

use crate::error::RadioError;
use crate::sigmf::{Flag, Recording};
use crate::transceiver::{
    About, Burst, Configuration, Event, Range, Ranges, Received, Sample, Sensors, Side,
    Transceiver, check_burst,
};

/// Largest rounding of a gain by a device, dB.
const GAIN_STEP_DB: f64 = 1.0;
/// Largest ratio of a requested rate to the nearest integer fraction of a clock: 2/3 of the clock is equally near to
/// the clock and to half of it.
const RATE_RATIO: f64 = 1.5;

/// Replay of a recording in place of a radio.
#[derive(Debug)]
pub struct Replay {
    recording: Recording,
    about: About,
    /// First step not yet visited by a retune.
    next: usize,
    /// Step whose samples the next burst returns; `None` before a retune.
    current: Option<usize>,
    /// Whether a burst has returned its samples.
    given: bool,
    now_s: f64,
    channels: [Vec<Sample>; 2],
}

impl Replay {
    /// Replay a recording from its first step.
    pub fn new(recording: Recording) -> Self {
        let setup = recording.setup();
        let near_db = |least: f64, most: f64| Range {
            from: least - GAIN_STEP_DB,
            to: most + GAIN_STEP_DB,
        };
        let [first_db, second_db] = setup.receive_gain_db;
        // Not in the recording, and without effect on the replay.
        let any = Range {
            from: 0.0,
            to: f64::MAX,
        };
        let last_hz = setup.start_hz + setup.step_hz * setup.steps as f64;
        let about = About {
            product: "replay".to_owned(),
            serial: setup.hardware.clone(),
            driver: crate::OWN_DRIVER.to_owned(),
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

    fn waits(&self) -> bool {
        true
    }

    fn configure(&mut self, asked: &Configuration) -> Result<Configuration, RadioError> {
        asked.check(&self.about.ranges)?;
        let setup = self.recording.setup();
        for (asked_db, set_db) in asked.receive_gain_db.iter().zip(setup.receive_gain_db) {
            let near = Range {
                from: set_db - GAIN_STEP_DB,
                to: set_db + GAIN_STEP_DB,
            };
            near.check("receive gain", *asked_db, "dB")?;
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
            .check("carrier", carrier_hz, "Hz")?;
        if at_s.is_some() {
            return Err(RadioError::Unsupported(
                "scheduled retune: a replay has the times of its recording".to_owned(),
            ));
        }
        if side == Side::Transmit {
            return Ok(carrier_hz);
        }
        let found =
            (self.next..self.recording.steps().len()).find(|&index| self.is_of(index, carrier_hz));
        let Some(index) = found else {
            return Err(RadioError::Ended(format!(
                "no further step with a carrier of {carrier_hz} Hz"
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
                "waveform period of {} samples, expected {period} as in the recording: replay it with its own tone and sample rate",
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
        // In an up-down order, a sweep begins with the carrier of the previous sweep's end.
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
        // The recording only stores whether any sample was clipped, not how many.
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
