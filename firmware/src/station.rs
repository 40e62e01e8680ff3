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

use subaperture_core::Pulse;
use subaperture_core::link::{
    self, Command, DETECTION_BYTES, Encoder, MAX_DETECTIONS, Received, Receiver, Refusal, Report,
    State, Status, TransferChecksum, f32s, write_block_row, write_complex32s, write_detections,
};
use subaperture_core::stream::{
    BlockFloat, MapSamples, Patch, PatchMap, Progress, PulseError, SubCpiProcessor,
};

use crate::engine::WireEngine;
use crate::products::{ProductBuffers, Products};

/// Buffers of the link, lent to a station.
#[derive(Debug)]
pub struct LinkBuffers<'a> {
    /// What comes, unstuffed: [`link::max_received_bytes`] of the largest pulse.
    pub received: &'a mut [u8],
    /// What goes, stuffed: [`link::max_frame_bytes`] of the longest row.
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
            },
        }
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
}

impl<E: WireEngine> Module<'_, E> {
    fn obey(&mut self, sequence: u32, command: &Command<'_>) {
        let answered = !matches!(command, Command::Hello | Command::Pulse { .. });
        let refusal = match *command {
            Command::Hello => {
                self.due.identity = true;
                Ok(())
            }
            Command::Configure(configuration) => self.configure(&configuration),
            Command::Weights { first, weights } => self.set_weights(first.into(), weights),
            Command::Patch {
                index,
                count,
                patch,
            } => self.set_patch(index, count, &patch),
            Command::Start { run, first } => self.start(run, first),
            Command::Pulse {
                pulse,
                encoding,
                samples,
            } => self.push(&pulse, encoding, samples),
            Command::Stop => {
                if self.state == State::Running {
                    self.processor.finish();
                    self.state = State::Finishing;
                }
                Ok(())
            }
            Command::Status => Ok(()),
            Command::Abort => {
                self.abort();
                Ok(())
            }
            Command::Chip(grid) => {
                let columns = self.row.len() / link::Encoding::Complex32.sample_bytes();
                self.add_product(|products| products.set_chip(&grid, columns))
            }
            Command::Detect(cfar) => self.add_product(|products| products.set_cfar(&cfar)),
        };
        match refusal {
            Ok(()) => self.due.status |= answered,
            Err(refusal) => self.due.refusal = Some((sequence, refusal)),
        }
    }

    fn is_busy(&self) -> bool {
        matches!(self.state, State::Running | State::Finishing)
    }

    fn configure(&mut self, configuration: &link::Configuration) -> Result<(), Refusal> {
        if self.is_busy() {
            return Err(Refusal::Running);
        }
        let setup = &configuration.setup;
        self.processor.configure(setup).map_err(Refusal::Setup)?;
        self.configuration = configuration.id;
        self.weights = 0;
        self.patches = 0;
        self.transfer = Transfer::Nothing;
        self.products.forget();
        self.state = State::Idle;
        Ok(())
    }

    fn set_weights(&mut self, first: usize, weights: &[u8]) -> Result<(), Refusal> {
        if self.is_busy() {
            return Err(Refusal::Running);
        }
        if self.processor.setup().is_none() {
            return Err(Refusal::NotConfigured);
        }
        // In order, so that all have come when the last has.
        if first > self.weights || !weights.len().is_multiple_of(4) {
            return Err(Refusal::Weights);
        }
        let weights = f32s(weights);
        let end = first.saturating_add(weights.len());
        self.processor
            .set_weights(first, weights)
            .map_err(Refusal::Setup)?;
        self.weights = self.weights.max(end);
        self.settle();
        Ok(())
    }

    fn set_patch(&mut self, index: u16, count: u16, patch: &Patch) -> Result<(), Refusal> {
        if self.is_busy() {
            return Err(Refusal::Running);
        }
        if self.processor.setup().is_none() {
            return Err(Refusal::NotConfigured);
        }
        let have = self.processor.patches().len();
        let other_list = index > 0 && count != self.patches;
        if index >= count || usize::from(index) > have || other_list {
            return Err(Refusal::PatchIndex);
        }
        self.processor
            .set_patch(index.into(), patch)
            .map_err(Refusal::Setup)?;
        self.patches = count;
        self.settle();
        Ok(())
    }

    fn add_product(
        &mut self,
        add: impl FnOnce(&mut Products<'_>) -> Result<(), Refusal>,
    ) -> Result<(), Refusal> {
        match self.state {
            State::Running | State::Finishing => Err(Refusal::Running),
            _ if self.processor.setup().is_none() => Err(Refusal::NotConfigured),
            _ => add(&mut self.products),
        }
    }

    /// Ready once everything that was announced is there.
    fn settle(&mut self) {
        let frequencies = self.processor.setup().map_or(0, |s| s.num_frequencies);
        let all_weights = self.weights == usize::from(frequencies);
        let all_patches =
            self.patches > 0 && self.processor.patches().len() == usize::from(self.patches);
        self.state = if all_weights && all_patches {
            State::Ready
        } else {
            State::Idle
        };
    }

    fn start(&mut self, run: u32, first: u32) -> Result<(), Refusal> {
        if self.run == Some(run) && self.state != State::Ready && self.state != State::Idle {
            return Ok(());
        }
        match self.state {
            State::Idle => return Err(Refusal::NotConfigured),
            State::Running | State::Finishing => return Err(Refusal::Running),
            State::Ready | State::Done => {}
        }
        let patches = self.processor.patches().len();
        let chip = self.products.chip;
        if chip.is_some_and(|chip| usize::from(chip.grid.patch) >= patches) {
            return Err(Refusal::PatchIndex);
        }
        self.processor.start(first).map_err(Refusal::Setup)?;
        self.run = Some(run);
        self.maps = 0;
        self.transfer = Transfer::Nothing;
        self.products.begin_run();
        self.chip_sent = false;
        self.pulse_refused = false;
        self.told_credit = self.processor.accept_through();
        self.state = State::Running;
        Ok(())
    }

    fn abort(&mut self) {
        if self.is_busy() {
            self.processor.stop();
            self.transfer = Transfer::Nothing;
            self.state = State::Done;
        }
    }

    fn push(
        &mut self,
        pulse: &Pulse,
        encoding: link::Encoding,
        samples: &[u8],
    ) -> Result<(), Refusal> {
        if self.state != State::Running {
            // Late ones of a run that is over are no news.
            return Ok(());
        }
        let refusal = match E::push(&mut self.processor, pulse, encoding, samples) {
            None => Refusal::Encoding,
            Some(Err(PulseError::Length)) => {
                let frequencies = self.processor.setup().map_or(0, |s| s.num_frequencies);
                let expected = usize::from(frequencies) * encoding.sample_bytes();
                Refusal::PulseLength {
                    expected: expected as u32,
                    got: samples.len() as u32,
                }
            }
            // Counted by the processor.
            Some(_) => return Ok(()),
        };
        // The host is told once, lest answers fill the line.
        match core::mem::replace(&mut self.pulse_refused, true) {
            true => Ok(()),
            false => Err(refusal),
        }
    }

    fn work(&mut self) -> bool {
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

    /// Puts the next frame into the buffer, if there is one to send.
    fn next_frame(&mut self, link: link::LinkCounters) {
        self.pending = (0, 0);
        if self.due.identity {
            self.due.identity = false;
            let report = Report::Identity {
                protocol: link::PROTOCOL_VERSION,
                arithmetic: E::ARITHMETIC,
                capacity: *self.processor.capacity(),
                version: self.version,
            };
            self.pending = send(&mut self.encoder, self.frame, &report);
            return;
        }
        if let Some((sequence, what)) = self.due.refusal.take() {
            let report = Report::Refused { sequence, what };
            self.pending = send(&mut self.encoder, self.frame, &report);
            return;
        }
        let credit = self.processor.accept_through();
        let more_credit = self.state == State::Running && credit != self.told_credit;
        if self.due.status || more_credit {
            self.due.status = false;
            self.told_credit = credit;
            let report = Report::Status(Status {
                state: self.state,
                configuration: self.configuration,
                run: self.run.unwrap_or(0),
                next_pulse: self.processor.next_pulse(),
                accept_through: credit,
                maps: self.maps,
                link,
                pulses: self.processor.counters(),
            });
            self.pending = send(&mut self.encoder, self.frame, &report);
            return;
        }
        self.next_part();
    }

    /// Puts the next part of what is on its way into the buffer.
    fn next_part(&mut self) {
        let transfer = core::mem::replace(&mut self.transfer, Transfer::Nothing);
        self.transfer = match transfer {
            Transfer::Nothing => Transfer::Nothing,
            Transfer::Products => Transfer::Products,
            Transfer::MapStart | Transfer::MapRow { .. } | Transfer::MapEnd { .. } => {
                self.next_of_map(transfer)
            }
            Transfer::Detections(first) => self.next_detections(first),
            Transfer::ChipStart | Transfer::ChipRow { .. } | Transfer::ChipEnd { .. } => {
                self.next_of_chip(transfer)
            }
        };
    }

    fn next_of_map(&mut self, transfer: Transfer) -> Transfer {
        let Some(map) = self.processor.map() else {
            return Transfer::Nothing;
        };
        let (number, rows) = (self.maps, map.header.patch.num_doppler_bins() as u16);
        match transfer {
            Transfer::MapRow { row, mut checksum } => {
                // A row that does not fit the buffer is left out, and the map's end will not agree.
                if let Some(samples) = row_bytes(&map, row.into(), self.row) {
                    checksum.add_row(samples);
                    let report = Report::MapRow {
                        map: number,
                        row,
                        samples,
                    };
                    self.pending = send(&mut self.encoder, self.frame, &report);
                }
                match row.wrapping_add(1) {
                    row if row < rows => Transfer::MapRow { row, checksum },
                    _ => Transfer::MapEnd { checksum },
                }
            }
            Transfer::MapEnd { checksum } => {
                let report = Report::MapEnd {
                    map: number,
                    rows,
                    crc: checksum.value(),
                };
                self.pending = send(&mut self.encoder, self.frame, &report);
                self.maps = self.maps.saturating_add(1);
                match self.products.cfar {
                    Some(_) => Transfer::Detections(0),
                    None => Transfer::Nothing,
                }
            }
            _ => {
                let report = Report::MapStart {
                    map: number,
                    header: map.header,
                    encoding: E::MAP_ENCODING,
                };
                self.pending = send(&mut self.encoder, self.frame, &report);
                let checksum = TransferChecksum::new(&map.header);
                Transfer::MapRow { row: 0, checksum }
            }
        }
    }

    /// A list without detections is one frame too: the host knows that nothing was found.
    fn next_detections(&mut self, first: usize) -> Transfer {
        let Some(map) = self.processor.map() else {
            return Transfer::Nothing;
        };
        let all = &self.products.detections;
        let rest = all.get(first..).unwrap_or(&[]);
        // A short row's buffer holds fewer.
        let most = MAX_DETECTIONS.min(self.row.len() / DETECTION_BYTES).max(1);
        let now = rest.get(..most).unwrap_or(rest);
        if let Some(list) = write_detections(now, self.row) {
            let report = Report::Detections {
                map: self.maps.saturating_sub(1),
                sub_cpi: map.header.sub_cpi,
                patch: map.header.patch_index,
                first: first as u16,
                total: all.len() as u16,
                list,
            };
            self.pending = send(&mut self.encoder, self.frame, &report);
        }
        match first.saturating_add(most) {
            next if next < all.len() => Transfer::Detections(next),
            _ => Transfer::Nothing,
        }
    }

    fn next_of_chip(&mut self, transfer: Transfer) -> Transfer {
        let Some(chip) = self.products.chip else {
            return Transfer::Nothing;
        };
        // One chip a run.
        let (number, rows) = (0, chip.grid.num_rows);
        match transfer {
            Transfer::ChipRow { row, mut checksum } => {
                if let Some(samples) = self.products.chip_row(&chip, row, self.row) {
                    checksum.add_row(samples);
                    let report = Report::ChipRow {
                        chip: number,
                        row,
                        samples,
                    };
                    self.pending = send(&mut self.encoder, self.frame, &report);
                }
                match row.wrapping_add(1) {
                    row if row < rows => Transfer::ChipRow { row, checksum },
                    _ => Transfer::ChipEnd { checksum },
                }
            }
            Transfer::ChipEnd { checksum } => {
                let report = Report::ChipEnd {
                    chip: number,
                    rows,
                    crc: checksum.value(),
                };
                self.pending = send(&mut self.encoder, self.frame, &report);
                Transfer::Nothing
            }
            _ => {
                let report = Report::ChipStart {
                    chip: number,
                    grid: chip.grid,
                    maps: chip.maps,
                    weight_sum: chip.weight_sum,
                };
                self.pending = send(&mut self.encoder, self.frame, &report);
                let checksum = TransferChecksum::new(&chip.grid);
                Transfer::ChipRow { row: 0, checksum }
            }
        }
    }
}

/// A row of a map as bytes.
fn row_bytes<'b>(map: &PatchMap<'_>, row: usize, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
    let width = map.header.patch.num_range_bins();
    let samples = row * width..(row + 1) * width;
    match map.samples {
        MapSamples::Float(values) => write_complex32s(values.get(samples)?, buffer),
        MapSamples::Fixed(BlockFloat {
            mantissas,
            exponents,
        }) => {
            let blocks = BlockFloat::blocks(width);
            let exponents = exponents.get(row * blocks..(row + 1) * blocks)?;
            write_block_row(mantissas.get(samples)?, exponents, buffer)
        }
    }
}

/// Writes a frame into the buffer; the place of its bytes.
fn send(encoder: &mut Encoder, buffer: &mut [u8], report: &Report<'_>) -> (usize, usize) {
    // A buffer that is too small leaves the report unsent: the host asks again, or counts a map lost.
    (0, encoder.encode(report, buffer).map_or(0, <[u8]>::len))
}
