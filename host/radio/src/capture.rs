//! The capture: from a plan and a radio to a recording.
//!
//! ```text
//! radio (this thread): tune, tune, burst until the reference is steady ──queue──> disk (thread): sigmf::Writer
//!                                                      └─────────queue (try)────> live: a number a step, levels, counts
//! ```
//!
//! Rules:
//! - A burst whose reference is not steady ([`crate::tone`]) is taken again, up to the plan's `bursts` times; the last is kept, marked
//!   [`Flag::Unsteady`] if it still is not. So how long a step settles is decided by its data alone.
//! - A late burst, lost samples and full scale are marked and kept, with which samples are none; nothing is taken again for them, so that a sweep
//!   keeps its pace. What a profile makes of such steps is [`crate::profile`]'s rule.
//! - The queue to the disk is bounded; where it is full, the radio waits, before the next burst is asked for: no sample is lost, sweeps take
//!   longer, and it is counted ([`Summary::waits`]). The queue to the live view is bounded and never waited for: what does not fit is not
//!   shown, and counted.
//! - A step's carrier is the one that the radio says it has tuned to; a radio that cannot come within a thousandth of a step of the plan's is refused.
//! - A radio that goes away, a full disk and a stop end the capture; what is recorded by then is closed as always.
//!
//! Memory: the queue's buffers of two bursts each and the plan; nothing grows. Cost beside the radio's: the mixing of each burst, a
//! copy to bytes, and writing.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, TrySendError, channel, sync_channel};
use std::thread;

use num_complex::Complex32;

use crate::error::RadioError;
use crate::live::{Counts, Level};
use crate::plan::Plan;
use crate::sigmf::{Flag, Setup, SigmfError, Step, Writer};
use crate::tone::{Mixed, Tone};
use crate::transceiver::{
    About, Burst, Configuration, Event, EventKind, Sample, Side, Transceiver,
};

/// Most that a carrier may be off the plan's, of a step. Profiles take carriers as evenly spaced: at the farthest range this turns
/// one's phase by `2 pi` of it, -44 dB of its echo.
const OFF_CARRIER: f64 = 1e-3;

pub use crate::live::LiveStep;

/// How a capture is kept in bounds.
#[derive(Clone, Copy, Debug)]
pub struct Queues {
    /// Bursts between radio and disk.
    pub disk: usize,
}

impl Queues {
    /// As many bursts of a plan as fit so many bytes with those in both hands, and no more than by default.
    pub fn within(plan: &Plan, bytes: u64) -> Self {
        let burst_bytes = 8 * plan.samples() as u64;
        let fit = (bytes / burst_bytes.max(1)).saturating_sub(2);
        Self {
            disk: fit.clamp(1, Self::default().disk as u64) as usize,
        }
    }
}

impl Default for Queues {
    /// 64 bursts: two seconds of writing that hangs, at 30 ms a step.
    fn default() -> Self {
        Self { disk: 64 }
    }
}

/// Why a capture ended.
#[derive(Debug)]
pub enum Ended {
    /// All sweeps are done.
    Done,
    /// It was asked to stop.
    Stopped,
    /// The radio failed.
    Radio(RadioError),
    /// The disk failed.
    Disk(SigmfError),
}

/// What was captured.
#[derive(Debug)]
pub struct Summary {
    /// Why it ended.
    pub ended: Ended,
    /// Steps recorded.
    pub steps: u64,
    /// Of them late, with lost samples, unsteady, clipped, unlocked.
    pub flagged: [u64; 5],
    /// Bursts asked for.
    pub bursts: u64,
    /// Events by kind, in the order of [`EventKind`]: overflows, underflows, late commands, lost packets, gone.
    pub events: [u64; 5],
    /// Samples of a channel that did not come.
    pub lost_samples: u64,
    /// How often the radio waited for the disk.
    pub waits: u64,
    /// Most bursts that were in the queue to the disk.
    pub longest_queue: usize,
    /// Steps that the live view did not get.
    pub not_shown: u64,
    /// Sweeps that began later than the plan's interval.
    pub late_sweeps: u64,
    /// What the radio was set to.
    pub set: Configuration,
}

/// What a radio was set to for a plan.
#[derive(Clone, Debug)]
pub struct Ready {
    /// By the device.
    pub set: Configuration,
    /// What holds for all of the recording.
    pub setup: Setup,
}

/// A burst on its way to the disk, or an empty one on its way back.
struct Taken {
    step: Step,
    channels: [Vec<Sample>; 2],
}

/// Captures a plan to the recording `path`, until it is done or `stop` is set.
///
/// # Errors
/// If it cannot begin: the plan does not fit the radio, the recording cannot be made. Once it has begun, [`Summary::ended`] says how it
/// ended, and the recording holds what came until then.
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

