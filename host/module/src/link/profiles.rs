//! Range profiles of a stepped-frequency radar from a module that receives the samples of the radio's two receivers.
//!
//! [`Session::profiles`] sends the settings of a [`ProfileRun`] and then one sweep after another, each burst in as many messages
//! as it takes. It waits for the profile of a sweep before it sends the next; the module runs `core::sweep`. Samples never taken
//! are not sent and count as missing by the same rule as on the host. Losses on the line are detected, since a profile states
//! the number of its samples: the sweep is sent again. A profile that is not received completely is requested again, at growing
//! intervals. The module reports its status after every 2048 samples, so that a slow line is distinguished from a stuck module.
//!
//! **Output**: [`Profile`]s in the order of sweeps as they arrive; see [`subaperture_core::sweep`] for their
//! definition and what they neglect. **Memory**: a burst and a profile. **Errors**: [`LinkError`]; earlier profiles
//! are valid. **Accuracy**: bit-identical to the core (`tests/link/profiles.rs`, over lossy lines;
//! `tests/firmware/profiles.rs`, from the emulated module).

use std::ops::Range;
use std::time::{Duration, Instant};

use num_complex::{Complex, Complex32};
use subaperture_core::link::{
    Command, ProfileAssembly, ProfileHeader, Refusal, State, Status, SweepConfiguration,
    write_f32s, write_pairs,
};
use subaperture_core::sweep::Setup;
use subaperture_model::phase_history::ReadError;

use super::asking::MIN_TRIES;
use super::conversation::TICK;
use super::ending::{LinkError, Mismatch};
use super::session::{Session, SessionObserver};

/// Weights, and sample pairs, per message: few, since short frames are less likely to be hit by line noise.
const WEIGHTS: usize = 32;
const SAMPLES: usize = 64;

/// Sample pairs between two reports of the module's status.
const REPORTED: u32 = 2048;

/// Number of times a sweep is sent before its profile is accepted with missing samples, which are then reported.
const MAX_SENT: u32 = 3;

/// Source of a radar's sweeps, burst by burst.
pub trait SweepSource {
    /// Whether there is a sweep of this number. Called in ascending order before its bursts are read; may wait for a running capture.
    ///
    /// # Errors
    /// If the source cannot be read.
    fn has(&mut self, sweep: u32) -> Result<bool, ReadError>;

    /// Fill `burst` with burst `index` of a sweep, from 0. Returns false if the sweep has no more bursts. Called again if samples
    /// were lost on the line.
    ///
    /// # Errors
    /// If the burst cannot be read.
    fn burst(
        &mut self,
        sweep: u32,
        index: usize,
        burst: &mut SweepBurst,
    ) -> Result<bool, ReadError>;
}

/// Burst at one carrier.
#[derive(Clone, Debug, Default)]
pub struct SweepBurst {
    /// Carrier index.
    pub carrier: u16,
    /// Samples of both channels, reference and echo.
    pub samples: Vec<[Complex<i16>; 2]>,
    /// Ranges of invalid samples in ascending order.
    pub lost: Vec<Range<usize>>,
}

/// Input of a range-profile run.
pub struct ProfileRun<'a> {
    /// Settings of the range profiler.
    pub setup: Setup,
    /// Window weights of the carriers. The value of a unit scatterer is their sum.
    pub weights: &'a [f32],
    /// Samples of the sweeps, numbered from 0.
    pub source: &'a mut dyn SweepSource,
}

/// Range profile.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Sweep number.
    pub sweep: u32,
    /// Number of carriers used.
    pub usable: u16,
    /// Number of samples per channel lost on the line in every attempt.
    pub missing: u32,
    /// Values at the ranges `l c / (2 R step_hz)`. Empty if fewer than two thirds of the carriers are usable.
    pub values: Vec<Complex32>,
}

/// Result of a range-profile run.
#[derive(Debug)]
pub struct Profiles {
    /// Number of profiles received.
    pub taken: u32,
    /// Number of sweeps that were sent more than once.
    pub again: u32,
    /// How the run ended.
    pub ending: Result<(), LinkError>,
}

