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
//! **Order of sending**: identity, refusals, status, then the current map, its detections, and the chip. The buffer holds
//! one frame at a time.
//!
//! | file | content |
//! |---|---|
//! | this one | the endpoint, its state, the order of work |
//! | `commands` | execution of commands, and reasons to refuse them |
//! | `increments` | runs that produce motion increments |
//! | `profiles` | runs that produce range profiles |
//! | `reports` | reports to the host, one frame at a time |

mod commands;
mod increments;
mod profiles;
mod reports;
mod transfer;

use increments::Increments;
use profiles::Profiles;

use subaperture_core::link::{Command, Encoder, Received, Receiver, Refusal, State};
use subaperture_core::stream::{Progress, SubCpiProcessor};

use crate::engine::WireEngine;
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
    /// Samples of one row, 8 bytes each.
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
                    refusal: None,
                },
                configuration: 0,
                weights: 0,
                patches: 0,
                run: None,
                state: State::Idle,
                maps: 0,
                reported_credit: 0,
                transfer: Transfer::Nothing,
                chip_sent: false,
                pulse_refused: false,
                increments: Increments::default(),
                profiles: Profiles::default(),
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

    /// Do one processing step, unless a map waits to be sent. Returns false if there was nothing to do.
    pub fn work(&mut self) -> bool {
        self.module.work()
    }

    /// State of the module.
    pub fn state(&self) -> State {
        self.module.state
    }
}

/// Reports to send as soon as the line is free.
#[derive(Debug)]
struct Due {
    identity: bool,
    status: bool,
    refusal: Option<(u32, Refusal)>,
}

/// Everything except the receiver, since commands borrow from its buffer.
struct Module<'a, E: WireEngine> {
    processor: SubCpiProcessor<'a, E>,
    products: Products<'a>,
    encoder: Encoder,
    frame: &'a mut [u8],
    row: &'a mut [u8],
    /// Range of `frame` still to be sent.
    pending: (usize, usize),
    version: &'static str,
    due: Due,
    configuration: u32,
    /// Number of weights received, and number of patches announced.
    weights: usize,
    patches: u16,
    run: Option<u32>,
    state: State,
    maps: u32,
    reported_credit: u32,
    transfer: Transfer,
    chip_sent: bool,
    /// A refused pulse of the run was already reported to the host.
    pulse_refused: bool,
    increments: Increments<'a>,
    profiles: Profiles<'a>,
}

impl<E: WireEngine> Module<'_, E> {
    fn work(&mut self) -> bool {
        if self.increments.is_configured() {
            return self.work_on_increments();
        }
        if self.profiles.is_configured() {
            return self.work_on_profiles();
        }
        match self.transfer {
            Transfer::Nothing => {}
            Transfer::Products => {
                let (setup, map) = (self.processor.setup(), self.processor.map());
                let more = setup
                    .zip(map)
                    .is_some_and(|(setup, map)| self.products.work(setup, &map));
                if !more {
                    self.transfer = Transfer::MapStart;
                }
                return true;
            }
            _ => return false,
        }
        match self.processor.work() {
            Progress::Busy => true,
            Progress::Map => {
                if let Some(map) = self.processor.map() {
                    self.products.begin_map(&map);
                    self.transfer = Transfer::Products;
                }
                true
            }
            Progress::Idle => {
                if self.state == State::Finishing {
                    self.finish();
                }
                false
            }
        }
    }

    /// After the last map: send the chip, then end the run.
    fn finish(&mut self) {
        if self.products.chip.is_some_and(|chip| chip.maps > 0) && !self.chip_sent {
            self.chip_sent = true;
            self.transfer = Transfer::ChipStart;
        } else {
            self.state = State::Done;
            self.due.status = true;
        }
    }
}