/// Sets a radio as the plan has it.
///
/// # Errors
/// If the plan does not fit the radio, or that cannot be set.
pub fn prepare(radio: &mut dyn Transceiver, plan: &Plan) -> Result<Ready, RadioError> {
    plan.check(&radio.about().ranges)?;
    let set = radio.configure(&plan.radio)?;
    let setup = setup(radio.about(), plan, &set);
    Ok(Ready { set, setup })
}

/// [`capture`], of a radio that [`prepare`] has set: for those who have to know what was set before it begins.
///
/// # Errors
/// If the recording cannot be made.
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
        // One more than fit the queue, for the radio's own hands, and one for the disk's.
        for _ in 0..depth + 2 {
            let buffer = || vec![Sample::ZERO; plan.samples()];
            let _ = empty_tx.send([buffer(), buffer()]);
        }
        let taken = &waiting;
        // Its ends of both queues go with it, so that each side sees the other end.
        let disk = scope.spawn(move || write(writer, &full_rx, &empty_tx, taken));
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
                ended: Ended::Done,
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
            (Err(error), _) => Ended::Disk(error),
            (Ok(()), Err(error)) => Ended::Radio(error),
            (Ok(()), Ok(ended)) => ended,
        };
        Ok(summary)
    })
}

/// What holds for all of a capture: the plan, and what the radio was set to.
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
    }
}

/// Why a capture could not begin.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The radio, or the plan for it.
    #[error(transparent)]
    Radio(#[from] RadioError),
    /// The recording.
    #[error(transparent)]
    Disk(#[from] SigmfError),
}

/// The disk's thread: steps written, and how that ended. After an error it takes no more, which the radio sees.
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
        // Nobody takes it where the radio has ended.
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
    /// Steps handed to it.
    taken: u64,
    events: Vec<Event>,
    summary: Summary,
}

impl Engine<'_> {
    fn sweeps(&mut self, stop: &AtomicBool) -> Result<Ended, RadioError> {
        let mut due_s = None;
        let mut sweep = 0;
        while self.plan.sweeps == 0 || sweep < self.plan.sweeps {
            for (index, step) in self.plan.carriers(sweep).into_iter().enumerate() {
                if stop.load(Ordering::Relaxed) {
                    return Ok(Ended::Stopped);
                }
                let due = due_s.filter(|_| index == 0);
                let Some(began_s) = self.step(sweep, step, due)? else {
                    // The disk has failed; it will say how.
                    return Ok(Ended::Stopped);
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
        Ok(Ended::Done)
    }

    /// A step; the time of its first burst, `None` if the disk takes no more. `due_s` is when it is to begin.
    fn step(
        &mut self,
        sweep: u64,
        step: usize,
        due_s: Option<f64>,
    ) -> Result<Option<f64>, RadioError> {
        let carrier_hz = self.tune(self.plan.carrier_hz(step))?;
        let sensors = self.radio.sensors()?;
        // As many buffers as fit the queue and both hands: none is waited for but while the disk is slow.
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

    /// Tells the live view of a step, if there is one and it has room.
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
        if live.try_send(shown).is_err() {
            self.summary.not_shown += 1;
        }
    }

    /// What has been counted, with the step that is at hand.
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

    /// Tunes both sides; the carrier that is sent, of which the tone and so the response are.
    fn tune(&mut self, asked_hz: f64) -> Result<f64, RadioError> {
        let sent_hz = self.radio.tune(Side::Transmit, asked_hz, None)?;
        let received_hz = self.radio.tune(Side::Receive, asked_hz, None)?;
        let most_hz = OFF_CARRIER * self.setup.step_hz;
        for (whom, tuned_hz) in [("transmitter", sent_hz), ("receivers", received_hz)] {
            if (tuned_hz - asked_hz).abs() > most_hz {
                return Err(RadioError::Unsupported(format!(
                    "a carrier of {asked_hz} Hz: its {whom} tune to {tuned_hz} Hz, more than {most_hz} Hz off. Choose a start and a stop \
                     that its synthesisers can step between"
                )));
            }
        }
        Ok(sent_hz)
    }

    /// Counts what is wrong with a step.
    fn count(&mut self, step: &Step) {
        for flag in &step.flags {
            self.summary.flagged[*flag as usize] += 1;
        }
        let lost = step.lost.iter().map(|gap| (gap.1 - gap.0) as u64);
        self.summary.lost_samples += lost.sum::<u64>();
    }

    /// Hands a burst to the disk; `None` if that takes no more.
    fn hand_over(&mut self, taken: Taken) -> Option<()> {
        // Counted before it is sent, so that the disk's thread never counts below zero.
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
