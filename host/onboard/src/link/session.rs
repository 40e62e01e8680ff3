//! A session with a module: the input and output of a [`Conversation`].
//!
//! **What it does.** [`Session::open`] greets a module and learns who it is; [`Session::transfer`] has it do
//! a [`Job`]. Both are led by the state machine of [`super::conversation`], which says at every step what is
//! to be done: exchange bytes, send a pulse, connect anew. Whatever comes is taken in one place, between any
//! two steps.
//!
//! **Errors**: [`LinkError`] where no module answers or it refuses; once it has answered,
//! [`Outcome::ending`] says how the transfer ended, and the maps taken so far are good.

use std::time::{Duration, Instant};

use subaperture_core::link::{Command, LinkCounters, Receiver, Report, max_received_bytes};

use super::conversation::{Conversation, Event, Ledger, Step, TICK, Told};
use super::counts::{Counts, growth};
use super::ending::{Ending, LinkError, Outcome};
use super::identity::{Identity, shown};
use super::intake::{Intake, MapSink, Nowhere};
use super::job::{Job, PulseSource, Wanted};
use super::line::{Line, MOST_SAMPLES};
use super::settings::Settings;
use super::transport::Transport;

/// Watches a session.
pub trait Watch {
    /// Where it stands; many times a second.
    fn update(&mut self, counts: &Counts) {
        let _ = counts;
    }

    /// A line of the module's log, or of the session's own; without control characters.
    fn log(&mut self, text: &str) {
        let _ = text;
    }

    /// Whether to stop as soon as possible.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Says nothing, never stops.
impl Watch for subaperture_model::monitor::Silent {}

/// Memory for what comes, lent to a session.
pub struct Buffers {
    received: Vec<u8>,
}

impl Buffers {
    /// For frames of any length that a module may send.
    pub fn new() -> Self {
        Self {
            received: vec![0; max_received_bytes(MOST_SAMPLES)],
        }
    }
}

impl Default for Buffers {
    fn default() -> Self {
        Self::new()
    }
}

/// The way to a module, and the time since it was opened.
pub(super) struct Way<'b> {
    pub(super) line: Line<'b>,
    pub(super) receiver: Receiver<'b>,
    opened: Instant,
}

/// A conversation with a module.
pub struct Session<'b> {
    pub(super) way: Way<'b>,
    pub(super) ledger: Ledger,
    identity: Identity,
}

impl<'b> Session<'b> {
    /// Greets the module at the other end.
    ///
    /// # Errors
    /// [`LinkError`] if none answers.
    pub fn open(
        transport: &'b mut dyn Transport,
        buffers: &'b mut Buffers,
        settings: Settings,
        watch: &mut dyn Watch,
    ) -> Result<Self, LinkError> {
        let mut way = Way {
            line: Line::new(transport),
            receiver: Receiver::new(&mut buffers.received),
            opened: Instant::now(),
        };
        let mut ledger = Ledger::new(settings);
        let mut nowhere = Nowhere;
        let intake = Intake::new(Wanted::nothing(), &mut [], &mut nowhere);
        let mut conversation = Conversation::new(&mut ledger, Told::nothing(), intake, None);
        way.lead(&mut conversation, None, watch)?;
        let identity = conversation.identity().cloned().ok_or(LinkError::Silent)?;
        Ok(Self {
            way,
            ledger,
            identity,
        })
    }

    /// Who answered.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// What has been done so far.
    pub fn counts(&self) -> Counts {
        self.way.counts(&self.ledger)
    }

    /// Has the module do `job`. Maps go to `sink` as they come; however it ends, those are good.
    pub fn transfer(
        &mut self,
        job: &mut Job<'_>,
        sink: &mut dyn MapSink,
        watch: &mut dyn Watch,
    ) -> Outcome {
        let wanted = job.wanted();
        self.ledger.counts.pulses = job.pulses.len().into();
        self.ledger.counts.maps_wanted = wanted.num_maps();
        let mut buffer = vec![0; Intake::room_bytes(&wanted)];
        let told = Told {
            setup: job.setup,
            fast_weights: &job.fast_weights,
            patches: &job.patches,
        };
        let mut conversation = Conversation::new(
            &mut self.ledger,
            told,
            Intake::new(wanted, &mut buffer, sink),
            Some(self.identity.clone()),
        );
        let led = self
            .way
            .lead(&mut conversation, Some(&mut job.pulses), watch);
        if conversation.is_in_run() {
            self.way.abort(conversation.ledger.settings.answer);
        }
        let missing = conversation.missing_maps();
        self.ledger.counts.samples_clamped = job.pulses.clamped();
        Outcome {
            counts: self.counts(),
            ending: match led {
                Ok(()) if missing.is_empty() => Ending::Complete,
                Ok(()) => Ending::Incomplete,
                Err(error) => Ending::Failed(error),
            },
            missing,
        }
    }
}

