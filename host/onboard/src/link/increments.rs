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
    Command, Damage, Encoding, MAX_ANTENNAS, Motion, MotionConfiguration, Refusal, Report, State,
    Status, write_complex32s, write_places,
};
use subaperture_core::motion::{Setup, SetupError};
use subaperture_model::phase_history::{PhaseHistory, ReadError};

use super::conversation::TICK;
use super::ending::LinkError;
use super::identity::shown;
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

/// What a pulse told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Increment {
    /// The pulse.
    pub pulse: u32,
    /// The pulse from which the motion is told; of the first its own.
    pub since: u32,
    /// Targets seen in this pulse.
    pub targets: u16,
    /// Echoes in this pulse, of targets or not.
    pub echoes: u16,
    /// The motion; none of the first pulse, and where too few targets were seen in both.
    pub motion: Option<Motion>,
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

/// What has been heard since it was last looked at.
#[derive(Default)]
struct News {
    status: Option<Status>,
    refusal: Option<Refusal>,
    increment: Option<Increment>,
}

/// So often at least, and for [`super::Settings::idle`], something is asked for.
const LEAST_TRIES: u32 = 3;

impl Odometry<'_> {
    /// Whether antennas and channels go together, and the channels' pulses with the setup.
    ///
    /// # Errors
    /// [`LinkError::Refused`], as the module would say it.
    pub fn check(&self) -> Result<(), LinkError> {
        let pairs = self.transmitters_m.len() * self.receivers_m.len();
        let antennas = self.transmitters_m.len() + self.receivers_m.len();
        if pairs != self.channels.len() || antennas > MAX_ANTENNAS {
            return Err(LinkError::Refused(Refusal::Antennas));
        }
        let frequencies = usize::from(self.setup.num_frequencies);
        for channel in self.channels {
            let collection = channel.collection();
            let got = collection.num_samples;
            if got != frequencies {
                let bytes = |samples: usize| {
                    u32::try_from(Encoding::Complex32.sample_bytes() * samples).unwrap_or(u32::MAX)
                };
                return Err(LinkError::Refused(Refusal::PulseLength {
                    expected: bytes(frequencies),
                    got: bytes(got),
                }));
            }
            let is_band = |pulse: &subaperture_model::phase_history::Pulse| {
                pulse.start_hz == self.setup.start_hz && pulse.step_hz == self.setup.step_hz
            };
            if !collection.pulses.iter().all(is_band) {
                return Err(LinkError::Refused(Refusal::Motion(SetupError::Band)));
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
        told.ending = task
            .check()
            .and_then(|()| self.run_increments(task, &mut told, watch));
        if told.ending.is_err() {
            // So that the next session finds a module that waits.
            self.way.abort(self.ledger.settings.answer);
        }
        told
    }

    fn run_increments(
        &mut self,
        task: &Odometry<'_>,
        told: &mut Odometer,
        watch: &mut dyn Watch,
    ) -> Result<(), LinkError> {
        self.ledger.configuration = self.ledger.configuration.wrapping_add(1);
        self.ledger.run = self.ledger.run.wrapping_add(1);
        let (id, run) = (self.ledger.configuration, self.ledger.run);
        let setup = task.setup;
        let antennas = [task.transmitters_m, task.receivers_m].concat();
        let mut bytes = [0; 16 * MAX_ANTENNAS];
        let places = write_places(&antennas, &mut bytes).unwrap_or(&[]);
        let configure = [
            // What an earlier session may have left.
            Command::Abort,
            Command::Motion(MotionConfiguration { id, setup }),
            Command::Antennas {
                transmitters: task.transmitters_m.len() as u16,
                places,
            },
        ];
        self.ask(&configure, watch, |status| {
            status.configuration == id && status.state == State::Ready
        })?;
        self.ask(&[Command::Start { run, first: 0 }], watch, |status| {
            status.run == run && status.state == State::Running
        })?;
        for pulse in 0..task.num_pulses() {
            match read(task, pulse)? {
                Some(samples) => self.pulse(task, pulse, &samples, told, watch)?,
                None => told.unreadable = told.unreadable.saturating_add(1),
            }
        }
        self.ask(&[Command::Stop], watch, |status| {
            status.run == run && status.state == State::Done
        })
    }

    /// Sends commands, again and again, until a status says what is waited for.
    fn ask(
        &mut self,
        commands: &[Command<'_>],
        watch: &mut dyn Watch,
        is_done: impl Fn(&Status) -> bool,
    ) -> Result<(), LinkError> {
        let settings = self.ledger.settings;
        let begun = Instant::now();
        let mut refused = None;
        for tries in 1u32.. {
            for command in commands {
                self.way.line.outbox.send(command);
            }
            let asked = Instant::now();
            while self.waits(asked) {
                let news = self.hear(watch)?;
                match news.refusal {
                    // The command before it may have been lost.
                    Some(Refusal::NotConfigured | Refusal::Running) => refused = news.refusal,
                    Some(refusal) => return Err(LinkError::Refused(refusal)),
                    None => {}
                }
                if news.status.is_some_and(|status| is_done(&status)) {
                    self.way.line.outbox.is_clear();
                    return Ok(());
                }
            }
            if tries >= LEAST_TRIES && begun.elapsed() > settings.idle {
                break;
            }
        }
        Err(refused.map_or(LinkError::Silent, LinkError::Refused))
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
            let asked = Instant::now();
            while self.waits(asked) {
                let news = self.hear(watch)?;
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

    /// Whether an answer to what was sent then may still come in time.
    fn waits(&self, asked: Instant) -> bool {
        let outbox = &self.way.line.outbox;
        let answer = self.ledger.settings.answer;
        outbox.backlog() > 0 || outbox.clear_at().max(asked).elapsed() < answer
    }

    /// Writes and reads once.
    fn hear(&mut self, watch: &mut dyn Watch) -> Result<News, LinkError> {
        if watch.cancelled() {
            return Err(LinkError::Cancelled);
        }
        let wait = TICK.min(self.ledger.settings.answer);
        let mut news = News::default();
        let mut behind = false;
        let mut bytes = self.way.line.exchange(wait)?;
        while let Some(frame) = self.way.receiver.receive::<Report<'_>>(&mut bytes) {
            match frame.map(|frame| frame.message) {
                Ok(Report::Status(status)) => news.status = Some(status),
                Ok(Report::Refused { what, .. }) => news.refusal = Some(what),
                Ok(Report::Log { text }) => watch.log(&shown(text)),
                Ok(Report::Increment {
                    pulse,
                    since,
                    targets,
                    echoes,
                    motion,
                }) => {
                    news.increment = Some(Increment {
                        pulse,
                        since,
                        targets,
                        echoes,
                        motion,
                    });
                }
                Ok(_) => {}
                // It began anew, and what it says is heard again once it has been greeted.
                Err(Damage::Repeated(_)) => behind = true,
                Err(_) => {}
            }
        }
        if behind {
            self.way.line.outbox.send(&Command::Hello);
        }
        watch.update(&self.counts());
        Ok(news)
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
        let is_number = |z: &Complex32| z.re.is_finite() && z.im.is_finite();
        if !samples.iter().all(is_number) {
            return Ok(None);
        }
        let mut bytes = vec![0; Encoding::Complex32.sample_bytes() * count];
        write_complex32s(&samples, &mut bytes);
        all.push(bytes);
    }
    Ok(Some(all))
}
