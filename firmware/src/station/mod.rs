//! The module's end of the link: commands in, maps out, without a line of input or output.
//!
//! **What it does.** [`Station`] takes the bytes that came ([`Station::receive`]), gives the bytes that
//! are to go ([`Station::pending`]), and does one bounded piece of work at a time ([`Station::work`]), so
//! that whoever owns the line can see to it in between. It never waits: while the host does not read,
//! the map in hand waits, pulses go on filling the stores, and what finds no room is counted. It runs
//! on a host too, where it is tested over bad lines.
//!
//! **The way of the data.**
//!
//! ```text
//! receive -> frame -> command -> settings | pulse -> processor -> map -> products
//!                                                                    -> rows -> frame -> pending
//! ```
//!
//! **Order of what goes out**: who it is, refusals, status, and then the map in hand, its detections,
//! the chip. One frame is in the buffer at a time.
//!
//! | file | what it has |
//! |---|---|
//! | this one | the station, its state, the order of work |
//! | `commands` | what comes, and why it may be refused |
//! | `increments` | runs that bring increments instead of maps |
//! | `profiles` | runs that bring range profiles |
//! | `reports` | what goes out, a frame at a time |

mod commands;
mod increments;
mod profiles;
mod reports;

use increments::Increments;
use profiles::Profiles;

use subaperture_core::link::{
    Command, Encoder, Received, Receiver, Refusal, State, TransferChecksum,
};
use subaperture_core::stream::{Progress, SubCpiProcessor};

use crate::engine::WireEngine;
use crate::odometer::WireOdometer;
use crate::products::{ProductBuffers, Products};
use crate::profiler::WireProfiler;

/// Buffers of the link, lent to a station.
#[derive(Debug)]
pub struct LinkBuffers<'a> {
    /// What comes, unstuffed: [`max_received_bytes`](subaperture_core::link::max_received_bytes) of the
    /// largest pulse.
    pub received: &'a mut [u8],
    /// What goes, stuffed: [`max_frame_bytes`](subaperture_core::link::max_frame_bytes) of the longest row.
    pub frame: &'a mut [u8],
    /// A row's samples: 8 bytes each.
    pub row: &'a mut [u8],
}

/// The module's end of the link.
pub struct Station<'a, E: WireEngine> {
    receiver: Receiver<'a>,
    module: Module<'a, E>,
}

impl<'a, E: WireEngine> Station<'a, E> {
    /// A module that has just started: its first word is who it is.
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
                told_credit: 0,
                transfer: Transfer::Nothing,
                chip_sent: false,
                pulse_refused: false,
                increments: Increments::default(),
                profiles: Profiles::default(),
            },
        }
    }

    /// Increments can be had too. Without an odometer they are refused as unsupported.
    #[must_use]
    pub fn with_odometer(mut self, odometer: &'a mut dyn WireOdometer) -> Self {
        self.module.increments = Increments::of(odometer);
        self
    }

    /// Range profiles can be had too. Without a profiler they are refused as unsupported.
    #[must_use]
    pub fn with_profiler(mut self, profiler: &'a mut dyn WireProfiler) -> Self {
        self.module.profiles = Profiles::of(profiler);
        self
    }

    /// Takes bytes that came.
    pub fn receive(&mut self, mut bytes: &[u8]) {
        while let Some(frame) = self.receiver.receive::<Command<'_>>(&mut bytes) {
            // What is damaged has been counted; the host asks again for what matters to it.
            if let Ok(Received {
                sequence, message, ..
            }) = frame
            {
                self.module.obey(sequence, &message);
            }
        }
    }

    /// Bytes to go, as many at a time as the line takes: [`Station::sent`].
    pub fn pending(&mut self) -> &[u8] {
        if self.module.pending.0 >= self.module.pending.1 {
            let link = *self.receiver.counters();
            self.module.next_frame(link);
        }
        let (start, end) = self.module.pending;
        self.module.frame.get(start..end).unwrap_or(&[])
    }

    /// The first `count` of the pending bytes have gone.
    pub fn sent(&mut self, count: usize) {
        let (start, end) = &mut self.module.pending;
        *start = start.saturating_add(count).min(*end);
    }

    /// Does a piece of work, unless a map waits to be sent. False if there was nothing to do.
    pub fn work(&mut self) -> bool {
        self.module.work()
    }

    /// What the module is doing.
    pub fn state(&self) -> State {
        self.module.state
    }
}

/// Reports that are to be sent as soon as the line is free.
#[derive(Debug)]
struct Due {
    identity: bool,
    status: bool,
    refusal: Option<(u32, Refusal)>,
}

/// What is on its way out.
#[derive(Debug)]
enum Transfer {
    Nothing,
    /// A map is there; its products are being made.
    Products,
    MapStart,
    MapRow {
        row: u16,
        checksum: TransferChecksum,
    },
    MapEnd {
        checksum: TransferChecksum,
    },
    /// Of the map sent last, from this one of its list on.
    Detections(usize),
    ChipStart,
    ChipRow {
        row: u16,
        checksum: TransferChecksum,
    },
    ChipEnd {
        checksum: TransferChecksum,
    },
    ProfileStart,
    ProfileRow {
        row: u16,
        checksum: TransferChecksum,
    },
    ProfileEnd {
        checksum: TransferChecksum,
    },
}

/// Everything but the receiver, from whose buffer commands borrow.
struct Module<'a, E: WireEngine> {
    processor: SubCpiProcessor<'a, E>,
    products: Products<'a>,
    encoder: Encoder,
    frame: &'a mut [u8],
    row: &'a mut [u8],
    /// The bytes of `frame` that are to go.
    pending: (usize, usize),
    version: &'static str,
    due: Due,
    configuration: u32,
    /// Weights that came, and patches that are to come in all.
    weights: usize,
    patches: u16,
    run: Option<u32>,
    state: State,
    maps: u32,
    told_credit: u32,
    transfer: Transfer,
    chip_sent: bool,
    /// The host has been told that a pulse of the run is none.
    pulse_refused: bool,
    increments: Increments<'a>,
    profiles: Profiles<'a>,
}

impl<E: WireEngine> Module<'_, E> {
    fn work(&mut self) -> bool {
        if self.increments.are_wanted() {
            return self.work_on_increments();
        }
        if self.profiles.are_wanted() {
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

    /// The last map has gone: the chip, then the end of the run.
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
