//! Range profiles of a stepped-carrier radar from a module, which is sent the counts of the radio's two receivers.
//!
//! **What it does.** [`Session::profiles`] sends a [`Ranging`]'s settings and then sweep after sweep, each burst in as many messages as it takes, and takes the profile that the module makes before it sends the next:
//! `core::sweep` on the other end of the line. Samples that were never taken are not sent, and are missing there by the same rule as here. What the line loses is noticed, for
//! a profile tells of how many samples it is made: its sweep is sent again. A profile that does not come whole is asked for again.
//!
//! **Output** [`Profile`]s, in the order of sweeps, as they come; [`subaperture_core::sweep`] says what they mean and neglect. **Cost** memory of a burst and a profile. **Errors** [`LinkError`]; the profiles until then are good.
//! **Accuracy** those of the core to the bit (`tests/link/profiles.rs`, over lines with faults; `tests/firmware/profiles.rs`, from the emulated module).

use std::ops::Range;
use std::time::{Duration, Instant};

use num_complex::{Complex, Complex32};
use subaperture_core::link::{
    Command, ProfileAssembly, ProfileHeader, Refusal, State, Status, SweepConfiguration,
    write_f32s, write_pairs,
};
use subaperture_core::sweep::Setup;
use subaperture_model::phase_history::ReadError;

use super::asking::LEAST_TRIES;
use super::conversation::TICK;
use super::ending::{LinkError, Mismatch};
use super::session::{Session, Watch};

/// Weights in a message, and samples of both channels: few, so that it is short beside line noise.
const WEIGHTS: usize = 32;
const SAMPLES: usize = 64;

/// Times that a sweep is sent before its profile is taken as it is, with what is missing told.
const MOST_SENT: u32 = 3;

/// Sweeps of a radar, burst by burst.
pub trait SweepSource {
    /// Fills `burst` with burst `index`, from 0, of a sweep; false if the sweep has no more. Asked for again where the line lost something.
    ///
    /// # Errors
    /// If it cannot be read.
    fn burst(
        &mut self,
        sweep: u32,
        index: usize,
        burst: &mut SweepBurst,
    ) -> Result<bool, ReadError>;
}

/// A burst at a carrier.
#[derive(Clone, Debug, Default)]
pub struct SweepBurst {
    /// Index of the carrier.
    pub carrier: u16,
    /// Counts of both channels, reference and echo.
    pub samples: Vec<[Complex<i16>; 2]>,
    /// Samples that are none, ascending.
    pub lost: Vec<Range<usize>>,
}

/// What a module is to make range profiles of.
pub struct Ranging<'a> {
    /// What it is told beforehand.
    pub setup: Setup,
    /// Weights of the carriers; a scatterer reads their sum.
    pub weights: &'a [f32],
    /// Sweeps 0 to this, which is none of them.
    pub sweeps: u32,
    /// Their samples.
    pub source: &'a mut dyn SweepSource,
}

/// A range profile.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// The sweep.
    pub sweep: u32,
    /// Carriers that it is made of.
    pub usable: u16,
    /// Samples of each channel that the line lost every time.
    pub missing: u32,
    /// Values at ranges `l c / (2 R step_hz)`; none where less than two carriers of three are usable.
    pub values: Vec<Complex32>,
}

/// What came of it.
#[derive(Debug)]
pub struct Profiles {
    /// Profiles taken.
    pub taken: u32,
    /// Sweeps that were sent more than once.
    pub again: u32,
    /// How it ended.
    pub ending: Result<(), LinkError>,
}

