//! Motion increments from a module that receives the samples of its channels.
//!
//! [`Session::increments`] sends the settings of an [`MotionRun`] and then one pulse after another, all channels of each. It
//! waits for the increment of a pulse before it sends the next; the module runs `core::motion`. If an increment is not
//! received, all channels of its pulse are sent again until it is. Unreadable pulses are skipped; the module estimates the
//! motion across the gap. To a module in fixed point samples are sent in 16 bits, scaled by a power of two per pulse.
//!
//! With samples from the front end of the module, no samples are sent, and a lost increment is not repeated.
//!
//! **Output**: [`Increment`]s in the array frame at the previous pulse; see [`subaperture_core::motion`] for their
//! definition and what they neglect. **Memory**: a pulse of one channel. **Errors**: [`LinkError`]; earlier increments are
//! valid. **Accuracy**: bit-identical to the core (`tests/link/increments.rs`, over lossy lines;
//! `tests/firmware/increments.rs`, from the emulated module).

use std::time::Instant;

use num_complex::Complex32;
use subaperture_core::Sc16;
use subaperture_core::link::{
    Arithmetic, Command, Encoding, Increment, MAX_ANTENNAS, MotionConfiguration, State, Status,
    write_complex32s, write_places, write_sc16s,
};
use subaperture_core::motion::Setup;
use subaperture_core::stream::power_of_two;
use subaperture_model::phase_history::{PhaseHistory, ReadError};

use super::asking::MIN_TRIES;
use super::ending::{LinkError, Mismatch};
use super::session::{Session, SessionObserver};

/// Input of a motion run.
pub struct MotionRun<'a> {
    /// Settings of the odometer. [`MotionRun::check`] compares them with the recording.
    pub setup: Setup,
    /// Transmitter positions in the array frame in metres: x along the array, y along boresight.
    pub transmitters_m: &'a [[f64; 2]],
    /// Receiver positions in the array frame in metres.
    pub receivers_m: &'a [[f64; 2]],
    /// Channels, transmitters outermost, receivers innermost. Pulse `n` of each belongs to the same time.
    pub channels: &'a [&'a dyn PhaseHistory],
    /// Whether the samples come from the front end of the module, with the phase of the full path. The recording provides
    /// the number of pulses only.
    pub from_front_end: bool,
}

/// Result of a motion run.
#[derive(Debug)]
pub struct Odometer {
    /// Increments in the order of pulses.
    pub increments: Vec<Increment>,
    /// Number of pulses that could not be read and were skipped.
    pub unreadable: u32,
    /// Number of pulses that were sent more than once.
    pub again: u32,
    /// How the run ended.
    pub ending: Result<(), LinkError>,
}

impl MotionRun<'_> {
    /// Check that antennas, channels and setup are consistent. Does not involve the module.
    ///
    /// # Errors
    /// [`LinkError::Mismatch`] naming the inconsistency.
    pub fn check(&self) -> Result<(), LinkError> {
        let [transmitters, receivers] = [self.transmitters_m.len(), self.receivers_m.len()];
        if transmitters + receivers > MAX_ANTENNAS {
            return Err(Mismatch::Antennas(transmitters + receivers).into());
        }
        let channels = self.channels.len();
        if transmitters * receivers != channels {
            return Err(Mismatch::Channels {
                transmitters,
                receivers,
                channels,
            }
            .into());
        }
        for (channel, history) in self.channels.iter().enumerate() {
            let collection = history.collection();
            let (samples, frequencies) = (collection.num_samples, self.setup.num_frequencies);
            if samples != usize::from(frequencies) {
                return Err(Mismatch::Samples {
                    channel,
                    samples,
                    frequencies,
                }
                .into());
            }
            let (start_hz, step_hz) = (self.setup.start_hz, self.setup.step_hz);
            let is_other = |pulse: &subaperture_model::phase_history::Pulse| {
                pulse.start_hz != start_hz || pulse.step_hz != step_hz
            };
            if let Some(pulse) = collection.pulses.iter().position(is_other) {
                return Err(Mismatch::Band { channel, pulse }.into());
            }
        }
        Ok(())
    }

    /// Number of pulses common to all channels.
    fn num_pulses(&self) -> u32 {
        let counts = self.channels.iter().map(|c| c.collection().pulses.len());
        u32::try_from(counts.min().unwrap_or(0)).unwrap_or(u32::MAX)
    }
}

