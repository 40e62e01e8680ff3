//! Capture of a plan with a radio into a recording.
//!
//! ```text
//! radio (this thread): tune, tune, burst until the reference is steady ──queue──> disk (thread): sigmf::Writer
//!                                                      └─────────queue (try)────> live: mixed tone, levels, counters per step
//! ```
//!
//! # Rules
//!
//! - A burst whose reference is not steady ([`crate::tone`]) is repeated, up to the plan's `bursts` times. The last
//!   burst is kept, with the flag [`Flag::Unsteady`] if it is still not steady. The settling time of a step is
//!   therefore decided by its data.
//! - Late, lost and clipped samples are flagged and kept, with the ranges of lost samples. They are not captured again,
//!   so that the sweep interval holds. [`crate::profile`] defines how a range profile uses such steps.
//! - The queue to the disk is bounded. When it is full, the radio waits before it requests the next burst: no sample is
//!   lost, sweeps take longer, and the waits are counted ([`Summary::waits`]). The queue to the live view is bounded
//!   and never delays a radio whose clock runs: steps that do not fit are dropped from the view and counted
//!   ([`Summary::not_shown`]). A simulated radio and a replay wait instead ([`Transceiver::waits`]), so that the live view does not depend on
//!   the load of the machine.
//! - The carrier of a step is the one reported by the radio. A radio that tunes more than a thousandth of a step off
//!   the plan's carrier is refused.
//! - The capture ends when the radio disconnects, the disk is full or a stop is requested. The recording up to that
//!   point is closed normally.
//!
//! Memory: the queue's buffers of two bursts each, and the plan; it does not grow with time. Processing cost: mixing
//! each burst, converting it to bytes, and writing.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, TrySendError, channel, sync_channel};
use std::thread;

use num_complex::Complex32;

use crate::error::RadioError;
use crate::live::{Counts, Level};
use crate::plan::Plan;
use crate::sigmf::{Flag, Setup, SigmfError, Step, Writer, discard};
use crate::tone::{Mixed, Tone};
use crate::transceiver::{
    About, Burst, Configuration, Event, EventKind, Sample, Side, Transceiver,
};

/// Largest carrier error accepted, in steps. Range profiles assume evenly spaced carriers. At the farthest range the
/// phase error of a carrier is `2 pi` times this, which puts the error at -44 dB of its echo.
const OFF_CARRIER: f64 = 1e-3;

pub use crate::live::LiveStep;

/// Size of the queues of a capture.
#[derive(Clone, Copy, Debug)]
pub struct Queues {
    /// Bursts in the queue between radio and disk.
    pub disk: usize,
}

impl Queues {
    /// Largest queue whose buffers fit `bytes`, counting the two bursts held by the radio and disk threads; at least 1
    /// and at most the default.
    pub fn within(plan: &Plan, bytes: u64) -> Self {
        let burst_bytes = 8 * plan.samples() as u64;
        let fit = (bytes / burst_bytes.max(1)).saturating_sub(2);
        Self {
            disk: fit.clamp(1, Self::default().disk as u64) as usize,
        }
    }
}

impl Default for Queues {
    /// 64 bursts: bridges two seconds of stalled writing at 30 ms per step.
    fn default() -> Self {
        Self { disk: 64 }
    }
}

/// Reason why a capture ended.
#[derive(Debug)]
pub enum EndReason {
    /// All sweeps are complete.
    Done,
    /// A stop was requested.
    Stopped,
    /// The radio reported an error.
    Radio(RadioError),
    /// The recording could not be written, for example because the disk is full.
    Disk(SigmfError),
}

/// Summary of a capture.
#[derive(Debug)]
pub struct Summary {
    /// Reason for the end.
    pub ended: EndReason,
    /// Number of steps recorded.
    pub steps: u64,
    /// Steps flagged late, with lost samples, unsteady, clipped, unlocked, in the order of [`Flag`].
    pub flagged: [u64; 5],
    /// Bursts requested from the radio.
    pub bursts: u64,
    /// Events by kind, in the order of [`EventKind`]: overruns, underruns, late commands, lost packets, disconnections.
    pub events: [u64; 5],
    /// Lost samples per channel.
    pub lost_samples: u64,
    /// Number of times that the radio waited for the disk.
    pub waits: u64,
    /// Largest number of bursts in the queue to the disk.
    pub longest_queue: usize,
    /// Steps dropped from the live view.
    pub not_shown: u64,
    /// Sweeps that began later than the plan's interval.
    pub late_sweeps: u64,
    /// Settings in effect on the radio.
    pub set: Configuration,
}