impl Session<'_> {
    /// Has the module make the profiles of all sweeps; `sink` gets each as it comes.
    pub fn profiles(
        &mut self,
        task: &mut Ranging<'_>,
        sink: &mut dyn FnMut(Profile),
        watch: &mut dyn Watch,
    ) -> Profiles {
        let mut told = Profiles {
            taken: 0,
            again: 0,
            ending: Ok(()),
        };
        let ending = match task.weights.len() == usize::from(task.setup.carriers) {
            true => self.run_profiles(task, &mut told, sink, watch),
            false => Err(Mismatch::Weights {
                weights: task.weights.len(),
                carriers: task.setup.carriers,
            }
            .into()),
        };
        told.ending = self.leave(ending);
        told
    }

    fn run_profiles(
        &mut self,
        task: &mut Ranging<'_>,
        told: &mut Profiles,
        sink: &mut dyn FnMut(Profile),
        watch: &mut dyn Watch,
    ) -> Result<(), LinkError> {
        let (id, run) = self.next_run();
        let configuration = SweepConfiguration {
            id,
            setup: task.setup,
        };
        let bytes: Vec<Vec<u8>> = (task.weights.chunks(WEIGHTS))
            .map(|weights| {
                let mut bytes = vec![0; 4 * weights.len()];
                write_f32s(weights, &mut bytes);
                bytes
            })
            .collect();
        let mut configure = vec![Command::Profiles(configuration)];
        configure.extend(
            // Messages first: places beyond the last would not fit.
            (bytes.iter().zip((0u16..).step_by(WEIGHTS)))
                .map(|(weights, first)| Command::Weights { first, weights }),
        );
        self.start((id, run), &configure, watch)?;
        let mut room = vec![0; 8 * usize::from(task.setup.bins)];
        let mut assembly = ProfileAssembly::new(&mut room);
        for sweep in 0..task.sweeps {
            let profile = self.sweep(task, sweep, &mut assembly, told, watch)?;
            told.taken += 1;
            sink(profile);
        }
        self.stop(run, watch)
    }

    /// Sends a sweep, again where the line lost something of it, and takes its profile.
    fn sweep(
        &mut self,
        task: &mut Ranging<'_>,
        sweep: u32,
        assembly: &mut ProfileAssembly<'_>,
        told: &mut Profiles,
        watch: &mut dyn Watch,
    ) -> Result<Profile, LinkError> {
        for sent in 1.. {
            let samples = self.send_sweep(task, sweep, watch)?;
            let bins = task.setup.bins;
            let (mut profile, taken) = self.await_profile((sweep, bins), assembly, watch)?;
            profile.missing = samples.saturating_sub(taken);
            if profile.missing == 0 || sent == MOST_SENT {
                return Ok(profile);
            }
            told.again += u32::from(sent == 1);
        }
        Err(LinkError::Silent)
    }

    /// Sends all bursts of a sweep; how many samples of each channel those were.
    fn send_sweep(
        &mut self,
        task: &mut Ranging<'_>,
        sweep: u32,
        watch: &mut dyn Watch,
    ) -> Result<u32, LinkError> {
        let mut burst = SweepBurst::default();
        let mut bytes = [0; 8 * SAMPLES];
        let mut all = 0;
        for index in 0.. {
            if !task.source.burst(sweep, index, &mut burst)? {
                break;
            }
            // The module would count it as refused, and the line be blamed for what is missing.
            let (carriers, samples) = (task.setup.carriers, task.setup.samples);
            let end = burst.samples.len();
            if burst.carrier >= carriers || end > samples as usize {
                return Err(Mismatch::Burst {
                    sweep,
                    index,
                    carrier: burst.carrier,
                    carriers,
                    got: end,
                    samples,
                }
                .into());
            }
            let mut from = 0;
            // Between what is lost, and after all of it.
            let lost = burst.lost.iter().cloned();
            for gap in lost.chain(std::iter::once(end..end)) {
                let there = from..gap.start.min(end).max(from);
                from = gap.end.max(there.end).min(end);
                let parts = burst.samples[there.clone()].chunks(SAMPLES);
                for (first, part) in there.step_by(SAMPLES).zip(parts) {
                    let samples = write_pairs(part, &mut bytes).unwrap_or(&[]);
                    self.way.line.outbox.send(&Command::Burst {
                        sweep,
                        carrier: burst.carrier,
                        first: u32::try_from(first).unwrap_or(u32::MAX),
                        samples,
                    });
                    all += part.len() as u32;
                }
            }
            self.ledger.counts.pulses_sent += 1;
            // The line's own pace: no more than a burst waits here, and nothing is said to it.
            let mut wait = Duration::ZERO;
            while self.way.line.outbox.backlog() > 0 {
                let before = self.way.line.outbox.backlog();
                self.hear_for(wait, None, watch)?;
                wait = match self.way.line.outbox.backlog() < before {
                    true => Duration::ZERO,
                    false => TICK,
                };
            }
        }
        Ok(all)
    }

    /// Asks for a profile until it comes whole; it, and how many samples it is made of.
    fn await_profile(
        &mut self,
        (sweep, bins): (u32, u16),
        assembly: &mut ProfileAssembly<'_>,
        watch: &mut dyn Watch,
    ) -> Result<(Profile, u32), LinkError> {
        let (idle, run) = (self.ledger.settings.idle, self.ledger.run);
        let begun = Instant::now();
        for tries in 1u32.. {
            if tries > 1 {
                self.way.line.outbox.send(&Command::Status);
            }
            self.way.line.outbox.send(&Command::Sweep { sweep });
            let mut asked = Instant::now();
            while self.waits(asked) {
                let news = self.hear(Some(assembly), watch)?;
                let is_asked =
                    |own: &ProfileHeader| own.sweep == sweep && [0, bins].contains(&own.bins);
                if let Some((header, values)) = news.profile.filter(|(own, _)| is_asked(own)) {
                    self.way.line.outbox.is_clear();
                    let profile = Profile {
                        sweep,
                        usable: header.usable,
                        missing: 0,
                        values,
                    };
                    return Ok((profile, header.taken));
                }
                if news.profile_goes_on {
                    asked = Instant::now();
                }
                match news.refusal {
                    // It was told what it says that it does not know.
                    Some(Refusal::NotConfigured | Refusal::NotRunning) => {
                        return Err(LinkError::BeganAnewAtSweep(sweep));
                    }
                    Some(refusal) => return Err(LinkError::Refused(refusal)),
                    None => {}
                }
                let is_ours = |status: &Status| status.run == run && status.state == State::Running;
                if news.status.is_some_and(|status| !is_ours(&status)) {
                    return Err(LinkError::BeganAnewAtSweep(sweep));
                }
            }
            if tries >= LEAST_TRIES && begun.elapsed() > idle {
                break;
            }
        }
        Err(LinkError::Stuck(idle))
    }
}
