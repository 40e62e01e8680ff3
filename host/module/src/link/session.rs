//! Session with a module: input and output of a [`Conversation`].
//!
//! [`Session::open`] greets a module and obtains its identity; [`Session::transfer`], [`Session::detect`] and
//! [`Session::accumulate`] run a [`Job`] on it. All are controlled by the state machine of [`super::conversation`], which returns the next action at every step: exchange bytes, send a pulse,
//! or reconnect. Received data is processed in one place, between any two steps.
//!
//! **Errors**: [`LinkError`] if no module answers or it refuses. Once it has answered, [`Outcome::ending`] states how the
//! transfer ended, and the maps received so far are valid.

use std::time::{Duration, Instant};

use subaperture_core::link::{
    Command, Event as ModuleEvent, LinkCounters, Receiver, Report, max_received_bytes,
};

use super::conversation::{Conversation, Event, JobSettings, Ledger, Step, TICK};
use super::counts::{Counts, growth};
use super::ending::{LinkError, Outcome, TransferEnd};
use super::identity::Identity;
use super::intake::Intake;
use super::job::{Job, PulseSource, Wanted};
use super::line::{Line, MAX_SAMPLES};
use super::products::{
    AccumulatedImage, DetectionSink, Detector, DiscardMaps, ImageRequest, MapSink, Products,
};
use super::settings::Settings;
use super::transport::Transport;

/// Observer of a session.
pub trait SessionObserver {
    /// Progress report, many times per second.
    fn update(&mut self, counts: &Counts) {
        let _ = counts;
    }

    /// Event of the module, if [`Settings::events`] requests its level.
    fn event(&mut self, event: &ModuleEvent) {
        let _ = event;
    }

    /// Image of the sub-CPIs that the module has accumulated so far, if [`ImageRequest::previews`] requests it.
    fn preview(&mut self, image: &AccumulatedImage) {
        let _ = image;
    }

    /// Message of the session.
    fn log(&mut self, text: &str) {
        let _ = text;
    }

    /// Whether to stop as soon as possible.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Silent observer that never cancels.
impl SessionObserver for subaperture_model::monitor::Silent {}

/// Receive buffers lent to a session.
pub struct Buffers {
    received: Vec<u8>,
}

impl Buffers {
    /// Create buffers for the longest frames that a module can send.
    pub fn new() -> Self {
        Self {
            received: vec![0; max_received_bytes(MAX_SAMPLES)],
        }
    }
}

impl Default for Buffers {
    fn default() -> Self {
        Self::new()
    }
}

/// Line to a module with its receiver, and the time since it was opened.
pub(super) struct Connection<'b> {
    pub(super) line: Line<'b>,
    pub(super) receiver: Receiver<'b>,
    opened: Instant,
}

/// Observer of the end of a cancelled transfer, which has a time limit of its own.
struct Ending<'w> {
    watch: &'w mut dyn SessionObserver,
    until: Instant,
}

impl SessionObserver for Ending<'_> {
    fn update(&mut self, counts: &Counts) {
        self.watch.update(counts);
    }

    fn event(&mut self, event: &ModuleEvent) {
        self.watch.event(event);
    }

    fn log(&mut self, text: &str) {
        self.watch.log(text);
    }

    fn cancelled(&self) -> bool {
        Instant::now() >= self.until
    }
}

/// Session with a module.
pub struct Session<'b> {
    pub(super) connection: Connection<'b>,
    pub(super) ledger: Ledger,
    identity: Identity,
}

impl<'b> Session<'b> {
    /// Greet the module at the other end.
    ///
    /// # Errors
    /// [`LinkError`] if no module answers.
    pub fn open(
        transport: &'b mut dyn Transport,
        buffers: &'b mut Buffers,
        settings: Settings,
        watch: &mut dyn SessionObserver,
    ) -> Result<Self, LinkError> {
        let mut connection = Connection {
            line: Line::new(transport),
            receiver: Receiver::new(&mut buffers.received),
            opened: Instant::now(),
        };
        let mut ledger = Ledger::new(settings);
        let mut nowhere = DiscardMaps;
        let intake = Intake::new(Wanted::empty(), &mut [], Products::Maps(&mut nowhere));
        let mut conversation = Conversation::new(&mut ledger, JobSettings::empty(), intake, None);
        connection.lead(&mut conversation, None, watch)?;
        let identity = conversation.identity().cloned().ok_or(LinkError::Silent)?;
        Ok(Self {
            connection,
            ledger,
            identity,
        })
    }

    /// Identity of the module.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Statistics so far.
    pub fn counts(&self) -> Counts {
        self.connection.counts(&self.ledger)
    }

    /// Form the maps of `job` on the module. Maps are passed to `sink` as they arrive and are valid however the transfer ends.
    pub fn transfer(
        &mut self,
        job: &mut Job<'_>,
        sink: &mut dyn MapSink,
        watch: &mut dyn SessionObserver,
    ) -> Outcome {
        self.conduct(job, Products::Maps(sink), watch)
    }

    /// Detect targets on the maps of `job`, which are not sent. Detections are passed to `sink` as they arrive and are valid
    /// however the transfer ends.
    pub fn detect(
        &mut self,
        job: &mut Job<'_>,
        detector: &Detector,
        sink: &mut dyn DetectionSink,
        watch: &mut dyn SessionObserver,
    ) -> Outcome {
        self.conduct(job, Products::Detections(*detector, sink), watch)
    }