impl Session<'_> {
    /// Run the odometer of the module on all pulses.
    pub fn increments(
        &mut self,
        task: &MotionRun<'_>,
        watch: &mut dyn SessionObserver,
    ) -> Odometer {
        let mut result = Odometer {
            increments: Vec::new(),
            unreadable: 0,
            again: 0,
            ending: Ok(()),
        };
        let ending = task
            .check()
            .and_then(|()| self.run_increments(task, &mut result, watch));
        result.ending = self.leave(ending);
        result
    }

    fn run_increments(
        &mut self,
        task: &MotionRun<'_>,
        result: &mut Odometer,
        watch: &mut dyn SessionObserver,
    ) -> Result<(), LinkError> {
        let (id, run) = self.next_run();
        let setup = task.setup;
        let antennas = [task.transmitters_m, task.receivers_m].concat();
        let mut bytes = [0; 16 * MAX_ANTENNAS];
        let places = write_places(&antennas, &mut bytes).unwrap_or(&[]);
        let configure = [
            Command::Motion(MotionConfiguration { id, setup }),
            Command::Antennas {
                transmitters: task.transmitters_m.len() as u16,
                places,
            },
        ];
        self.ledger.counts.pulses = task.num_pulses().into();
        if task.from_front_end {
            let start = Command::StartFrontEnd { run, first: 0 };
            self.start((id, run), &configure, start, watch)?;
            self.hear_increments(task, result, watch)?;
            return self.stop(run, watch);
        }
        let start = Command::Start { run, first: 0 };
        self.start((id, run), &configure, start, watch)?;
        let encoding = match self.identity().arithmetic {
            Arithmetic::Float => Encoding::Complex32,
            Arithmetic::Fixed => Encoding::Sc16,
        };
        for pulse in 0..task.num_pulses() {
            match read(task, pulse, encoding)? {
                Some(samples) => {
                    self.pulse(task, pulse, (encoding, &samples), result, watch)?;
                }
                None => result.unreadable = result.unreadable.saturating_add(1),
            }
        }
        self.stop(run, watch)
    }

    /// Receive the increments of pulses from the front end, until that of the last pulse or until the module has none for the time
    /// that a run may be idle.
    fn hear_increments(
        &mut self,
        task: &MotionRun<'_>,
        result: &mut Odometer,
        watch: &mut dyn SessionObserver,
    ) -> Result<(), LinkError> {
        let settings = self.ledger.settings;
        let (pulses, run) = (task.num_pulses(), self.ledger.run);
        let (mut heard, mut asked) = (Instant::now(), Instant::now());
        let mut next = 0;
        while next < pulses && heard.elapsed() <= settings.idle {
            let news = self.hear(None, watch)?;
            if let Some(refusal) = news.refusal {
                return Err(LinkError::Refused(refusal));
            }
            for increment in news.increments {
                if increment.pulse >= next {
                    next = increment.pulse.saturating_add(1);
                    heard = Instant::now();
                    result.increments.push(increment);
                }
            }
            if let Some(status) = news.status {
                if status.run != run || status.state != State::Running {
                    return Err(LinkError::BeganAnew(next));
                }
                // The last increments were lost on the line.
                next = next.max(status.next_pulse);
            }
            if heard.max(asked).elapsed() > settings.answer {
                self.connection.line.outbox.send(&Command::Status);
                asked = Instant::now();
            }
        }
        match result.increments.is_empty() {
            true => Err(LinkError::Stuck(settings.idle)),
            false => Ok(()),
        }
    }

    /// Send a pulse repeatedly until its increment is received.
    fn pulse(
        &mut self,
        task: &MotionRun<'_>,
        pulse: u32,
        (encoding, samples): (Encoding, &[Vec<u8>]),
        result: &mut Odometer,
        watch: &mut dyn SessionObserver,
    ) -> Result<(), LinkError> {
        let (idle, run) = (self.ledger.settings.idle, self.ledger.run);
        let begun = Instant::now();
        for tries in 0u32.. {
            if tries > 0 {
                result.again = result.again.saturating_add(u32::from(tries == 1));
                self.ledger.counts.pulses_resent += 1;
                self.connection.line.outbox.send(&Command::Status);
            }
            for (channel, (samples, history)) in (0..).zip(samples.iter().zip(task.channels)) {
                let pulses = &history.collection().pulses;
                let own = pulses.get(pulse as usize);
                self.connection.line.outbox.send(&Command::Channel {
                    pulse,
                    channel,
                    reference_path_m: own.map_or(0.0, |own| own.reference_path_m),
                    encoding,
                    samples,
                });
            }
            self.ledger.counts.pulses_sent += 1;
            let asked = Instant::now();
            while self.waits(asked) {
                let news = self.hear(None, watch)?;
                let mut increments = news.increments.into_iter();
                if let Some(increment) = increments.find(|own| own.pulse == pulse) {
                    // A repeated pulse gets repeated answers.
                    self.connection.line.outbox.is_clear();
                    result.increments.push(increment);
                    return Ok(());
                }
                if let Some(refusal) = news.refusal {
                    return Err(LinkError::Refused(refusal));
                }
                let is_ours = |status: &Status| status.run == run && status.state == State::Running;
                if news.status.is_some_and(|status| !is_ours(&status)) {
                    return Err(LinkError::BeganAnew(pulse));
                }
            }
            if tries + 1 >= MIN_TRIES && begun.elapsed() > idle {
                break;
            }
        }
        Err(LinkError::Stuck(idle))
    }
}

