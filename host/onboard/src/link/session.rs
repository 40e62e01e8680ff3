//! A conversation with a module: greeting, questions and answers, and everything that comes.
//!
//! **What it does.** [`Session::open`] greets a module and learns who it is; [`Session::transfer`] has it do
//! a [`Job`]. Every command but a pulse is repeated until it is answered. Whatever comes is
//! taken in one place, between any two steps: a module that began anew is greeted, told by its
//! status, configured again, and asked for what is still missing.
//!
//! **Errors**: [`LinkError`] where no module answers or it refuses; once it has answered,
//! [`Outcome::ending`] says how the transfer ended, and the maps taken so far are good.

use std::io;
use std::time::{Duration, Instant};

use subaperture_core::link::{
    Arithmetic, AssembledMap, Command, Damage, LinkCounters, Receiver, Refusal, Report, State,
    Status, max_received_bytes,
};
use subaperture_core::stream::Capacity;

use super::counts::{Counts, growth};
use super::job::Job;
use super::line::{Line, MOST_SAMPLES};
use super::run::Intake;
use super::transport::Transport;
use subaperture_model::phase_history::ReadError;

/// Times that a question is asked. Half of all answers lost, all of these are once in `10^15`.
pub(super) const ATTEMPTS: u32 = 50;

/// Longest wait in one go, so that Ctrl-C is heard.
pub(super) const TICK: Duration = Duration::from_millis(20);

/// How patient a session is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Wait for an answer before asking again.
    pub answer: Duration,
    /// Silence after which the line is connected anew, and given up if that does not help. To this comes the
    /// time that what was sent may still take to pass, by the line's speed, or 4 kB a second where it
    /// tells none.
    pub idle: Duration,
    /// Further runs, at most, over all that is missing.
    pub retries: u32,
    /// Pulses a second, whether or not the module has room; as fast as it has room if none.
    pub rate_hz: Option<f64>,
    /// Number of the first configuration and run. A module may remember those of an earlier
    /// session; they should differ.
    pub first_number: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            answer: Duration::from_millis(500),
            idle: Duration::from_secs(10),
            retries: 3,
            rate_hz: None,
            first_number: 1,
        }
    }
}

/// Takes the maps that come.
pub trait MapSink {
    /// Takes a map that came whole and was asked for; every one once, in any order.
    ///
    /// # Errors
    /// Ends the transfer.
    fn accept(&mut self, map: &AssembledMap<'_>) -> Result<(), SinkError>;
}

/// What a sink fails with.
pub type SinkError = Box<dyn std::error::Error + Send + Sync>;

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

/// Who a module is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// The arithmetic of its maps.
    pub arithmetic: Arithmetic,
    /// The sizes its buffers were built for.
    pub capacity: Capacity,
    /// Name and version of its program, without control characters.
    pub version: String,
}

/// Why a session did not do what it should.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The line is gone.
    #[error("the line to the module: {0}")]
    Line(#[from] io::Error),
    /// Nothing that makes sense comes.
    #[error(
        "the module does not answer: is it running this firmware, at this speed, and is nobody else \
         talking to it?"
    )]
    Silent,
    /// Another protocol.
    #[error(
        "the module speaks protocol version {0}, this program version {PROTOCOL}: update the older \
         of the two", PROTOCOL = subaperture_core::link::PROTOCOL_VERSION
    )]
    Version(u8),
    /// It said no.
    #[error("the module refuses: {0}")]
    Refused(Refusal),
    /// It answers, but takes no pulse and sends no map.
    #[error(
        "the module answers, but for {0:?} it has taken no pulse and sent no map: its line may lose every \
         long frame, or it hangs; switch it off and on"
    )]
    Stuck(Duration),
    /// It began anew.
    #[error("the module began anew again and again, without a map in between")]
    Restarted,
    /// Samples cannot be read.
    #[error(transparent)]
    Recording(#[from] ReadError),
    /// A map cannot be kept.
    #[error("{0}")]
    Sink(SinkError),
    /// The user wants it so.
    #[error("interrupted")]
    Cancelled,
}

impl LinkError {
    /// Whether connecting and configuring anew may help.
    pub(super) fn is_passing(&self) -> bool {
        matches!(
            self,
            Self::Line(_) | Self::Silent | Self::Stuck(_) | Self::Restarted
        )
    }
}

/// How a transfer ended.
#[derive(Debug)]
pub enum Ending {
    /// Every map was taken.
    Complete,
    /// All was done that was to be; maps are missing.
    Incomplete,
    /// It broke off.
    Failed(LinkError),
}

