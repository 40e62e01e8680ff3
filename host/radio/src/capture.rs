//! The capture: from a plan and a radio to a recording.
//!
//! ```text
//! radio (this thread): tune, tune, burst until the reference is steady ──queue──> disk (thread): sigmf::Writer
//!                                                      └─────────queue (try)────> live: a number a step
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
//! - A radio that goes away, a full disk and a stop end the capture; what is recorded by then is closed as always.
//!
//! Memory: the queue's buffers of two bursts each and the plan; nothing grows. Cost beside the radio's: the mixing of each burst, a
//! copy to bytes, and writing.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, TrySendError, channel, sync_channel};
use std::thread;

use num_complex::{Complex32, Complex64};

use crate::error::RadioError;
use crate::plan::Plan;
use crate::sigmf::{Flag, Setup, SigmfError, Step, Writer};
use crate::tone::Tone;
use crate::transceiver::{
    Burst, Configuration, Event, EventKind, Received, Sample, Side, Transceiver,
};

/// How a capture is kept in bounds.
#[derive(Clone, Copy, Debug)]
pub struct Queues {
    /// Bursts between radio and disk.
    pub disk: usize,
}

impl Default for Queues {
    /// 64 bursts: two seconds of writing that hangs, at 30 ms a step.
    fn default() -> Self {
        Self { disk: 64 }
    }
}

/// A step as the live view gets it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveStep {
    /// Index of the sweep.
    pub sweep: u64,
    /// Index of the carrier.
    pub step: usize,
    /// Echo over reference; `None` if nothing of it came.
    pub value: Option<Complex64>,
    /// RMS of the reference, of full scale.
    pub reference: f64,
    /// Whether anything is wrong with it.
    pub marked: bool,
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
    plan.check(&radio.about().ranges)?;
    let set = radio.configure(&plan.radio)?;
    let about = radio.about();
    let setup = Setup {
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
    };
    let writer = Writer::create(path, setup)?;
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
        let mut engine = Engine {
            tone: Tone::new(plan.period()),
            waveform: Tone::new(plan.period()).waveform(plan.amplitude),
            radio,
            plan,
            live,
            full: full_tx,
            empty: empty_rx,
            waiting: &waiting,
            depth,
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
    radio: &'a mut dyn Transceiver,
    plan: &'a Plan,
    live: Option<&'a SyncSender<LiveStep>>,
    full: SyncSender<Taken>,
    empty: Receiver<[Vec<Sample>; 2]>,
    /// Bursts in the queue to the disk.
    waiting: &'a AtomicUsize,
    depth: usize,
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
        let carrier_hz = self.plan.carrier_hz(step);
        self.radio.tune(Side::Transmit, carrier_hz, None)?;
        self.radio.tune(Side::Receive, carrier_hz, None)?;
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
        let unsteady = mixed.is_some_and(|mixed| mixed.unsteady > self.plan.steady);
        let unlocked = !(sensors.transmit_locked && sensors.receive_locked);
        let flags = self.flags(&received, unsteady, unlocked);
        if let Some(live) = self.live {
            let shown = LiveStep {
                sweep,
                step,
                value: mixed.map(|mixed| mixed.value),
                reference: mixed.map_or(0.0, |mixed| mixed.reference),
                marked: !flags.is_empty(),
            };
            if let Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) = live.try_send(shown)
            {
                self.summary.not_shown += 1;
            }
        }
        let half_hz = 0.5 * self.plan.step_hz();
        let step = Step {
            start: 0,
            samples: channels[0].len(),
            lower_hz: carrier_hz - half_hz,
            upper_hz: carrier_hz + half_hz,
            carrier_hz,
            sweep,
            step,
            time_s: received.first_s,
            gain_db: self.summary.set.receive_gain_db,
            bursts,
            flags,
            lost: received
                .lost
                .iter()
                .map(|gap| (gap.start, gap.end))
                .collect(),
        };
        Ok(self.hand_over(Taken { step, channels }).and(began_s))
    }

    fn flags(&mut self, received: &Received, unsteady: bool, unlocked: bool) -> Vec<Flag> {
        let lost: usize = received.lost.iter().map(ExactSizeIterator::len).sum();
        self.summary.lost_samples += lost as u64;
        let all = [
            (Flag::Late, received.late),
            (Flag::Lost, lost > 0 && !received.late),
            (Flag::Unsteady, unsteady),
            (Flag::Clipped, received.clipped != [0; 2]),
            (Flag::Unlocked, unlocked),
        ];
        for (count, (_, is)) in self.summary.flagged.iter_mut().zip(all) {
            *count += u64::from(is);
        }
        all.into_iter()
            .filter(|(_, is)| *is)
            .map(|(flag, _)| flag)
            .collect()
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
