//! Leading a module through a job: configuration, runs, and what was lost.
//!
//! **Runs.** The first goes through all sub-CPIs. A tail of pulses that did not arrive (the module
//! answers after the last of them and expects an earlier one) is sent again at once; a pulse lost amid others
//! costs its sub-CPI. When the run is over, further runs go through the sub-CPIs of which a map is
//! missing, up to [`Settings::retries`](super::Settings) times. At a given rate nothing is sent twice:
//! that is a radar, which does not wait.
//!
//! **When things break.** A line that fails, a silent module, one that began anew or one that answers and
//! does not go on: connect, greet,
//! end what is going on, configure, and go on with what is missing of the run. That is given up when
//! it happened eight times without a map in between.

use std::collections::{BTreeSet, VecDeque};
use std::ops::Range;
use std::time::{Duration, Instant};

use subaperture_core::link::{
    Command, Configuration, Encoding, MapAssembly, Refusal, Report, State, Status, row_bytes,
    write_f32s,
};

use super::counts::Counts;
use super::job::{Job, Wanted};
use super::session::{ATTEMPTS, Context, LinkError, MapSink, Session, TICK, is_busy};

/// Weights in a message: few, so that it is short beside line noise.
const WEIGHTS_A_FRAME: usize = 32;

/// Bytes that wait for the line beyond which no pulse is added, so that answers stay prompt.
const BACKLOG_BYTES: usize = 8192;

/// A module that answers gets so many times the patience of one that is silent: a large map on a small
/// processor takes seconds.
const STUCK_IDLES: u32 = 6;

/// Times that things may break without a map in between.
const FRUITLESS: u32 = 8;

/// Where maps go.
pub(super) struct Intake<'c> {
    assembly: MapAssembly<'c>,
    wanted: Wanted<'c>,
    taken: BTreeSet<(u32, u16)>,
    sink: &'c mut dyn MapSink,
    /// Maps are of the run that is going on.
    listening: bool,
    /// Runs are made for what an earlier one lost.
    again: bool,
}

impl<'c> Intake<'c> {
    /// Bytes of the largest map, in either encoding.
    pub(super) fn room_bytes(wanted: &Wanted<'_>) -> usize {
        let bytes = wanted.patches.iter().flat_map(|patch| {
            [Encoding::Complex32, Encoding::Sc16].map(|encoding| {
                row_bytes(encoding, patch.num_range_bins()).unwrap_or(0) * patch.num_doppler_bins()
            })
        });
        bytes.max().unwrap_or(0)
    }

    pub(super) fn new(wanted: Wanted<'c>, buffer: &'c mut [u8], sink: &'c mut dyn MapSink) -> Self {
        Self {
            assembly: MapAssembly::new(buffer),
            wanted,
            taken: BTreeSet::new(),
            sink,
            listening: false,
            again: false,
        }
    }

    /// Takes a report; a map that it completes goes to the sink if it is wanted.
    pub(super) fn take(
        &mut self,
        report: &Report<'_>,
        counts: &mut Counts,
    ) -> Result<(), LinkError> {
        if !self.listening {
            return Ok(());
        }
        // Losses are counted by the assembly.
        let Ok(Some(map)) = self.assembly.take(report) else {
            return Ok(());
        };
        let key = (map.header.sub_cpi, map.header.patch_index);
        if !self.wanted.asks_for(&map.header) {
            counts.maps_refused += 1;
        } else if self.taken.contains(&key) {
            counts.maps_repeated += 1;
        } else {
            self.sink.accept(&map).map_err(LinkError::Sink)?;
            self.taken.insert(key);
            counts.maps_taken += 1;
            counts.maps_fetched_again += u64::from(self.again);
        }
        Ok(())
    }

    /// A run begins.
    fn begin(&mut self) {
        self.assembly.restart();
        self.listening = true;
    }

    /// It is over, or broke off.
    fn end(&mut self, counts: &mut Counts) {
        self.listening = false;
        counts.maps_lost += u64::from(self.assembly.lost());
    }

    fn has_all(&self, sub_cpi: u32) -> bool {
        let patches = self.wanted.patches.len();
        self.taken.range((sub_cpi, 0)..=(sub_cpi, u16::MAX)).count() == patches
    }