/// What came of a transfer.
#[derive(Debug)]
pub struct Outcome {
    /// What was done.
    pub counts: Counts,
    /// Sub-CPI and patch of every map that is missing.
    pub missing: Vec<(u32, u16)>,
    /// How it ended.
    pub ending: Ending,
}

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

/// What has come and nobody has asked about yet.
#[derive(Debug, Default)]
pub(super) struct News {
    pub(super) identity: Option<Identity>,
    pub(super) status: Option<Status>,
    pub(super) refusal: Option<(u32, Refusal)>,
    version: Option<u8>,
}

/// Who watches, and where maps go.
pub(super) struct Context<'c> {
    pub(super) watch: &'c mut dyn Watch,
    pub(super) intake: Option<Intake<'c>>,
}

/// A conversation with a module.
pub struct Session<'b> {
    pub(super) line: Line<'b>,
    receiver: Receiver<'b>,
    pub(super) settings: Settings,
    identity: Identity,
    pub(super) news: News,
    pub(super) counts: Counts,
    opened: Instant,
    /// When a frame came last.
    heard: Instant,
    /// When it was greeted last.
    greeted: Instant,
    /// When a run went on last: a pulse was taken, or a part of a map came.
    pub(super) advanced: Instant,
    /// The module's counters by its last status.
    module_link: Option<LinkCounters>,
    /// Numbers of the configuration and the run that are in force.
    pub(super) configuration: u32,
    pub(super) run: u32,
    /// A run is going on, and a module that greets has to say how it stands.
    pub(super) running: bool,
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
        let now = Instant::now();
        let mut session = Self {
            line: Line::new(transport),
            receiver: Receiver::new(&mut buffers.received),
            settings,
            identity: Identity {
                arithmetic: Arithmetic::Float,
                capacity: Capacity {
                    pulses: 0,
                    frequencies: 0,
                    range_bins: 0,
                    doppler_bins: 0,
                    patches: 0,
                },
                version: String::new(),
            },
            news: News::default(),
            counts: Counts::default(),
            opened: now,
            heard: now,
            greeted: now,
            advanced: now,
            module_link: None,
            configuration: settings.first_number,
            run: settings.first_number,
            running: false,
        };
        session.identity = session.greet(&mut Context {
            watch,
            intake: None,
        })?;
        Ok(session)
    }

    /// Who answered.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// What has been done so far.
    pub fn counts(&self) -> Counts {
        Counts {
            seconds: self.opened.elapsed().as_secs_f64(),
            bytes_to_module: self.line.bytes_out,
            bytes_from_module: self.line.bytes_in,
            frames_from_module: growth(&LinkCounters::default(), self.receiver.counters()),
            ..self.counts
        }
    }

    /// Has the module do `job`. Maps go to `sink` as they come; however it ends, those are good.
    pub fn transfer(
        &mut self,
        job: &mut Job<'_>,
        sink: &mut dyn MapSink,
        watch: &mut dyn Watch,
    ) -> Outcome {
        let wanted = job.wanted();
        self.counts.pulses = job.pulses.len().into();
        self.counts.maps_wanted = wanted.num_maps();
        let mut buffer = vec![0; Intake::room_bytes(&wanted)];
        let mut context = Context {
            watch,
            intake: Some(Intake::new(wanted, &mut buffer, sink)),
        };
        let led = self.lead(job, &mut context);
        if self.running {
            // It may well not hear it; then the next session does the same.
            self.running = false;
            self.line.send(&Command::Abort);
            let started = Instant::now();
            while self.line.backlog() > 0 && started.elapsed() < self.settings.answer {
                // Not by `pump`, which does nothing more once the user wants to stop.
                if self.line.exchange(TICK).is_err() {
                    break;
                }
            }
        }
        self.counts.samples_clamped = job.pulses.clamped();
        let missing = context
            .intake
            .map_or_else(Vec::new, |intake| intake.missing_maps());
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

    /// Opens the conversation.
    pub(super) fn greet(&mut self, context: &mut Context<'_>) -> Result<Identity, LinkError> {
        self.heard = Instant::now();
        self.news.identity = None;
        for _ in 0..ATTEMPTS {
            self.line.send(&Command::Hello);
            let mut asked = Instant::now();
            self.greeted = asked;
            while asked.elapsed() < self.settings.answer {
                self.pump(TICK.min(self.settings.answer), context)?;
                if self.line.backlog() > 0 {
                    asked = Instant::now();
                }
                if let Some(identity) = self.news.identity.take() {
                    return Ok(identity);
                }
                if let Some(version) = self.news.version.take() {
                    return Err(LinkError::Version(version));
                }
            }
        }
        Err(LinkError::Silent)
    }

    /// Sends a command until a status satisfies.
    pub(super) fn ask(
        &mut self,
        command: &Command<'_>,
        attempts: u32,
        context: &mut Context<'_>,
        mut satisfies: impl FnMut(&Status) -> Result<bool, LinkError>,
    ) -> Result<Status, LinkError> {
        let mut asked_in_vain = 0;
        while asked_in_vain < attempts {
            self.news.status = None;
            self.news.refusal = None;
            let sequence = self.line.send(command);
            let mut asked = Instant::now();
            while asked.elapsed() < self.settings.answer {
                self.pump(TICK.min(self.settings.answer), context)?;
                if self.line.backlog() > 0 {
                    asked = Instant::now();
                }
                if let Some((number, what)) = self.news.refusal.take()
                    && number == sequence
                {
                    return Err(LinkError::Refused(what));
                }
                if let Some(status) = self.news.status.take()
                    && satisfies(&status)?
                {
                    return Ok(status);
                }
            }
            // A question waits behind all that was sent before it; that is not in vain yet.
            asked_in_vain += u32::from(Instant::now() >= self.line.clear_at());
        }
        Err(LinkError::Silent)
    }

    /// Writes and reads once, waiting up to `wait`, and takes everything that came.
    pub(super) fn pump(
        &mut self,
        wait: Duration,
        context: &mut Context<'_>,
    ) -> Result<(), LinkError> {
        if context.watch.cancelled() {
            return Err(LinkError::Cancelled);
        }
        let mut bytes = self.line.exchange(wait)?;
        let mut behind = false;
        let mut anew = false;
        while let Some(frame) = self.receiver.receive::<Report<'_>>(&mut bytes) {
            let report = match frame {
                Ok(received) => received.message,
                Err(Damage::Repeated(_)) => {
                    behind = true;
                    continue;
                }
                Err(Damage::Version(version)) => {
                    self.news.version = Some(version);
                    continue;
                }
                Err(_) => continue,
            };
            self.heard = Instant::now();
            match report {
                Report::Identity {
                    protocol,
                    arithmetic,
                    capacity,
                    version,
                } => {
                    anew = true;
                    if protocol != subaperture_core::link::PROTOCOL_VERSION {
                        self.news.version = Some(protocol);
                    }
                    self.news.identity = Some(Identity {
                        arithmetic,
                        capacity,
                        version: shown(version),
                    });
                }
                Report::Status(status) => {
                    let before = self.module_link.unwrap_or(status.link);
                    let grown = growth(&before, &status.link);
                    self.counts.frames_to_module.add(grown);
                    self.module_link = Some(status.link);
                    self.news.status = Some(status);
                }
                Report::Refused { sequence, what } => self.news.refusal = Some((sequence, what)),
                Report::Log { text } => context.watch.log(&shown(text)),
                report => {
                    self.advanced = self.heard;
                    if let Some(intake) = &mut context.intake {
                        intake.take(&report, &mut self.counts)?;
                    }
                }
            }
        }
        if anew && self.running {
            self.line.send(&Command::Status);
        }
        if behind && self.greeted.elapsed() > self.settings.answer {
            self.greeted = Instant::now();
            self.line.send(&Command::Hello);
        }
        let counts = self.counts();
        context.watch.update(&counts);
        let passing = self
            .line
            .clear_at()
            .saturating_duration_since(Instant::now());
        if self.heard.elapsed() > self.settings.idle + passing {
            return Err(LinkError::Silent);
        }
        Ok(())
    }

    /// Fails unless the status is of the run that is going on: else the module began anew.
    pub(super) fn check_mine(&self, status: &Status) -> Result<(), LinkError> {
        if status.configuration == self.configuration && status.run == self.run {
            Ok(())
        } else {
            Err(LinkError::Restarted)
        }
    }
}

/// A module's words as they are shown: what would reach a terminal as a command is replaced.
fn shown(text: &str) -> String {
    let replaced = |c: char| match c.is_control() {
        true => char::REPLACEMENT_CHARACTER,
        false => c,
    };
    text.chars().map(replaced).collect()
}

/// Whether a run is going on.
pub(super) fn is_busy(status: &Status) -> bool {
    matches!(status.state, State::Running | State::Finishing)
}
