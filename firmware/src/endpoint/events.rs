//! Events: passed to the board's log at once, and queued for the link if the host requested their level.

use heapless::Deque;
use subaperture_core::link::{Event, Level, LinkCounters, State, Status};
use subaperture_core::stream::PulseCounters;

/// Maximum number of events that wait for the line.
const QUEUE: usize = 8;

/// Events of an endpoint.
pub(super) struct Events {
    /// Log of the board.
    log: fn(&Event),
    /// Number of resets after faults since power-on.
    faults: u32,
    /// Least severe level for the link. `None` for no events.
    least: Option<Level>,
    queue: Deque<Event, QUEUE>,
    /// Number of events that found the queue full.
    dropped: u32,
    /// State, run and counters of the last status.
    state: State,
    run: u32,
    link: LinkCounters,
    pulses: PulseCounters,
}

impl Events {
    /// Create the state without a log.
    pub(super) fn new() -> Self {
        Self {
            log: |_| {},
            faults: 0,
            least: None,
            queue: Deque::new(),
            dropped: 0,
            state: State::Idle,
            run: 0,
            link: LinkCounters::default(),
            pulses: PulseCounters::default(),
        }
    }

    /// Set the log of the board, and record the start of the program.
    pub(super) fn start(&mut self, log: fn(&Event), faults: u32) {
        self.log = log;
        self.faults = faults;
        self.record(Event::Started { faults });
    }

    /// Select the events for the link.
    pub(super) fn request(&mut self, least: Option<Level>) {
        self.least = least;
        self.queue.clear();
        self.dropped = 0;
        self.enqueue(Event::Started {
            faults: self.faults,
        });
    }

    /// Log an event and queue it for the link.
    pub(super) fn record(&mut self, event: Event) {
        (self.log)(&event);
        self.enqueue(event);
    }

    fn enqueue(&mut self, event: Event) {
        let requested = self.least.is_some_and(|least| event.level() >= least);
        if requested && self.queue.push_back(event).is_err() {
            self.dropped = self.dropped.saturating_add(1);
        }
    }

    /// Next event for the link.
    pub(super) fn next(&mut self) -> Option<Event> {
        self.queue.pop_front().or_else(|| {
            let events = core::mem::take(&mut self.dropped);
            (events > 0).then_some(Event::EventsDropped { events })
        })
    }

    /// Record the events between the last status and this one. So the number of events is limited by that of the statuses.
    pub(super) fn compare(&mut self, status: &Status) {
        let Status {
            state, run, link, ..
        } = *status;
        if run != self.run {
            self.pulses = PulseCounters::default();
        }
        let started = state == State::Running && (run != self.run || state != self.state);
        if started {
            self.record(Event::RunStarted { run });
        }
        let damaged = |link: &LinkCounters| {
            link.corrupt
                .saturating_add(link.malformed)
                .saturating_add(link.too_long)
        };
        let frames = damaged(&link).saturating_sub(damaged(&self.link));
        if frames > 0 {
            self.record(Event::FramesDamaged { frames });
        }
        let frames = link.lost.saturating_sub(self.link.lost);
        if frames > 0 {
            self.record(Event::FramesLost { frames });
        }
        let (now, before) = (status.pulses, self.pulses);
        let pulses = now.dropped.saturating_sub(before.dropped);
        if pulses > 0 {
            self.record(Event::PulsesDropped { pulses });
        }
        let samples = now.at_limit.saturating_sub(before.at_limit);
        if samples > 0 {
            self.record(Event::SamplesAtLimit { samples });
        }
        let results = now.saturated.saturating_sub(before.saturated);
        if results > 0 {
            self.record(Event::ResultsSaturated { results });
        }
        if state == State::Done && (run != self.run || state != self.state) {
            self.record(Event::RunEnded {
                run,
                pulses: now.accepted,
                maps: status.maps,
            });
        }
        (self.state, self.run, self.link, self.pulses) = (state, run, link, now);
    }
}