/// Encoded samples of all channels of a pulse. `None` if one of them cannot be read.
fn read(
    task: &MotionRun<'_>,
    pulse: u32,
    encoding: Encoding,
) -> Result<Option<Vec<Vec<u8>>>, LinkError> {
    let n = pulse as usize;
    let mut all = Vec::with_capacity(task.channels.len());
    for channel in task.channels {
        let mut samples = vec![Complex32::ZERO; channel.collection().num_samples];
        match channel.read(n..n + 1, &mut samples) {
            Err(ReadError::NotFinite { .. }) => return Ok(None),
            other => other?,
        }
        all.push(samples);
    }
    let scale = match encoding {
        Encoding::Complex32 => 1.0,
        Encoding::Sc16 => {
            let parts = all.iter().flatten().flat_map(|z| [z.re.abs(), z.im.abs()]);
            power_of_two_below_one(parts.fold(0.0, f32::max))
        }
    };
    let encoded = all.iter().map(|samples| {
        let mut bytes = vec![0; encoding.sample_bytes() * samples.len()];
        match encoding {
            Encoding::Complex32 => write_complex32s(samples, &mut bytes),
            Encoding::Sc16 => {
                let narrow = samples.iter().map(|z| Sc16::from_complex32(z * scale).0);
                write_sc16s(&narrow.collect::<Vec<_>>(), &mut bytes)
            }
        };
        bytes
    });
    Ok(Some(encoded.collect()))
}

/// Power of two whose product with `largest` is from 0.5 to 1; 1 for zero.
fn power_of_two_below_one(largest: f32) -> f32 {
    match largest > 0.0 {
        // Limited to the exponents of normal numbers; the cast saturates.
        true => power_of_two((-1.0 - largest.log2().floor()) as i8),
        false => 1.0,
    }
}