    /// Runs of sub-CPIs within `range` of which a map is missing.
    fn missing(&self, range: Range<u32>) -> VecDeque<Range<u32>> {
        let mut runs: VecDeque<Range<u32>> = VecDeque::new();
        for sub_cpi in range.filter(|&sub_cpi| !self.has_all(sub_cpi)) {
            match runs.back_mut() {
                Some(run) if run.end == sub_cpi => run.end += 1,
                _ => runs.push_back(sub_cpi..sub_cpi + 1),
            }
        }
        runs
    }

    /// Every map that is missing.
    pub(super) fn missing_maps(&self) -> Vec<(u32, u16)> {
        let patches = 0..self.wanted.patches.len() as u16;
        (0..self.wanted.num_sub_cpis())
            .flat_map(|sub_cpi| patches.clone().map(move |patch| (sub_cpi, patch)))
            .filter(|key| !self.taken.contains(key))
            .collect()
    }
}

/// When pulses are due at a given rate.
#[derive(Clone, Copy)]
struct Clock {
    rate_hz: f64,
    start: Instant,
}

impl Clock {
    fn due(&self) -> u32 {
        // Saturates beyond the largest number.
        (self.start.elapsed().as_secs_f64() * self.rate_hz) as u32
    }

    fn quarter_period(&self) -> Duration {
        // A rate may be so low that its period is no duration.
        Duration::try_from_secs_f64(0.25 / self.rate_hz).unwrap_or(Duration::MAX)
    }
}

