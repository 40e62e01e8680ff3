//! Reassembly of maps and image chips from frames.
//!
//! [`MapAssembly`] and [`ChipAssembly`] accept every report and store the rows of the current map or chip in the
//! caller's buffer. A map is returned only if its start, every row in order, and its end were received, with the
//! lengths stated by the start and the checksum stated by the end. Otherwise it is lost and counted once.
//!
//! **Numbering.** The maps of a run are numbered 0, 1, ... A map without any received report is therefore noticed
//! with the next map, or at the end of the run by [`MapAssembly::finish`]: `complete + lost` is then the number of
//! maps that the module formed. Further reports of a completed or lost map are ignored.
//!
//! **Memory**: the buffer must hold the rows as sent, `8 (2 range_reach + 1)(2 doppler_reach + 1)` bytes for
//! [`Encoding::Complex32`]; the state takes about 250 bytes. **Errors**: [`Loss`].

use core::fmt;

use crc::Digest;
use postcard::ser_flavors::Flavor;
use serde::Serialize;

use super::frame::CRC;
use num_complex::Complex32;

use super::{
    CHIP_PART_PIXELS, ChipGrid, Encoding, PixelEncoding, Report, Row, pixel_bytes, row_bytes,
};
use crate::stream::MapHeader;

/// Checksum of a transfer: CRC-32/ISO-HDLC over the postcard encoding of the header (a [`MapHeader`] or a
/// [`ChipGrid`]), followed by the bytes of all rows in order.
#[derive(Clone)]
pub struct TransferChecksum(Digest<'static, u32>);

impl TransferChecksum {
    /// Start a checksum with the header of the transfer.
    pub fn new(subject: &impl Serialize) -> Self {
        // Serialising a header or a grid into a checksum cannot fail.
        Self(
            postcard::serialize_with_flavor(subject, DigestOnly(CRC.digest()))
                .unwrap_or_else(|_| CRC.digest()),
        )
    }

    /// Add the bytes of a row.
    pub fn add_row(&mut self, samples: &[u8]) {
        self.0.update(samples);
    }

    /// Checksum of everything added so far.
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

/// Serialiser output that updates a checksum and stores nothing.
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

/// Map or chip that was received only in part. Lower-numbered maps and chips that are missing entirely are counted
/// too, but have no `Loss` of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Loss {
    /// Number of the map or chip in the run.
    pub number: u32,
    /// First fault found.
    pub cause: LossCause,
}

/// Reason why a map or chip was lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum LossCause {
    /// A row or the end was received without the start.
    NoStart,
    /// The map or chip exceeds the caller's buffer.
    Room,
    /// A row is missing, repeated or out of order, or the number of rows is wrong.
    Rows,
    /// The length of a row differs from the length stated by the start.
    Length,
    /// The checksum of the end does not match the received bytes.
    Checksum,
}

/// Transfer in progress and the number of completed ones.
#[derive(Debug)]
pub(super) struct Transfer<'b, T> {
    buffer: &'b mut [u8],
    open: Option<Open<T>>,
    /// Lowest number that is neither complete nor lost.
    next: u32,
    pub(super) complete: u32,
}

/// Transfer whose start was received.
#[derive(Debug)]
struct Open<T> {
    subject: T,
    checksum: TransferChecksum,
    rows: usize,
    row_bytes: usize,
    /// Bytes of all rows: the last one may be shorter.
    total_bytes: usize,
    rows_done: usize,
    len: usize,
}

/// Rows of a transfer: their number, the bytes of each except the last, and of all.
#[derive(Clone, Copy)]
pub(super) struct Rows {
    pub(super) count: usize,
    pub(super) row_bytes: usize,
    pub(super) total_bytes: usize,
}

impl Rows {
    /// Rows of equal length. `None` on overflow.
    pub(super) fn equal(count: usize, row_bytes: Option<usize>) -> Option<Self> {
        let row_bytes = row_bytes?;
        Some(Self {
            count,
            row_bytes,
            total_bytes: row_bytes.checked_mul(count)?,
        })
    }
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

    /// Whether `number` is still pending. An open transfer of a lower number is lost.
    fn advance_to(&mut self, number: u32) -> bool {
        if number < self.next {
            return false;
        }
        if number > self.next {
            self.next = number;
            self.open = None;
        }
        true
    }

