//! The module's end of the link: commands in, maps out, without a line of input or output.
//!
//! **What it does.** [`Station`] takes the bytes that came ([`Station::receive`]), gives the bytes that
//! are to go ([`Station::pending`]), and does one bounded piece of work at a time ([`Station::work`]), so
//! that whoever owns the line can see to it in between. It never waits: while the host does not read,
//! the map in hand waits, pulses go on filling the stores, and what finds no room is counted.
//! [`crate::station::Station`] runs on a host too, where the tests put it to the test.
//!
//! **The way of the data.**
//!
//! ```text
//! receive -> frame -> command -> settings | pulse -> processor -> map -> rows -> frame -> pending
//! ```
//!
//! **Order of what goes out**: who it is, refusals, status, and then the map in hand, its detections,
//! the chip. One frame is in the buffer at a time.

use subaperture_core::link::{
    Arithmetic, Command, Encoder, Encoding, Received, Receiver, Refusal, Report, State, Status,
    TransferChecksum, complex32s, f32s, sc16s, write_block_row, write_complex32s,
};
use subaperture_core::stream::{
    BlockFloat, Engine, FloatEngine, MapSamples, PatchMap, Progress, PulseError, Sample,
    SubCpiProcessor,
};
use subaperture_core::{Pulse, link};

/// An engine that can be fed from the wire.
pub trait WireEngine: Engine<Sample: Sample> + Sized {
    /// What the host is told.
    const ARITHMETIC: Arithmetic;
    /// How its maps are sent.
    const MAP_ENCODING: Encoding;

    /// Pushes a pulse; none if this arithmetic takes no such samples.
    fn push(
        processor: &mut SubCpiProcessor<'_, Self>,
        pulse: &Pulse,
        encoding: Encoding,
        samples: &[u8],
    ) -> Option<Result<(), PulseError>>;
}

impl WireEngine for FloatEngine<'_> {
    const ARITHMETIC: Arithmetic = Arithmetic::Float;
    const MAP_ENCODING: Encoding = Encoding::Complex32;

    fn push(
        processor: &mut SubCpiProcessor<'_, Self>,
        pulse: &Pulse,
        encoding: Encoding,
        samples: &[u8],
    ) -> Option<Result<(), PulseError>> {
        Some(match encoding {
            Encoding::Complex32 => processor.push(pulse, complex32s(samples)),
            Encoding::Sc16 => processor.push(pulse, sc16s(samples).map(|z| z.to_complex32())),
        })
    }
}

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
        version: &'static str,
    ) -> Self {
        Self {
            receiver: Receiver::new(buffers.received),
            module: Module {
                processor,
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
                transfer: None,
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

/// A map on its way out.
#[derive(Debug)]
struct Transfer {
    next: Part,
    checksum: TransferChecksum,
}

#[derive(Clone, Copy, Debug)]
enum Part {
    Start,
    Row(u16),
    End,
}

/// Everything but the receiver, from whose buffer commands borrow.
struct Module<'a, E: WireEngine> {
    processor: SubCpiProcessor<'a, E>,
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
    transfer: Option<Transfer>,
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
            Command::Chip(_) | Command::Detect { .. } => Err(Refusal::Unsupported),
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
        self.transfer = None;
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

    fn set_patch(
        &mut self,
        index: u16,
        count: u16,
        patch: &subaperture_core::stream::Patch,
    ) -> Result<(), Refusal> {
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
        self.processor.start(first).map_err(Refusal::Setup)?;
        self.run = Some(run);
        self.maps = 0;
        self.transfer = None;
        self.told_credit = self.processor.accept_through();
        self.state = State::Running;
        Ok(())
    }

    fn abort(&mut self) {
        if self.is_busy() {
            self.processor.stop();
            self.transfer = None;
            self.state = State::Done;
        }
    }

    fn push(&mut self, pulse: &Pulse, encoding: Encoding, samples: &[u8]) -> Result<(), Refusal> {
        if self.state != State::Running {
            // Late ones of a run that is over are no news.
            return Ok(());
        }
        match E::push(&mut self.processor, pulse, encoding, samples) {
            None => Err(Refusal::Encoding),
            Some(Err(PulseError::Length)) if self.processor.counters().refused == 1 => {
                let frequencies = self.processor.setup().map_or(0, |s| s.num_frequencies);
                let expected = usize::from(frequencies) * encoding.sample_bytes();
                Err(Refusal::PulseLength {
                    expected: expected as u32,
                    got: samples.len() as u32,
                })
            }
            // Counted by the processor.
            Some(_) => Ok(()),
        }
    }

    fn work(&mut self) -> bool {
        if self.transfer.is_some() {
            return false;
        }
        match self.processor.work() {
            Progress::Busy => true,
            Progress::Map => {
                if let Some(map) = self.processor.map() {
                    self.transfer = Some(Transfer {
                        next: Part::Start,
                        checksum: TransferChecksum::new(&map.header),
                    });
                }
                true
            }
            Progress::Idle => {
                if self.state == State::Finishing {
                    self.state = State::Done;
                    self.due.status = true;
                }
                false
            }
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

    /// Puts the next part of the map in hand into the buffer.
    fn next_part(&mut self) {
        let Some(transfer) = &mut self.transfer else {
            return;
        };
        let Some(map) = self.processor.map() else {
            self.transfer = None;
            return;
        };
        let rows = map.header.patch.num_doppler_bins() as u16;
        let number = self.maps;
        match transfer.next {
            Part::Start => {
                let report = Report::MapStart {
                    map: number,
                    header: map.header,
                    encoding: E::MAP_ENCODING,
                };
                self.pending = send(&mut self.encoder, self.frame, &report);
                transfer.next = Part::Row(0);
            }
            Part::Row(row) => {
                // A row that does not fit the buffer is left out, and the map's end will not agree.
                if let Some(samples) = row_bytes(&map, row.into(), self.row) {
                    transfer.checksum.add_row(samples);
                    let report = Report::MapRow {
                        map: number,
                        row,
                        samples,
                    };
                    self.pending = send(&mut self.encoder, self.frame, &report);
                }
                transfer.next = match row.wrapping_add(1) {
                    next if next < rows => Part::Row(next),
                    _ => Part::End,
                };
            }
            Part::End => {
                let report = Report::MapEnd {
                    map: number,
                    rows,
                    crc: transfer.checksum.value(),
                };
                self.pending = send(&mut self.encoder, self.frame, &report);
                self.transfer = None;
                self.maps = self.maps.saturating_add(1);
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
