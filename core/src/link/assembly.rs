//! Maps and chips put together again from their frames.
//!
//! **What it does.** [`MapAssembly`] and [`ChipAssembly`] take every report and keep the rows of the one
//! map or chip that is under way in the caller's buffer. It is handed out only if its start, every
//! row in order, and its end came, of the lengths that the start promised and with the checksum of the
//! end. Anything else is lost, and counted once.
//!
//! **Numbers.** Maps of a run are numbered 0, 1, ...; so one of which nothing came is noticed with the
//! next, or at the run's end by [`MapAssembly::finish`]: `complete + lost` is then the number of maps
//! that the module made. Reports of a map that has been decided are ignored.
//!
//! **Cost.** The buffer: a map's rows as sent, `8 (2 range_reach + 1)(2 doppler_reach + 1)` bytes for
//! [`Encoding::Complex32`]; about 250 bytes of state. **Errors**: [`Loss`].

use core::fmt;

use crc::Digest;
use postcard::ser_flavors::Flavor;
use serde::Serialize;

use super::frame::CRC;
use super::{ChipGrid, Encoding, Report, Row, row_bytes};
use crate::stream::MapHeader;

/// Checksum of a transfer: CRC-32/ISO-HDLC of the postcard bytes of what the rows are of (a
/// [`MapHeader`] or a [`ChipGrid`]), then of the bytes of all rows in order.
#[derive(Clone)]
pub struct TransferChecksum(Digest<'static, u32>);

impl TransferChecksum {
    /// Of what the rows are of.
    pub fn new(subject: &impl Serialize) -> Self {
        // Neither a header nor a grid can fail to serialise into a checksum.
        Self(
            postcard::serialize_with_flavor(subject, DigestOnly(CRC.digest()))
                .unwrap_or_else(|_| CRC.digest()),
        )
    }

    /// Goes on with a row.
    pub fn add_row(&mut self, samples: &[u8]) {
        self.0.update(samples);
    }

    /// The value.
    pub fn value(&self) -> u32 {
        self.0.clone().finalize()
    }
}

impl fmt::Debug for TransferChecksum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("TransferChecksum")
            .field(&self.value())
            .finish()
    }
}

/// Sums up what is serialised, and keeps nothing.
struct DigestOnly(Digest<'static, u32>);

impl Flavor for DigestOnly {
    type Output = Digest<'static, u32>;

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.try_extend(&[byte])
    }

    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        self.0.update(bytes);
        Ok(())
    }

    fn finalize(self) -> postcard::Result<Self::Output> {
        Ok(self.0)
    }
}

/// A map or a chip that did not come whole. Those of lower numbers of which nothing came are counted
/// too, without a loss of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Loss {
    /// Its number.
    pub number: u32,
    /// What was wrong first.
    pub cause: LossCause,
}

/// What was wrong with a map or a chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LossCause {
    /// A row or the end came without the start.
    NoStart,
    /// It does not fit the buffer lent for it.
    Room,
    /// A row is missing, came twice or is one too many, or some were missing at the end.
    Rows,
    /// A row is not of the length that the start promised.
    Length,
    /// The checksum at the end is not that of what came.
    Checksum,
}

/// The one transfer under way, and how many came whole.
#[derive(Debug)]
pub(super) struct Transfer<'b, T> {
    buffer: &'b mut [u8],
    open: Option<Open<T>>,
    /// Lowest number that has not been decided.
    next: u32,
    pub(super) complete: u32,
}

/// A transfer whose start has come.
#[derive(Debug)]
struct Open<T> {
    subject: T,
    checksum: TransferChecksum,
    rows: usize,
    row_bytes: usize,
    rows_done: usize,
    len: usize,
}

impl<'b, T: Copy> Transfer<'b, T> {
    pub(super) const fn new(buffer: &'b mut [u8]) -> Self {
        Self {
            buffer,
            open: None,
            next: 0,
            complete: 0,
        }
    }

    /// Whether `number` is still to be decided; what is open of a lower number is lost.
    fn turn_to(&mut self, number: u32) -> bool {
        if number < self.next {
            return false;
        }
        if number > self.next {
            self.next = number;
            self.open = None;
        }
        true
    }

    /// Decides the one that is under way.
    fn decide(&mut self) {
        self.next = self.next.saturating_add(1);
        self.open = None;
    }

    fn lose<R>(&mut self, cause: LossCause) -> Result<R, Loss> {
        let number = self.next;
        self.decide();
        Err(Loss { number, cause })
    }