impl Way<'_> {
    /// Does for a conversation what it says, until it is over.
    fn lead(
        &mut self,
        conversation: &mut Conversation<'_>,
        mut pulses: Option<&mut PulseSource<'_>>,
        watch: &mut dyn Watch,
    ) -> Result<(), LinkError> {
        let mut event = Event::Begun;
        loop {
            let step = conversation.step(event, Instant::now(), &mut self.line.outbox);
            let done = match step {
                Step::Exchange(wait) => self.exchange(wait, conversation, watch),
                Step::Pulse(number) => self.send(number, pulses.as_deref_mut()),
                Step::Anew(error) => {
                    let answer = conversation.ledger.settings.answer;
                    self.begin_anew(&error, answer, watch)
                }
                Step::Over(ending) => return ending,
            };
            event = done.unwrap_or_else(Event::Failed);
        }
    }

    /// Writes and reads once, waiting up to `wait`; everything that came is heard.
    fn exchange(
        &mut self,
        wait: Duration,
        conversation: &mut Conversation<'_>,
        watch: &mut dyn Watch,
    ) -> Result<Event, LinkError> {
        if watch.cancelled() {
            return Err(LinkError::Cancelled);
        }
        let mut bytes = self.line.exchange(wait)?;
        while let Some(frame) = self.receiver.receive::<Report<'_>>(&mut bytes) {
            match frame {
                Ok(received) => {
                    if let Report::Log { text } = received.message {
                        watch.log(&shown(text));
                    }
                    conversation.hear(&received.message)?;
                }
                Err(damage) => conversation.mishear(&damage),
            }
        }
        watch.update(&self.counts(conversation.ledger));
        Ok(Event::Exchanged)
    }

    /// Puts a pulse on the line.
    fn send(
        &mut self,
        number: u32,
        pulses: Option<&mut PulseSource<'_>>,
    ) -> Result<Event, LinkError> {
        if let Some(pulses) = pulses {
            let encoding = pulses.encoding();
            let (pulse, samples) = pulses.pulse(number)?;
            self.line.outbox.send(&Command::Pulse {
                pulse,
                encoding,
                samples,
            });
        }
        Ok(Event::Sent)
    }

    /// Connects anew, unless it is the module that began anew.
    fn begin_anew(
        &mut self,
        because: &LinkError,
        answer: Duration,
        watch: &mut dyn Watch,
    ) -> Result<Event, LinkError> {
        watch.log(&format!("{because}: beginning anew"));
        if !matches!(because, LinkError::Restarted)
            && let Err(failure) = self.line.reconnect()
        {
            // It may be on its way back.
            let started = Instant::now();
            while started.elapsed() < answer {
                if watch.cancelled() {
                    return Err(LinkError::Cancelled);
                }
                std::thread::sleep(TICK.min(answer));
            }
            return Err(failure.into());
        }
        Ok(Event::Connected)
    }

    /// Tells the module to end its run. It may well not hear it; then the next session does the same.
    pub(super) fn abort(&mut self, patience: Duration) {
        self.line.outbox.send(&Command::Abort);
        let started = Instant::now();
        while self.line.outbox.backlog() > 0 && started.elapsed() < patience {
            // Whether or not the user wants to stop.
            if self.line.exchange(TICK).is_err() {
                break;
            }
        }
    }

    /// What has been done so far.
    fn counts(&self, ledger: &Ledger) -> Counts {
        Counts {
            seconds: self.opened.elapsed().as_secs_f64(),
            bytes_to_module: self.line.bytes_out,
            bytes_from_module: self.line.bytes_in,
            frames_from_module: growth(&LinkCounters::default(), self.receiver.counters()),
            ..ledger.counts
        }
    }
}