    /// Accumulate the maps of `job`, which are not sent, into the image of `request`. The
    /// image contains the sub-CPIs that it lists, however the transfer ends. After a cancellation the module completes the
    /// sub-CPI at hand, and the image so far is received.
    pub fn accumulate(
        &mut self,
        job: &mut Job<'_>,
        request: ImageRequest<'_>,
        watch: &mut dyn SessionObserver,
    ) -> (Outcome, AccumulatedImage) {
        let mut image = AccumulatedImage::default();
        let mut outcome = self.conduct(job, Products::Image(request, &mut image), watch);
        let received = image.chips.iter().all(Option::is_some);
        if matches!(outcome.ending, TransferEnd::Complete) && !received {
            outcome.ending = TransferEnd::Incomplete;
        }
        (outcome, image)
    }

    /// Run `job` on the module for these products.
    fn conduct(
        &mut self,
        job: &mut Job<'_>,
        mut products: Products<'_>,
        watch: &mut dyn SessionObserver,
    ) -> Outcome {
        let wanted = job.wanted();
        self.ledger.counts.pulses = job.pulses.len().into();
        self.ledger.counts.maps_wanted = wanted.num_maps();
        let mut buffer = vec![0; Intake::room_bytes(&wanted, &products)];
        let job_settings = JobSettings {
            setup: job.setup,
            fast_weights: &job.fast_weights,
            patches: &job.patches,
            total_pulses: job.pulses.len(),
            request: products.request(),
            from_front_end: job.pulses.is_from_front_end(),
        };
        let mut conversation = Conversation::new(
            &mut self.ledger,
            job_settings,
            Intake::new(wanted, &mut buffer, products.by_ref()),
            Some(self.identity.clone()),
        );
        let connection = &mut self.connection;
        let led = connection.lead(&mut conversation, Some(&mut job.pulses), watch);
        if matches!(led, Err(LinkError::Cancelled)) && conversation.abandon_runs() {
            let until = Instant::now() + conversation.ledger.settings.idle;
            // Without an answer in time there is no image; the transfer counts as cancelled in any case.
            let _ = connection.lead(&mut conversation, None, &mut Ending { watch, until });
        }
        if conversation.is_in_run() {
            self.connection.abort(conversation.ledger.settings.answer);
        }
        let missing = conversation.missing_maps();
        self.ledger.counts.samples_clamped = job.pulses.clamped();
        Outcome {
            counts: self.counts(),
            ending: match led {
                Ok(()) if missing.is_empty() => TransferEnd::Complete,
                Ok(()) => TransferEnd::Incomplete,
                Err(error) => TransferEnd::Failed(error),
            },
            missing,
        }
    }
}

impl Connection<'_> {
    /// Carry out the steps of a conversation until it is over.
    fn lead(
        &mut self,
        conversation: &mut Conversation<'_>,
        mut pulses: Option<&mut PulseSource<'_>>,
        watch: &mut dyn SessionObserver,
    ) -> Result<(), LinkError> {
        let mut event = Event::Begun;
        loop {
            let step = conversation.step(event, Instant::now(), &mut self.line.outbox);
            if let Some(image) = conversation.take_preview() {
                watch.preview(&image);
            }
            let done = match step {
                Step::Exchange(wait) => self.exchange(wait, conversation, watch),
                Step::Pulse(number) => self.send(number, pulses.as_deref_mut()),
                Step::Restart(error) => {
                    let answer = conversation.ledger.settings.answer;
                    self.reconnect_line(&error, answer, watch)
                }
                Step::Over(ending) => return ending,
            };
            event = done.unwrap_or_else(Event::Failed);
        }
    }

    /// Exchange bytes once, waiting up to `wait`, and process everything received.
    fn exchange(
        &mut self,
        wait: Duration,
        conversation: &mut Conversation<'_>,
        watch: &mut dyn SessionObserver,
    ) -> Result<Event, LinkError> {
        if watch.cancelled() {
            return Err(LinkError::Cancelled);
        }
        let mut bytes = self.line.exchange(wait)?;
        while let Some(frame) = self.receiver.receive::<Report<'_>>(&mut bytes) {
            match frame {
                Ok(received) => {
                    if let Report::Event(event) = &received.message {
                        watch.event(event);
                    }
                    conversation.hear(&received.message)?;
                }
                Err(damage) => conversation.hear_damage(&damage),
            }
        }
        watch.update(&self.counts(conversation.ledger));
        Ok(Event::Exchanged)
    }

    /// Send a pulse of the job.
    fn send(
        &mut self,
        number: u32,
        pulses: Option<&mut PulseSource<'_>>,
    ) -> Result<Event, LinkError> {
        if let Some(pulses) = pulses {
            let (encoding, front_end) = (pulses.encoding(), pulses.is_from_front_end());
            let (pulse, samples) = pulses.pulse(number)?;
            self.line.outbox.send(&match front_end {
                true => Command::Geometry { pulse },
                false => Command::Pulse {
                    pulse,
                    encoding,
                    samples,
                },
            });
        }
        Ok(Event::Sent)
    }

    /// Reconnect, unless the module restarted.
    fn reconnect_line(
        &mut self,
        because: &LinkError,
        answer: Duration,
        watch: &mut dyn SessionObserver,
    ) -> Result<Event, LinkError> {
        watch.log(&format!("{because}: restarting the conversation"));
        if !matches!(because, LinkError::Restarted)
            && let Err(failure) = self.line.reconnect()
        {
            // The module may be starting up.
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

    /// Abort the module's run. The command may be lost; the next session then repeats it.
    pub(super) fn abort(&mut self, patience: Duration) {
        self.line.outbox.send(&Command::Abort);
        let started = Instant::now();
        while self.line.outbox.backlog() > 0 && started.elapsed() < patience {
            // Even if the user wants to stop.
            if self.line.exchange(TICK).is_err() {
                break;
            }
        }
    }

    /// Statistics of the session so far.
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