/// Radio settings in effect for a plan.
#[derive(Clone, Debug)]
pub struct Ready {
    /// Settings in effect on the device.
    pub set: Configuration,
    /// Parameters common to the whole recording.
    pub setup: Setup,
}

/// Captured burst on its way to the disk.
struct Taken {
    step: Step,
    channels: [Vec<Sample>; 2],
}

/// Capture a plan into the recording `path`, until the plan is complete or `stop` is set.
///
/// # Errors
/// If the capture cannot begin: the plan does not fit the radio, or the recording cannot be created. Later errors are
/// in [`Summary::ended`], and the recording holds the data up to then.
pub fn capture(
    radio: &mut dyn Transceiver,
    plan: &Plan,
    path: &Path,
    queues: Queues,
    live: Option<&SyncSender<LiveStep>>,
    stop: &AtomicBool,
) -> Result<Summary, CaptureError> {
    let ready = prepare(radio, plan)?;
    capture_ready(radio, plan, ready, path, queues, live, stop)
}

/// Check a plan against a radio and apply the plan's settings.
///
/// # Errors
/// If the plan does not fit the radio, or a setting cannot be applied.
pub fn prepare(radio: &mut dyn Transceiver, plan: &Plan) -> Result<Ready, RadioError> {
    plan.check(&radio.about().ranges)?;
    let set = radio.configure(&plan.radio)?;
    let setup = setup(radio.about(), plan, &set);
    Ok(Ready { set, setup })
}

/// Capture like [`capture`], with a radio already set by [`prepare`]; for callers that need the settings in effect
/// first.
///
/// # Errors
/// If the recording cannot be created.
pub fn capture_ready(
    radio: &mut dyn Transceiver,
    plan: &Plan,
    Ready { set, setup }: Ready,
    path: &Path,
    queues: Queues,
    live: Option<&SyncSender<LiveStep>>,
    stop: &AtomicBool,
) -> Result<Summary, CaptureError> {
    let writer = Writer::create(path, setup.clone())?;
    let depth = queues.disk.max(1);
    let waiting = AtomicUsize::new(0);
    thread::scope(|scope| {
        let (full_tx, full_rx) = sync_channel::<Taken>(depth);
        let (empty_tx, empty_rx) = channel::<[Vec<Sample>; 2]>();
        // Two buffers beyond the queue's depth: one held by the radio, one held by the disk thread.
        for _ in 0..depth + 2 {
            let buffer = || vec![Sample::ZERO; plan.samples()];
            let _ = empty_tx.send([buffer(), buffer()]);
        }
        let taken = &waiting;
        // The engine owns its ends of both queues, so that each side sees the other end.
        let disk = thread::Builder::new()
            .name("disk".to_owned())
            .spawn_scoped(scope, move || write(writer, &full_rx, &empty_tx, taken));
        let disk = disk.map_err(|source| {
            // The new recording is still empty.
            discard(path);
            CaptureError::Thread(source)
        })?;
        let tone = Tone::new(setup.period, setup.sample_rate_hz);
        let mut engine = Engine {
            waveform: tone.waveform(plan.amplitude),
            tone,
            setup: &setup,
            radio,
            plan,
            live,
            full: full_tx,
            empty: empty_rx,
            waiting: &waiting,
            depth,
            taken: 0,
            events: Vec::new(),
            summary: Summary {
                ended: EndReason::Done,
                steps: 0,
                flagged: [0; 5],
                bursts: 0,
                events: [0; 5],
                lost_samples: 0,
                waits: 0,
                longest_queue: 0,
                not_shown: 0,
                late_sweeps: 0,
                set,
            },
        };
        let ended = engine.sweeps(stop);
        engine.count_events();
        let Engine {
            mut summary,
            full,
            empty,
            ..
        } = engine;
        drop((full, empty));
        let (steps, disk) = disk
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        summary.steps = steps;
        summary.ended = match (disk, ended) {
            (Err(error), _) => EndReason::Disk(error),
            (Ok(()), Err(error)) => EndReason::Radio(error),
            (Ok(()), Ok(ended)) => ended,
        };
        Ok(summary)
    })
}

/// Recording parameters from the plan and the settings in effect.
pub fn setup(about: &About, plan: &Plan, set: &Configuration) -> Setup {
    Setup {
        name: plan.name.clone(),
        hardware: format!("{} {}", about.product, about.serial),
        sample_rate_hz: set.sample_rate_hz,
        period: plan.period(),
        samples: plan.samples(),
        start_hz: plan.start_hz,
        step_hz: plan.step_hz(),
        steps: plan.steps,
        transmit_gain_db: set.transmit_gain_db,
        receive_gain_db: set.receive_gain_db,
        receive_antennas: set.receive_antennas.clone(),
        reference: plan.reference,
        antennas: plan.antennas,
        reach_m: None,
    }
}