    /// Close the current transfer, complete or lost.
    fn close(&mut self) {
        self.next = self.next.saturating_add(1);
        self.open = None;
    }

    fn fail<R>(&mut self, cause: LossCause) -> Result<R, Loss> {
        let number = self.next;
        self.close();
        Err(Loss { number, cause })
    }

    pub(super) fn start(
        &mut self,
        number: u32,
        subject: T,
        checksum: TransferChecksum,
        rows: Option<Rows>,
    ) -> Result<(), Loss> {
        if !self.advance_to(number) {
            return Ok(());
        }
        if self.open.is_some() {
            return self.fail(LossCause::Rows);
        }
        let Some(rows) = rows.filter(|rows| rows.total_bytes <= self.buffer.len()) else {
            return self.fail(LossCause::Room);
        };
        self.open = Some(Open {
            subject,
            checksum,
            rows: rows.count,
            row_bytes: rows.row_bytes,
            total_bytes: rows.total_bytes,
            rows_done: 0,
            len: 0,
        });
        Ok(())
    }

    pub(super) fn row(&mut self, number: u32, row: u16, samples: &[u8]) -> Result<(), Loss> {
        if !self.advance_to(number) {
            return Ok(());
        }
        let Some(open) = &mut self.open else {
            return self.fail(LossCause::NoStart);
        };
        if usize::from(row) != open.rows_done || open.rows_done >= open.rows {
            return self.fail(LossCause::Rows);
        }
        let rest = open.total_bytes.saturating_sub(open.len);
        if samples.len() != open.row_bytes.min(rest) {
            return self.fail(LossCause::Length);
        }
        let end = open.len.saturating_add(samples.len());
        let Some(place) = self.buffer.get_mut(open.len..end) else {
            return self.fail(LossCause::Room);
        };
        // Equal lengths: `copy_from_slice` would check them again and could panic.
        for (place, byte) in place.iter_mut().zip(samples) {
            *place = *byte;
        }
        open.checksum.add_row(samples);
        open.len = end;
        open.rows_done = open.rows_done.saturating_add(1);
        Ok(())
    }

    /// Header and bytes of a completed transfer.
    pub(super) fn end(
        &mut self,
        number: u32,
        rows: u16,
        crc: u32,
    ) -> Result<Option<(T, &[u8])>, Loss> {
        if !self.advance_to(number) {
            return Ok(None);
        }
        let Some(open) = &self.open else {
            return self.fail(LossCause::NoStart);
        };
        if open.rows_done != open.rows || usize::from(rows) != open.rows {
            return self.fail(LossCause::Rows);
        }
        if open.checksum.value() != crc {
            return self.fail(LossCause::Checksum);
        }
        let (subject, len) = (open.subject, open.len);
        self.close();
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

/// Reassembly of maps. See the module documentation.
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
///     channel: 0,
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

/// Completely received map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssembledMap<'s> {
    /// Number of the map in the run.
    pub map: u32,
    /// Sub-CPI, patch and geometry of the map.
    pub header: MapHeader,
    /// Encoding of the samples.
    pub encoding: Encoding,
    /// Rows as received.
    pub bytes: &'s [u8],
}

impl<'b> MapAssembly<'b> {
    /// Create an assembly without received data. Maps that exceed `buffer` will be lost.
    pub const fn new(buffer: &'b mut [u8]) -> Self {
        Self(Transfer::new(buffer))
    }

    /// Process a report. Returns a map if the report completes it. Reports that do not belong to a map are ignored.
    ///
    /// # Errors
    /// [`Loss`], at most once per map. Later maps are not affected.
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
                let rows = Rows::equal(rows, row_bytes);
                self.0.start(map, (header, encoding), checksum, rows)?;
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

    /// Number of complete maps.
    pub fn complete(&self) -> u32 {
        self.0.complete
    }

    /// Number of lost maps, up to the highest map number received.
    pub fn lost(&self) -> u32 {
        self.0.lost()
    }

    /// Count missing maps at the end of a run. `maps` is the number of maps the module formed
    /// ([`super::Status::maps`] of a finished run).
    pub fn finish(&mut self, maps: u32) {
        self.0.advance_to(maps);
    }

