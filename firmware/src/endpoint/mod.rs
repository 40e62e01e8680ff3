//! Module end of the link: commands in, maps out, independent of any input or output hardware.
//!
//! [`Endpoint`] accepts received bytes ([`Endpoint::receive`]), provides bytes to send ([`Endpoint::pending`]), and does one
//! processing step of bounded duration at a time ([`Endpoint::work`]), so that the caller can serve the line in between. It
//! never blocks: while the host does not read, the current map waits, pulses continue to fill the stores, and pulses without
//! room are counted as dropped. It also runs on a host, where it is tested over lossy lines.
//!
//! **Data flow.**
//!
//! ```text
//! receive -> frame -> command -> settings | pulse -> processor -> map -> products
//!                                                                    -> rows -> frame -> pending
//! ```
//!
//! **Order of sending**: identity, refusals, status, list of accumulated sub-CPIs, events, then the current map, its
//! detections, or a chip. At the end of a run events precede the status. The buffer holds one frame at a time.
//!
//! | file | content |
//! |---|---|
//! | this one | the endpoint |
//! | `module` | its state |
//! | `commands` | execution of commands, and reasons to refuse them |
//! | `events` | events for the log of the board and for the host |
//! | `front_end`, `front_end_runs` | state of runs with samples from the module's own front end, and the runs |
//! | `increments`, `increment_runs` | state of runs that produce motion increments, and the runs |
//! | `profiles`, `profile_runs` | state of runs that produce range profiles, and the runs |
//! | `reports` | reports to the host, one frame at a time |
//! | `work` | the order of work |

mod commands;
mod events;
mod front_end;
mod front_end_runs;
mod increment_runs;
mod increments;
mod module;
mod profile_runs;
mod profiles;
mod reports;
mod transfer;
mod work;

use events::Events;
use front_end::Source;
use increments::Increments;
use module::{Due, Module};
use profiles::Profiles;

use subaperture_core::link::{Command, Encoder, Event, Received, Receiver, State};
use subaperture_core::stream::SubCpiProcessor;

use crate::engine::WireEngine;
use crate::front_end::{FrontEnd, GeometryQueue};
use crate::odometer::WireOdometer;
use crate::products::{ProductBuffers, Products};
use crate::profiler::WireProfiler;

use transfer::Transfer;

/// Link buffers lent to an endpoint.
#[derive(Debug)]
pub struct LinkBuffers<'a> {
    /// Received frame after decoding: [`max_received_bytes`](subaperture_core::link::max_received_bytes) of the largest pulse.
    pub received: &'a mut [u8],
    /// Encoded frame to send: [`max_frame_bytes`](subaperture_core::link::max_frame_bytes) of the longest row.
    pub frame: &'a mut [u8],
    /// Samples of one row, 8 bytes each, at least those of [`CHIP_PART_PIXELS`](subaperture_core::link::CHIP_PART_PIXELS) pixels
    /// where images are accumulated.
    pub row: &'a mut [u8],
}

/// Module end of the link.
pub struct Endpoint<'a, E: WireEngine> {
    receiver: Receiver<'a>,
    module: Module<'a, E>,
}

impl<'a, E: WireEngine> Endpoint<'a, E> {
    /// Create an endpoint in the state after a reset. The first report it sends is its identity.
    pub fn new(
        processor: SubCpiProcessor<'a, E>,
        buffers: LinkBuffers<'a>,
        products: ProductBuffers<'a>,
        version: &'static str,
    ) -> Self {
        Self {
            receiver: Receiver::new(buffers.received),
            module: Module {
                processor,
                products: Products::new(products),
                encoder: Encoder::new(),
                frame: buffers.frame,
                row: buffers.row,
                pending: (0, 0),
                version,
                due: Due {
                    identity: true,
                    status: false,
                    accumulated: None,
                    refusal: None,
                },
                configuration: 0,
                weights: 0,
                patches: 0,
                total_pulses: 0,
                send_maps: true,
                run: None,
                state: State::Idle,
                maps: 0,
                reported_credit: 0,
                transfer: Transfer::Nothing,
                aborting: false,
                chip: 0,
                chips_requested: 0,
                pulse_refused: false,
                increments: Increments::default(),
                profiles: Profiles::default(),
                source: Source::default(),
                events: Events::new(),
            },
        }
    }

    /// Enable motion increments. Without an odometer they are refused as unsupported.
    #[must_use]
    pub fn with_odometer(mut self, odometer: &'a mut dyn WireOdometer) -> Self {
        self.module.increments = Increments::with(odometer);
        self
    }

    /// Enable range profiles. Without a profiler they are refused as unsupported.
    #[must_use]
    pub fn with_profiler(mut self, profiler: &'a mut dyn WireProfiler) -> Self {
        self.module.profiles = Profiles::with(profiler);
        self
    }

    /// Enable runs with samples from a front end. Without one they are refused as unsupported.
    #[must_use]
    pub fn with_front_end(
        mut self,
        front_end: &'a mut dyn FrontEnd,
        queue: &'a mut GeometryQueue,
    ) -> Self {
        self.module.source = Source::with(front_end, queue);
        self
    }

    /// Pass events to a log, which must not block. `faults` is the number of resets after faults since power-on.
    #[must_use]
    pub fn with_log(mut self, log: fn(&Event), faults: u32) -> Self {
        self.module.events.start(log, faults);
        self
    }

    /// Log an event of the program around the endpoint, and send it if the host requested its level.
    pub fn record(&mut self, event: Event) {
        self.module.events.record(event);
    }

    /// Process received bytes.
    pub fn receive(&mut self, mut bytes: &[u8]) {
        while let Some(frame) = self.receiver.receive::<Command<'_>>(&mut bytes) {
            // Damaged frames were counted; the host repeats what matters to it.
            if let Ok(Received {
                sequence, message, ..
            }) = frame
            {
                self.module.execute(sequence, &message);
            }
        }
    }

    /// Bytes to send. Report the number sent with [`Endpoint::sent`].
    pub fn pending(&mut self) -> &[u8] {
        if self.module.pending.0 >= self.module.pending.1 {
            let link = *self.receiver.counters();
            self.module.next_frame(link);
        }
        let (start, end) = self.module.pending;
        self.module.frame.get(start..end).unwrap_or(&[])
    }

    /// Remove the first `count` of the pending bytes, which were sent.
    pub fn sent(&mut self, count: usize) {
        let (start, end) = &mut self.module.pending;
        *start = start.saturating_add(count).min(*end);
    }

    /// Do one processing step, unless a map or chip waits to be sent. Returns whether there was a step to do.
    pub fn work(&mut self) -> bool {
        self.module.work()
    }

    /// State of the module.
    pub fn state(&self) -> State {
        self.module.state
    }
}