/// Reason why a capture could not begin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// Error of the radio, or of the plan for it.
    #[error(transparent)]
    Radio(#[from] RadioError),
    /// Error of the recording.
    #[error(transparent)]
    Disk(#[from] SigmfError),
    /// The operating system refused a thread.
    #[error("cannot start the disk thread: {0}; end other programs, or raise the limit on threads")]
    Thread(std::io::Error),
}

/// Disk thread: write queued steps, and return their number and the result. After an error it stops reading the queue,
/// which the radio thread detects.
fn write(
    mut writer: Writer,
    full: &Receiver<Taken>,
    empty: &Sender<[Vec<Sample>; 2]>,
    waiting: &AtomicUsize,
) -> (u64, Result<(), SigmfError>) {
    let mut steps = 0;
    let mut failed = None;
    for Taken { step, channels } in full {
        waiting.fetch_sub(1, Ordering::Relaxed);
        if let Err(error) = writer.append(step, [&channels[0], &channels[1]]) {
            failed = Some(error);
            break;
        }
        steps += 1;
        // The send fails if the radio thread has ended; the buffer is then dropped.
        let _ = empty.send(channels);
    }
    let finished = writer.finish();
    (steps, failed.map_or(finished, Err))
}

struct Engine<'a> {
    tone: Tone,
    waveform: Vec<Complex32>,
    setup: &'a Setup,
    radio: &'a mut dyn Transceiver,
    plan: &'a Plan,
    live: Option<&'a SyncSender<LiveStep>>,
    full: SyncSender<Taken>,
    empty: Receiver<[Vec<Sample>; 2]>,
    /// Bursts in the queue to the disk.
    waiting: &'a AtomicUsize,
    depth: usize,
    /// Steps handed to the disk.
    taken: u64,
    events: Vec<Event>,
    summary: Summary,
}