    pub(super) fn start(
        &mut self,
        number: u32,
        subject: T,
        checksum: TransferChecksum,
        rows: usize,
        row_bytes: Option<usize>,
    ) -> Result<(), Loss> {
        if !self.turn_to(number) {
            return Ok(());
        }
        if self.open.is_some() {
            return self.lose(LossCause::Rows);
        }
        let total = row_bytes.and_then(|bytes| bytes.checked_mul(rows));
        let (Some(row_bytes), true) = (
            row_bytes,
            total.is_some_and(|total| total <= self.buffer.len()),
        ) else {
            return self.lose(LossCause::Room);
        };
        self.open = Some(Open {
            subject,
            checksum,
            rows,
            row_bytes,
            rows_done: 0,
            len: 0,
        });
        Ok(())
    }

    pub(super) fn row(&mut self, number: u32, row: u16, samples: &[u8]) -> Result<(), Loss> {
        if !self.turn_to(number) {
            return Ok(());
        }
        let Some(open) = &mut self.open else {
            return self.lose(LossCause::NoStart);
        };
        if usize::from(row) != open.rows_done || open.rows_done >= open.rows {
            return self.lose(LossCause::Rows);
        }
        if samples.len() != open.row_bytes {
            return self.lose(LossCause::Length);
        }
        let end = open.len.saturating_add(samples.len());
        let Some(place) = self.buffer.get_mut(open.len..end) else {
            return self.lose(LossCause::Room);
        };
        // Of one length: `copy_from_slice` would check it again and could panic.
        for (place, byte) in place.iter_mut().zip(samples) {
            *place = *byte;
        }
        open.checksum.add_row(samples);
        open.len = end;
        open.rows_done = open.rows_done.saturating_add(1);
        Ok(())
    }

    /// What the transfer was of, and its bytes.
    pub(super) fn end(
        &mut self,
        number: u32,
        rows: u16,
        crc: u32,
    ) -> Result<Option<(T, &[u8])>, Loss> {
        if !self.turn_to(number) {
            return Ok(None);
        }
        let Some(open) = &self.open else {
            return self.lose(LossCause::NoStart);
        };
        if open.rows_done != open.rows || usize::from(rows) != open.rows {
            return self.lose(LossCause::Rows);
        }
        if open.checksum.value() != crc {
            return self.lose(LossCause::Checksum);
        }
        let (subject, len) = (open.subject, open.len);
        self.decide();
        self.complete = self.complete.saturating_add(1);
        Ok(self.buffer.get(..len).map(|bytes| (subject, bytes)))
    }

    pub(super) fn lost(&self) -> u32 {
        self.next.saturating_sub(self.complete)
    }

    pub(super) fn restart(&mut self) {
        self.open = None;
        self.next = 0;
        self.complete = 0;
    }
}

/// Puts maps together; see the head of this file.
///
/// ```
/// use subaperture_core::link::{
///     Encoding, MapAssembly, Report, TransferChecksum, complex32s, write_complex32s,
/// };
/// use subaperture_core::stream::{MapHeader, Node, Patch};
/// use subaperture_core::Complex32;
///
/// let header = MapHeader {
///     sub_cpi: 4,
///     patch_index: 0,
///     num_pulses: 16,
///     patch: Patch { centre_m: [0.0; 3], range_reach: 1, doppler_reach: 0 },
///     time_s: [0.0, 1.0],
///     weight_sum: 16.0,
///     nodes: [Node::default(); 2],
/// };
/// let row = [Complex32::new(0.0, 1.0); 3];
/// let (mut wire, mut buffer) = ([0; 24], [0; 100]);
/// let samples = write_complex32s(&row, &mut wire).expect("3 samples of 8 bytes");
/// let mut checksum = TransferChecksum::new(&header);
/// checksum.add_row(samples);
///
/// let mut assembly = MapAssembly::new(&mut buffer);
/// let start = Report::MapStart { map: 0, header, encoding: Encoding::Complex32 };
/// assert!(assembly.take(&start)?.is_none());
/// assert!(assembly.take(&Report::MapRow { map: 0, row: 0, samples })?.is_none());
/// let end = Report::MapEnd { map: 0, rows: 1, crc: checksum.value() };
/// let map = assembly.take(&end)?.expect("complete");
/// assert_eq!(map.header.sub_cpi, 4);
/// assert!(map.rows().all(|line| line.values().eq(row)));
/// # Ok::<(), subaperture_core::link::Loss>(())
/// ```
#[derive(Debug)]
pub struct MapAssembly<'b>(Transfer<'b, (MapHeader, Encoding)>);

/// A map that came whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssembledMap<'s> {
    /// Its number in the run.
    pub map: u32,
    /// What it is of.
    pub header: MapHeader,
    /// How its samples are encoded.
    pub encoding: Encoding,
    /// Its rows as they came.
    pub bytes: &'s [u8],
}