impl Session<'_> {
    /// Has the module do all of `job`.
    pub(super) fn lead(
        &mut self,
        job: &mut Job<'_>,
        context: &mut Context<'_>,
    ) -> Result<(), LinkError> {
        if let Err(error) = self.configure(job, context) {
            self.recover(error, job, context)?;
        }
        let mut clock = None;
        let passes = match self.settings.rate_hz {
            None => self.settings.retries.saturating_add(1),
            Some(_) => 1,
        };
        let mut fruitless = 0;
        for pass in 0..passes {
            let Some(intake) = &mut context.intake else {
                return Ok(());
            };
            intake.again = pass > 0;
            let all = 0..intake.wanted.num_sub_cpis();
            let mut todo = intake.missing(all);
            if todo.is_empty() {
                break;
            }
            while let Some(range) = todo.pop_front() {
                let before = self.counts.maps_taken;
                let Err(error) = self.run(range.clone(), job, &mut clock, context) else {
                    continue;
                };
                fruitless = match self.counts.maps_taken {
                    taken if taken > before => 0,
                    _ => fruitless + 1,
                };
                if fruitless > FRUITLESS {
                    return Err(error);
                }
                self.recover(error, job, context)?;
                if let Some(intake) = &context.intake {
                    let mut rest = range;
                    if let Some(clock) = &clock {
                        let clock: &Clock = clock;
                        rest.start = intake.wanted.sub_cpi_from(clock.due()).max(rest.start);
                    }
                    let mut rest = intake.missing(rest);
                    rest.append(&mut todo);
                    todo = rest;
                }
            }
        }
        Ok(())
    }

    /// Makes the conversation anew after `error`, if that may help.
    fn recover(
        &mut self,
        error: LinkError,
        job: &Job<'_>,
        context: &mut Context<'_>,
    ) -> Result<(), LinkError> {
        let mut error = error;
        for _ in 0..FRUITLESS {
            if !error.is_passing() {
                return Err(error);
            }
            context.watch.log(&format!("{error}: beginning anew"));
            if matches!(error, LinkError::Restarted) {
                self.counts.restarts += 1;
            } else {
                self.counts.reconnects += 1;
                if let Err(failure) = self.line.reconnect() {
                    // It may be on its way back.
                    let started = Instant::now();
                    while started.elapsed() < self.settings.answer {
                        if context.watch.cancelled() {
                            return Err(LinkError::Cancelled);
                        }
                        std::thread::sleep(TICK.min(self.settings.answer));
                    }
                    error = failure.into();
                    continue;
                }
            }
            let again = self.greet(context).and_then(|identity| {
                if identity.capacity == self.identity().capacity
                    && identity.arithmetic == self.identity().arithmetic
                {
                    self.configure(job, context)
                } else {
                    // Another module than the one that all was planned for.
                    Err(LinkError::Refused(Refusal::Unsupported))
                }
            });
            match again {
                Ok(()) => return Ok(()),
                Err(other) => error = other,
            }
        }
        Err(error)
    }

    /// Sends the settings until the module is ready.
    fn configure(&mut self, job: &Job<'_>, context: &mut Context<'_>) -> Result<(), LinkError> {
        let mut last = LinkError::Silent;
        for _ in 0..ATTEMPTS {
            self.configuration = self.configuration.wrapping_add(1);
            match self.configure_once(job, context) {
                Ok(()) => return Ok(()),
                // An answer taken for another's: something is missing there.
                Err(LinkError::Refused(
                    what @ (Refusal::Weights
                    | Refusal::PatchIndex
                    | Refusal::NotConfigured
                    | Refusal::Running),
                )) => last = LinkError::Refused(what),
                Err(LinkError::Restarted) => last = LinkError::Restarted,
                Err(error) => return Err(error),
            }
        }
        Err(last)
    }

    fn configure_once(
        &mut self,
        job: &Job<'_>,
        context: &mut Context<'_>,
    ) -> Result<(), LinkError> {
        let id = self.configuration;
        self.ask(&Command::Abort, ATTEMPTS, context, |status| {
            Ok(!is_busy(status))
        })?;
        let configure = Command::Configure(Configuration {
            id,
            setup: job.setup,
        });
        self.ask(&configure, ATTEMPTS, context, |status| {
            Ok(status.configuration == id)
        })?;
        let mine = |status: &Status| match status.configuration == id {
            true => Ok(true),
            false => Err(LinkError::Restarted),
        };
        let mut bytes = [0; 4 * WEIGHTS_A_FRAME];
        let mut first = 0;
        for weights in job.fast_weights.chunks(WEIGHTS_A_FRAME) {
            let weights = write_f32s(weights, &mut bytes).unwrap_or(&[]);
            self.ask(
                &Command::Weights { first, weights },
                ATTEMPTS,
                context,
                mine,
            )?;
            first += WEIGHTS_A_FRAME as u16;
        }
        let count = job.patches.len() as u16;
        for (index, patch) in (0..).zip(&job.patches) {
            let command = Command::Patch {
                index,
                count,
                patch: *patch,
            };
            self.ask(&command, ATTEMPTS, context, mine)?;
        }
        let ready = |status: &Status| Ok(mine(status)? && status.state == State::Ready);
        match self.ask(&Command::Status, 5, context, ready) {
            Ok(_) => Ok(()),
            Err(LinkError::Silent) => Err(LinkError::Refused(Refusal::NotConfigured)),
            Err(error) => Err(error),
        }
    }

    /// Sends the pulses of a run of sub-CPIs and takes their maps.
    fn run(
        &mut self,
        range: Range<u32>,
        job: &mut Job<'_>,
        clock: &mut Option<Clock>,
        context: &mut Context<'_>,
    ) -> Result<(), LinkError> {
        let wanted = job.wanted();
        let (first, end) = (
            wanted.first_pulse(range.start),
            wanted.first_pulse(range.end),
        );
        self.run = self.run.wrapping_add(1);
        let (run, configuration) = (self.run, self.configuration);
        let started = self.ask(
            &Command::Start { run, first },
            ATTEMPTS,
            context,
            |status| match status.configuration == configuration {
                true => Ok(status.run == run && status.state != State::Idle),
                false => Err(LinkError::Restarted),
            },
        );
        let mut told = match started {
            Err(LinkError::Refused(Refusal::NotConfigured | Refusal::Running)) => {
                return Err(LinkError::Restarted);
            }
            started => started?,
        };
        self.counts.runs += 1;
        if let Some(intake) = &mut context.intake {
            intake.begin();
        }
        self.running = true;
        self.advanced = Instant::now();
        let clock = self.settings.rate_hz.map(|rate_hz| {
            // It starts with the first run, and that with the first pulse.
            *clock.get_or_insert_with(|| Clock {
                rate_hz,
                start: Instant::now(),
            })
        });
        let streamed = self
            .stream(first..end, job, clock.as_ref(), &mut told, context)
            .and_then(|()| self.finish(&mut told, context));
        // After a failure, so that the module is told to end the run, it still counts as going on.
        self.running = streamed.is_err();
        self.counts.module_pulses.add(&told.pulses);
        if streamed.is_ok() {
            // Of those lost at the end the module cannot know.
            let unknown = end.saturating_sub(told.next_pulse);
            self.counts.module_pulses.lost += u64::from(unknown);
        }
        if let Some(intake) = &mut context.intake {
            intake.end(&mut self.counts);
        }
        streamed
    }

    /// Sends pulses until the module has had all of them.
    fn stream(
        &mut self,
        pulses: Range<u32>,
        job: &mut Job<'_>,
        clock: Option<&Clock>,
        told: &mut Status,
        context: &mut Context<'_>,
    ) -> Result<(), LinkError> {
        let mut next = pulses.start;
        // When something happened last, and whether the module was asked since.
        let (mut moved, mut asked) = (Instant::now(), false);
        loop {
            let limit = match clock {
                None => told.accept_through.min(pulses.end),
                Some(clock) => clock.due().min(pulses.end),
            };
            while next < limit && self.line.backlog() < BACKLOG_BYTES {
                let encoding = job.pulses.encoding();
                let (pulse, samples) = job.pulses.pulse(next)?;
                self.line.send(&Command::Pulse {
                    pulse,
                    encoding,
                    samples,
                });
                self.counts.pulses_sent += 1;
                next += 1;
            }
            if clock.is_some() && next < limit {
                // A radar does not wait for the line.
                self.counts.pulses_unsent += u64::from(limit - next);
                next = limit;
            }
            let all_sent = next == pulses.end;
            if all_sent && (told.next_pulse >= pulses.end || clock.is_some()) {
                return Ok(());
            }
            let wait = match clock {
                Some(clock) => TICK.min(clock.quarter_period()),
                None => TICK.min(self.settings.answer),
            };
            self.pump(wait, context)?;
            self.fail_if_pulse_refused()?;
            if let Some(status) = self.news.status.take() {
                self.check_mine(&status)?;
                let place =
                    |status: &Status| (status.next_pulse, status.accept_through, status.maps);
                if place(&status) != place(told) {
                    (moved, asked) = (Instant::now(), false);
                    self.advanced = moved;
                } else if asked && status.next_pulse < next && clock.is_none() {
                    // It answers after the last pulse, and waits for an earlier one.
                    self.counts.pulses_resent += u64::from(next - status.next_pulse);
                    next = status.next_pulse.max(pulses.start);
                    (moved, asked) = (Instant::now(), false);
                }
                *told = status;
                if told.next_pulse >= next {
                    self.line.is_clear();
                }
            }
            // At a given rate it ends by itself.
            if clock.is_none() {
                self.fail_if_stuck()?;
            }
            if self.line.backlog() > 0 {
                moved = Instant::now();
            }
            if moved.elapsed() > self.settings.answer {
                self.line.send(&Command::Status);
                (moved, asked) = (Instant::now(), true);
            }
        }
    }

    /// Ends the run and takes the maps that are still to come.
    fn finish(&mut self, told: &mut Status, context: &mut Context<'_>) -> Result<(), LinkError> {
        let (run, configuration) = (self.run, self.configuration);
        let over =
            |status: &Status| match (status.run, status.configuration) == (run, configuration) {
                true => Ok(matches!(status.state, State::Finishing | State::Done)),
                false => Err(LinkError::Restarted),
            };
        *told = self.ask(&Command::Stop, ATTEMPTS, context, over)?;
        let mut moved = Instant::now();
        self.advanced = moved;
        while told.state != State::Done {
            self.pump(TICK.min(self.settings.answer), context)?;
            if let Some(status) = self.news.status.take() {
                self.check_mine(&status)?;
                moved = Instant::now();
                if status.maps != told.maps {
                    self.advanced = moved;
                }
                *told = status;
            }
            self.fail_if_stuck()?;
            if self.line.backlog() > 0 {
                moved = Instant::now();
            }
            if moved.elapsed() > self.settings.answer {
                self.line.send(&Command::Status);
                moved = Instant::now();
            }
        }
        if let Some(intake) = &mut context.intake {
            intake.assembly.finish(told.maps);
        }
        Ok(())
    }

    /// Fails if nothing has come of a run for so long that nothing will.
    fn fail_if_stuck(&self) -> Result<(), LinkError> {
        let limit = self.settings.idle * STUCK_IDLES;
        match self.advanced.elapsed() > limit {
            true => Err(LinkError::Stuck(limit)),
            false => Ok(()),
        }
    }

    /// The module says of the first pulse that it cannot use that it is none.
    fn fail_if_pulse_refused(&mut self) -> Result<(), LinkError> {
        match self.news.refusal.take() {
            Some((_, what @ (Refusal::Encoding | Refusal::PulseLength { .. }))) => {
                Err(LinkError::Refused(what))
            }
            _ => Ok(()),
        }
    }
}