impl Session<'_> {
    /// Run the range profiler of the module on all sweeps and pass each profile to `sink` as it arrives.
    pub fn profiles(
        &mut self,
        task: &mut ProfileRun<'_>,
        sink: &mut dyn FnMut(Profile),
        watch: &mut dyn SessionObserver,
    ) -> Profiles {
        let mut result = Profiles {
            taken: 0,
            again: 0,
            ending: Ok(()),
        };
        let ending = match task.weights.len() == usize::from(task.setup.carriers) {
            true => self.run_profiles(task, &mut result, sink, watch),
            false => Err(Mismatch::Weights {
                weights: task.weights.len(),
                carriers: task.setup.carriers,
            }
            .into()),
        };
        result.ending = self.leave(ending);
        result
    }

    fn run_profiles(
        &mut self,
        task: &mut ProfileRun<'_>,
        result: &mut Profiles,
        sink: &mut dyn FnMut(Profile),
        watch: &mut dyn SessionObserver,
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
            // Messages first: indices beyond the last would overflow.
            (bytes.iter().zip((0u16..).step_by(WEIGHTS)))
                .map(|(weights, first)| Command::Weights { first, weights }),
        );
        let start = Command::Start { run, first: 0 };
        self.start((id, run), &configure, start, watch)?;
        let mut room = vec![0; 8 * usize::from(task.setup.bins)];
        let mut assembly = ProfileAssembly::new(&mut room);
        for sweep in 0.. {
            if !task.source.has(sweep)? {
                break;
            }
            let profile = self.sweep(task, sweep, &mut assembly, result, watch)?;
            result.taken += 1;
            sink(profile);
        }
        self.stop(run, watch)
    }

    /// Send a sweep, again if the line lost samples, and receive its profile.
    fn sweep(
        &mut self,
        task: &mut ProfileRun<'_>,
        sweep: u32,
        assembly: &mut ProfileAssembly<'_>,
        result: &mut Profiles,
        watch: &mut dyn SessionObserver,
    ) -> Result<Profile, LinkError> {
        for sent in 1.. {
            let samples = self.send_sweep(task, sweep, watch)?;
            let bins = task.setup.bins;
            let (mut profile, taken) = self.await_profile((sweep, bins), assembly, watch)?;
            profile.missing = samples.saturating_sub(taken);
            if profile.missing == 0 || sent == MAX_SENT {
                return Ok(profile);
            }
            result.again += u32::from(sent == 1);
        }
        Err(LinkError::Silent)
    }

    /// Send all bursts of a sweep. Returns the number of samples per channel.
    fn send_sweep(
        &mut self,
        task: &mut ProfileRun<'_>,
        sweep: u32,
        watch: &mut dyn SessionObserver,
    ) -> Result<u32, LinkError> {
        let mut burst = SweepBurst::default();
        let mut bytes = [0; 8 * SAMPLES];
        let (mut all, mut reported) = (0, 0);
        for index in 0.. {
            if !task.source.burst(sweep, index, &mut burst)? {
                break;
            }
            // The module would count it as refused, and the loss would be attributed to the line.
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
            // The ranges between and after the invalid samples.
            let lost = burst.lost.iter().cloned();
            for gap in lost.chain(std::iter::once(end..end)) {
                let there = from..gap.start.min(end).max(from);
                from = gap.end.max(there.end).min(end);
                let parts = burst.samples[there.clone()].chunks(SAMPLES);
                for (first, part) in there.step_by(SAMPLES).zip(parts) {
                    let samples = write_pairs(part, &mut bytes).unwrap_or(&[]);
                    self.connection.line.outbox.send(&Command::Burst {
                        sweep,
                        carrier: burst.carrier,
                        first: u32::try_from(first).unwrap_or(u32::MAX),
                        samples,
                    });
                    all += part.len() as u32;
                }
            }
            if all - reported >= REPORTED {
                self.connection.line.outbox.send(&Command::Status);
                reported = all;
            }
            self.ledger.counts.pulses_sent += 1;
            // Paced by the line: at most one burst waits here. A status that arrives meanwhile is counted only.
            let mut wait = Duration::ZERO;
            while self.connection.line.outbox.backlog() > 0 {
                let before = self.connection.line.outbox.backlog();
                self.hear_for(wait, None, watch)?;
                wait = match self.connection.line.outbox.backlog() < before {
                    true => Duration::ZERO,
                    false => TICK,
                };
            }
        }
        Ok(all)
    }

    /// Request a profile until it is received completely. Returns it with its number of samples.
    fn await_profile(
        &mut self,
        (sweep, bins): (u32, u16),
        assembly: &mut ProfileAssembly<'_>,
        watch: &mut dyn SessionObserver,
    ) -> Result<(Profile, u32), LinkError> {
        let (settings, run) = (self.ledger.settings, self.ledger.run);
        let mut answer = settings.answer;
        let (mut accepted, mut progress_at) = (0, Instant::now());
        self.connection.line.outbox.send(&Command::Sweep { sweep });
        for tries in 1u32.. {
            if tries > 1 {
                self.connection.line.outbox.send(&Command::Status);
            }
            let mut asked = Instant::now();
            while self.waits_for(asked, answer) {
                let news = self.hear(Some(assembly), watch)?;
                let is_asked =
                    |own: &ProfileHeader| own.sweep == sweep && [0, bins].contains(&own.bins);
                if let Some((header, values)) = news.profile.filter(|(own, _)| is_asked(own)) {
                    self.connection.line.outbox.is_clear();
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
                    // It was configured, but reports otherwise.
                    Some(Refusal::NotConfigured | Refusal::NotRunning) => {
                        return Err(LinkError::BeganAnewAtSweep(sweep));
                    }
                    Some(refusal) => return Err(LinkError::Refused(refusal)),
                    None => {}
                }
                let is_ours = |status: &Status| status.run == run && status.state == State::Running;
                if let Some(status) = news.status {
                    if !is_ours(&status) {
                        return Err(LinkError::BeganAnewAtSweep(sweep));
                    }
                    if status.pulses.accepted > accepted {
                        (accepted, progress_at) = (status.pulses.accepted, Instant::now());
                    } else if tries > 1 {
                        // All samples that arrived are processed, so that the request was lost.
                        self.connection.line.outbox.send(&Command::Sweep { sweep });
                        asked = Instant::now();
                    }
                }
            }
            if tries >= MIN_TRIES && progress_at.elapsed() > settings.stuck() {
                break;
            }
            // Requests wait behind the samples on a slow line.
            answer = (2 * answer).min(settings.idle);
        }
        Err(LinkError::Stuck(settings.stuck()))
    }
}
