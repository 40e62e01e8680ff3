//! Increments of a radar's own motion from a module, which is sent its channels' samples.
//!
//! **What it does.** [`Session::increments`] sends an [`Odometry`]'s settings and then pulse after pulse, all channels of each, and takes the increment that the module finds before it sends the next:
//! `core::motion` on the other end of the line. What is lost is asked for: of a pulse whose increment does not come all channels are sent again, until it does. Pulses that cannot be
//! read are left out; the module tells the motion over the gap.
//!
//! **Output** [`Increment`]s, in the array's frame at the pulse before; [`subaperture_core::motion`] says what they mean and neglect. **Cost** memory of a pulse of one channel. **Errors**
//! [`LinkError`]; the increments until then are good. **Accuracy** those of the core to the bit (`tests/link/increments.rs`, over lines with faults; `tests/firmware/increments.rs`, from the emulated module).

use std::time::Instant;

use num_complex::Complex32;
use subaperture_core::link::{
    Command, Encoding, Increment, MAX_ANTENNAS, MotionConfiguration, State, Status,
    write_complex32s, write_places,
};
use subaperture_core::motion::Setup;
use subaperture_model::phase_history::{PhaseHistory, ReadError};

use super::asking::LEAST_TRIES;
use super::ending::{LinkError, Mismatch};
use super::session::{Session, Watch};

/// What a module is to find the increments of.
pub struct Odometry<'a> {
    /// What it is told beforehand; [`Odometry::check`] says what of it the recording contradicts.
    pub setup: Setup,
    /// Transmitters in the array's frame: x along the array, y where it looks, metres.
    pub transmitters_m: &'a [[f64; 2]],
    /// Receivers.
    pub receivers_m: &'a [[f64; 2]],
    /// Channels, transmitter by transmitter, receiver by receiver; pulse `n` of each is of the same turn.
    pub channels: &'a [&'a dyn PhaseHistory],
}

/// What came of it.
#[derive(Debug)]
pub struct Odometer {
    /// Increments in the order of pulses.
    pub increments: Vec<Increment>,
    /// Pulses that could not be read, and are left out.
    pub unreadable: u32,
    /// Pulses that were sent more than once.
    pub again: u32,
    /// How it ended.
    pub ending: Result<(), LinkError>,
}

impl Odometry<'_> {
    /// Whether antennas and channels go together, and the channels' pulses with the setup. Nothing of it concerns the module.
    ///
    /// # Errors
    /// [`LinkError::Mismatch`].
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

    /// Pulses that all channels have.
    fn num_pulses(&self) -> u32 {
        let counts = self.channels.iter().map(|c| c.collection().pulses.len());
        u32::try_from(counts.min().unwrap_or(0)).unwrap_or(u32::MAX)
    }
}

impl Session<'_> {
    /// Has the module find the increments of all pulses.
    pub fn increments(&mut self, task: &Odometry<'_>, watch: &mut dyn Watch) -> Odometer {
        let mut told = Odometer {
            increments: Vec::new(),
            unreadable: 0,
            again: 0,
            ending: Ok(()),
        };
        let ending = task
            .check()
            .and_then(|()| self.run_increments(task, &mut told, watch));
        told.ending = self.leave(ending);
        told
    }

    fn run_increments(
        &mut self,
        task: &Odometry<'_>,
        told: &mut Odometer,
        watch: &mut dyn Watch,
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
        self.start((id, run), &configure, watch)?;
        self.ledger.counts.pulses = task.num_pulses().into();
        for pulse in 0..task.num_pulses() {
            match read(task, pulse)? {
                Some(samples) => self.pulse(task, pulse, &samples, told, watch)?,
                None => told.unreadable = told.unreadable.saturating_add(1),
            }
        }
        self.stop(run, watch)
    }

    /// Sends a pulse, again and again, until its increment comes.
    fn pulse(
        &mut self,
        task: &Odometry<'_>,
        pulse: u32,
        samples: &[Vec<u8>],
        told: &mut Odometer,
        watch: &mut dyn Watch,
    ) -> Result<(), LinkError> {
        let (idle, run) = (self.ledger.settings.idle, self.ledger.run);
        let begun = Instant::now();
        for tries in 0u32.. {
            if tries > 0 {
                told.again = told.again.saturating_add(u32::from(tries == 1));
                self.ledger.counts.pulses_resent += 1;
                self.way.line.outbox.send(&Command::Status);
            }
            for (channel, (samples, history)) in (0..).zip(samples.iter().zip(task.channels)) {
                let pulses = &history.collection().pulses;
                let own = pulses.get(pulse as usize);
                self.way.line.outbox.send(&Command::Channel {
                    pulse,
                    channel,
                    reference_path_m: own.map_or(0.0, |own| own.reference_path_m),
                    encoding: Encoding::Complex32,
                    samples,
                });
            }
            self.ledger.counts.pulses_sent += 1;
            let asked = Instant::now();
            while self.waits(asked) {
                let news = self.hear(None, watch)?;
                if let Some(increment) = news.increment.filter(|own| own.pulse == pulse) {
                    // What was sent twice is answered twice.
                    self.way.line.outbox.is_clear();
                    told.increments.push(increment);
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
            if tries + 1 >= LEAST_TRIES && begun.elapsed() > idle {
                break;
            }
        }
        Err(LinkError::Stuck(idle))
    }
}

/// All channels' samples of a pulse as they are sent; none if one of them cannot be read.
fn read(task: &Odometry<'_>, pulse: u32) -> Result<Option<Vec<Vec<u8>>>, LinkError> {
    let mut all = Vec::with_capacity(task.channels.len());
    let n = pulse as usize;
    for channel in task.channels {
        let count = channel.collection().num_samples;
        let mut samples = vec![Complex32::ZERO; count];
        match channel.read(n..n + 1, &mut samples) {
            Err(ReadError::NotFinite { .. }) => return Ok(None),
            other => other?,
        }
        let mut bytes = vec![0; Encoding::Complex32.sample_bytes() * count];
        write_complex32s(&samples, &mut bytes);
        all.push(bytes);
    }
    Ok(Some(all))
}