impl Engine<'_> {
    fn sweeps(&mut self, stop: &AtomicBool) -> Result<EndReason, RadioError> {
        let mut due_s = None;
        let mut sweep = 0;
        while self.plan.sweeps == 0 || sweep < self.plan.sweeps {
            for (index, step) in self.plan.carriers(sweep).into_iter().enumerate() {
                if stop.load(Ordering::Relaxed) {
                    return Ok(EndReason::Stopped);
                }
                let due = due_s.filter(|_| index == 0);
                let Some(began_s) = self.step(sweep, step, due)? else {
                    // The disk has failed; its thread returns the error.
                    return Ok(EndReason::Stopped);
                };
                if index == 0 {
                    if due.is_some_and(|due_s| began_s > due_s) {
                        self.summary.late_sweeps += 1;
                    }
                    due_s = (self.plan.pri_s > 0.0).then_some(began_s + self.plan.pri_s);
                }
            }
            sweep += 1;
        }
        Ok(EndReason::Done)
    }

    /// Capture one step, beginning at `due_s` if given, and return the time of its first burst; `None` if the disk
    /// thread has ended.
    fn step(
        &mut self,
        sweep: u64,
        step: usize,
        due_s: Option<f64>,
    ) -> Result<Option<f64>, RadioError> {
        let carrier_hz = self.tune(self.plan.carrier_hz(step))?;
        let sensors = self.radio.sensors()?;
        // There are as many buffers as fit the queue and both threads: this waits only while the disk is slow.
        let Ok(mut channels) = self.empty.recv() else {
            return Ok(None);
        };
        let mut began_s = None;
        let mut bursts = 0;
        let (received, mixed) = loop {
            let soon_s = self.radio.now_s()? + self.plan.lead_s;
            let at_s = due_s
                .filter(|_| bursts == 0)
                .map_or(soon_s, |due_s| due_s.max(soon_s));
            let burst = Burst {
                waveform: &self.waveform,
                at_s,
            };
            let [reference, echo] = &mut channels;
            let received = self.radio.burst(&burst, [reference, echo])?;
            began_s.get_or_insert(at_s);
            bursts += 1;
            let mixed = self.tone.mix([&channels[0], &channels[1]], &received.lost);
            let steady = mixed.is_none_or(|mixed| mixed.unsteady <= self.plan.steady);
            if steady || bursts >= self.plan.bursts {
                break (received, mixed);
            }
        };
        self.count_events();
        self.summary.bursts += u64::from(bursts);
        let mut taken = Step {
            sweep,
            step,
            bursts,
            ..Step::received(self.setup, &received, channels[0].len(), carrier_hz)
        };
        let others = [
            (
                Flag::Unsteady,
                mixed.is_some_and(|mixed| mixed.unsteady > self.plan.steady),
            ),
            (
                Flag::Unlocked,
                !(sensors.transmit_locked && sensors.receive_locked),
            ),
        ];
        let others = others.into_iter().filter(|(_, is)| *is);
        taken.flags.extend(others.map(|(flag, _)| flag));
        self.count(&taken);
        self.show(&taken, mixed, &channels, received.clipped);
        let taken = Taken {
            step: taken,
            channels,
        };
        Ok(self.hand_over(taken).and(began_s))
    }

    /// Send a step to the live view, if there is one and its queue has room, or the radio waits until it has.
    fn show(
        &mut self,
        step: &Step,
        mixed: Option<Mixed>,
        channels: &[Vec<Sample>; 2],
        clipped: [u32; 2],
    ) {
        let Some(live) = self.live else { return };
        let lost: Vec<_> = step.lost.iter().map(|&(from, to)| from..to).collect();
        let shown = LiveStep {
            sweep: step.sweep,
            step: step.step,
            time_s: step.time_s,
            mixed,
            levels: std::array::from_fn(|c| Level::of(&channels[c], &lost, clipped[c])),
            flagged: Flag::ALL.map(|flag| step.flags.contains(&flag)),
            counts: self.counts(),
        };
        let taken = match self.radio.waits() {
            true => live.send(shown).is_ok(),
            false => live.try_send(shown).is_ok(),
        };
        if !taken {
            self.summary.not_shown += 1;
        }
    }

    /// Counters of the live view, including the current step.
    fn counts(&self) -> Counts {
        let so_far = &self.summary;
        Counts {
            steps: self.taken + 1,
            flagged: so_far.flagged,
            bursts: so_far.bursts,
            events: so_far.events,
            lost_samples: so_far.lost_samples,
            waits: so_far.waits,
            queue: self.waiting.load(Ordering::Relaxed).min(self.depth),
            queue_holds: self.depth,
            not_shown: so_far.not_shown,
            late_sweeps: so_far.late_sweeps,
        }
    }

    /// Tune both sides, and return the transmit carrier, to which the tone and the response refer.
    fn tune(&mut self, asked_hz: f64) -> Result<f64, RadioError> {
        let sent_hz = self.radio.tune(Side::Transmit, asked_hz, None)?;
        let received_hz = self.radio.tune(Side::Receive, asked_hz, None)?;
        let most_hz = OFF_CARRIER * self.setup.step_hz;
        for (whom, tuned_hz) in [("transmitter", sent_hz), ("receivers", received_hz)] {
            if (tuned_hz - asked_hz).abs() > most_hz {
                return Err(RadioError::Unsupported(format!(
                    "cannot tune the {whom} to {asked_hz} Hz: nearest is {tuned_hz} Hz, more than {most_hz} Hz off. Choose start and stop frequencies \
                     that the synthesisers can step between"
                )));
            }
        }
        Ok(sent_hz)
    }

    /// Count the flags and lost samples of a step.
    fn count(&mut self, step: &Step) {
        for flag in &step.flags {
            self.summary.flagged[*flag as usize] += 1;
        }
        let lost = step.lost.iter().map(|gap| (gap.1 - gap.0) as u64);
        self.summary.lost_samples += lost.sum::<u64>();
    }

    /// Hand a burst to the disk; `None` if the disk thread has ended.
    fn hand_over(&mut self, taken: Taken) -> Option<()> {
        // Counted before the send, so that the disk thread never counts below zero.
        let waiting = self.waiting.fetch_add(1, Ordering::Relaxed) + 1;
        match self.full.try_send(taken) {
            Ok(()) => {}
            Err(TrySendError::Full(taken)) => {
                self.summary.waits += 1;
                self.full.send(taken).ok()?;
            }
            Err(TrySendError::Disconnected(_)) => return None,
        }
        self.taken += 1;
        self.summary.longest_queue = self.summary.longest_queue.max(waiting.min(self.depth));
        Some(())
    }

    fn count_events(&mut self) {
        self.radio.events(&mut self.events);
        for event in self.events.drain(..) {
            let index = match event.kind {
                EventKind::Overflow => 0,
                EventKind::Underflow => 1,
                EventKind::LateCommand => 2,
                EventKind::LostPacket => 3,
                EventKind::Gone => 4,
            };
            self.summary.events[index] += u64::from(event.count);
        }
    }
}