impl<'b> MapAssembly<'b> {
    /// Nothing has come yet. Maps that do not fit `buffer` will be lost.
    pub const fn new(buffer: &'b mut [u8]) -> Self {
        Self(Transfer::new(buffer))
    }

    /// Takes a report; a map if it was the end of one that came whole. Reports of no map are ignored.
    ///
    /// # Errors
    /// [`Loss`], once a map; those that follow are not affected.
    pub fn take(&mut self, report: &Report<'_>) -> Result<Option<AssembledMap<'_>>, Loss> {
        match *report {
            Report::MapStart {
                map,
                header,
                encoding,
            } => {
                let patch = &header.patch;
                let row_bytes = row_bytes(encoding, patch.num_range_bins());
                let checksum = TransferChecksum::new(&header);
                let rows = patch.num_doppler_bins();
                self.0
                    .start(map, (header, encoding), checksum, rows, row_bytes)?;
                Ok(None)
            }
            Report::MapRow { map, row, samples } => {
                self.0.row(map, row, samples)?;
                Ok(None)
            }
            Report::MapEnd { map, rows, crc } => {
                let whole = self.0.end(map, rows, crc)?;
                Ok(whole.map(|((header, encoding), bytes)| AssembledMap {
                    map,
                    header,
                    encoding,
                    bytes,
                }))
            }
            _ => Ok(None),
        }
    }

    /// Maps that came whole.
    pub fn complete(&self) -> u32 {
        self.0.complete
    }

    /// Maps that did not, of numbers up to the highest of which anything came.
    pub fn lost(&self) -> u32 {
        self.0.lost()
    }

    /// The module made `maps` maps ([`super::Status::maps`] of a finished run): those that are not
    /// complete are lost.
    pub fn finish(&mut self, maps: u32) {
        self.0.turn_to(maps);
    }

    /// A new run: numbers and counts begin at 0.
    pub fn restart(&mut self) {
        self.0.restart();
    }
}

impl<'s> AssembledMap<'s> {
    /// Its rows, Doppler bins ascending.
    pub fn rows(&self) -> impl Iterator<Item = Row<'s>> + '_ {
        let width = self.header.patch.num_range_bins();
        let len = row_bytes(self.encoding, width).unwrap_or(usize::MAX);
        self.bytes
            .chunks_exact(len.max(1))
            .filter_map(move |bytes| Row::new(self.encoding, width, bytes))
    }
}

/// Puts chips together; as [`MapAssembly`] does maps.
#[derive(Debug)]
pub struct ChipAssembly<'b>(Transfer<'b, AssembledChip<'static>>);

/// A chip that came whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssembledChip<'s> {
    /// Its number in the run.
    pub chip: u32,
    /// Its pixels' places.
    pub grid: ChipGrid,
    /// Maps that were added up to it.
    pub maps: u32,
    /// Sum of the weights of their pulses.
    pub weight_sum: f32,
    /// Its pixels ([`super::complex32s`]), row by row.
    pub bytes: &'s [u8],
}

impl<'b> ChipAssembly<'b> {
    /// Nothing has come yet. Chips that do not fit `buffer`, 8 bytes a pixel, will be lost.
    pub const fn new(buffer: &'b mut [u8]) -> Self {
        Self(Transfer::new(buffer))
    }

    /// Takes a report; a chip if it was the end of one that came whole. Reports of no chip are ignored.
    ///
    /// # Errors
    /// [`Loss`], once a chip; those that follow are not affected.
    pub fn take(&mut self, report: &Report<'_>) -> Result<Option<AssembledChip<'_>>, Loss> {
        match *report {
            Report::ChipStart {
                chip,
                grid,
                maps,
                weight_sum,
            } => {
                let row_bytes = row_bytes(Encoding::Complex32, grid.num_columns.into());
                let checksum = TransferChecksum::new(&grid);
                let subject = AssembledChip {
                    chip,
                    grid,
                    maps,
                    weight_sum,
                    bytes: &[],
                };
                self.0
                    .start(chip, subject, checksum, grid.num_rows.into(), row_bytes)?;
                Ok(None)
            }
            Report::ChipRow { chip, row, samples } => {
                self.0.row(chip, row, samples)?;
                Ok(None)
            }
            Report::ChipEnd { chip, rows, crc } => {
                let whole = self.0.end(chip, rows, crc)?;
                Ok(whole.map(|(subject, bytes)| AssembledChip { bytes, ..subject }))
            }
            _ => Ok(None),
        }
    }

    /// Chips that came whole.
    pub fn complete(&self) -> u32 {
        self.0.complete
    }

    /// Chips that did not, of numbers up to the highest of which anything came.
    pub fn lost(&self) -> u32 {
        self.0.lost()
    }

    /// A new run: numbers and counts begin at 0.
    pub fn restart(&mut self) {
        self.0.restart();
    }
}