    /// Start a new run: map numbers and counts start at 0.
    pub fn restart(&mut self) {
        self.0.restart();
    }
}

impl<'s> AssembledMap<'s> {
    /// Rows of the map in ascending Doppler order.
    pub fn rows(&self) -> impl Iterator<Item = Row<'s>> + '_ {
        let width = self.header.patch.num_range_bins();
        let len = row_bytes(self.encoding, width).unwrap_or(usize::MAX);
        self.bytes
            .chunks_exact(len.max(1))
            .filter_map(move |bytes| Row::new(self.encoding, width, bytes))
    }
}

/// Reassembly of image chips, like [`MapAssembly`] for maps.
#[derive(Debug)]
pub struct ChipAssembly<'b>(Transfer<'b, AssembledChip<'static>>);

/// Completely received image chip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssembledChip<'s> {
    /// Number of the transfer in the configuration.
    pub chip: u32,
    /// Pixel grid of the chip.
    pub grid: ChipGrid,
    /// Number of maps accumulated into the chip.
    pub maps: u32,
    /// Sum of the slow-time weights of the accumulated pulses.
    pub weight_sum: f32,
    /// Number of contributions left out because the pixel lies outside the map.
    pub left_out: u32,
    /// Encoding of the pixels.
    pub encoding: PixelEncoding,
    /// Bytes of the pixels as received ([`AssembledChip::pixels`]).
    pub bytes: &'s [u8],
}

impl<'s> AssembledChip<'s> {
    /// Pixels, row-major.
    pub fn pixels(&self) -> impl Iterator<Item = Complex32> + 's {
        let (encoding, pixels) = (self.encoding, self.grid.num_pixels());
        let len = pixel_bytes(encoding, CHIP_PART_PIXELS).unwrap_or(usize::MAX);
        let parts = self.bytes.chunks(len).enumerate();
        parts
            .filter_map(move |(part, bytes)| {
                let before = part.checked_mul(CHIP_PART_PIXELS)?;
                let width = pixels.checked_sub(before)?.min(CHIP_PART_PIXELS);
                Row::of_pixels(encoding, width, bytes)
            })
            .flat_map(|row| row.values())
    }
}

/// Parts of a chip of this many pixels.
fn chip_parts(encoding: PixelEncoding, pixels: usize) -> Option<Rows> {
    let last = pixels % CHIP_PART_PIXELS;
    let row_bytes = pixel_bytes(encoding, CHIP_PART_PIXELS)?;
    let whole = row_bytes.checked_mul(pixels / CHIP_PART_PIXELS)?;
    Some(Rows {
        count: pixels.div_ceil(CHIP_PART_PIXELS),
        row_bytes,
        total_bytes: whole.checked_add(pixel_bytes(encoding, last)?)?,
    })
}

impl<'b> ChipAssembly<'b> {
    /// Create an assembly without received data. Chips that exceed `buffer` (8 bytes per pixel) will be lost.
    pub const fn new(buffer: &'b mut [u8]) -> Self {
        Self(Transfer::new(buffer))
    }

    /// Process a report. Returns a chip if the report completes it. Reports that do not belong to a chip are ignored.
    ///
    /// # Errors
    /// [`Loss`], at most once per chip. Later chips are not affected.
    pub fn take(&mut self, report: &Report<'_>) -> Result<Option<AssembledChip<'_>>, Loss> {
        match *report {
            Report::ChipStart {
                chip,
                grid,
                maps,
                weight_sum,
                left_out,
                encoding,
            } => {
                let checksum = TransferChecksum::new(&grid);
                let subject = AssembledChip {
                    chip,
                    grid,
                    maps,
                    weight_sum,
                    left_out,
                    encoding,
                    bytes: &[],
                };
                let rows = chip_parts(encoding, grid.num_pixels());
                self.0.start(chip, subject, checksum, rows)?;
                Ok(None)
            }
            Report::ChipPart {
                chip,
                part,
                samples,
            } => {
                self.0.row(chip, part, samples)?;
                Ok(None)
            }
            Report::ChipEnd { chip, parts, crc } => {
                let whole = self.0.end(chip, parts, crc)?;
                Ok(whole.map(|(subject, bytes)| AssembledChip { bytes, ..subject }))
            }
            _ => Ok(None),
        }
    }

    /// Number of complete chips.
    pub fn complete(&self) -> u32 {
        self.0.complete
    }

    /// Number of lost chips, up to the highest chip number received.
    pub fn lost(&self) -> u32 {
        self.0.lost()
    }

    /// Start a new configuration: chip numbers and counts start at 0.
    pub fn restart(&mut self) {
        self.0.restart();
    }
}
