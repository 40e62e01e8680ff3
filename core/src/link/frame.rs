//! Frames: their bytes, and the writer of them.
//!
//! **What it does.** [`Encoder`] puts a message between version and sequence number on one side and a
//! CRC on the other, stuffs it by COBS (Cheshire and Baker 1999), so that no byte of it is zero, and
//! ends it with a zero. All in one pass into the caller's buffer: serialiser, CRC and stuffing take
//! byte runs from one another, and nothing is held twice. The table of bytes is at the head of
//! [`crate::link`].
//!
//! **Cost.** 4 bytes of state, 1 KiB of CRC table; operations linear in the frame.
//! **Errors**: [`EncodeError`]; the sequence number is then not used up.

use core::fmt;

use cobs::CobsEncoder;
use crc::{CRC_32_ISO_HDLC, Crc, Digest};
use postcard::ser_flavors::Flavor;
use serde::Serialize;

/// Version of the wire format: first byte of every frame. Any change to a message is a new version; a message or a refusal more, after the others, is none: who does not know it counts its frame as
/// malformed.
pub const PROTOCOL_VERSION: u8 = 1;

/// Version and sequence number.
pub(super) const HEAD_BYTES: usize = 5;

/// Bytes of a frame beside its message, before stuffing: version, sequence number and CRC.
pub const OVERHEAD_BYTES: usize = HEAD_BYTES + 4;

/// Most bytes of a message, samples not counted: their number and pulse count, their text and their
/// detections included.
pub const MAX_MESSAGE_BYTES: usize = 192;

/// CRC-32/ISO-HDLC, that of Ethernet and zlib: polynomial 0x04C11DB7 reflected, all ones before and
/// inverted after; 0xCBF43926 of `123456789`.
pub(super) static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Bytes that a receiver's buffer needs for messages of up to `samples` samples of 8 bytes.
///
/// The module receives pulses: `samples` is the most frequencies of a pulse. The host receives rows:
/// `samples` is the most range bins of a patch, or columns of a chip.
pub const fn max_received_bytes(samples: usize) -> usize {
    OVERHEAD_BYTES + MAX_MESSAGE_BYTES + 8 * samples
}

/// Bytes on the wire of the longest frame with up to `samples` samples of 8 bytes, terminator
/// included: what [`Encoder::encode`] needs.
///
/// ```
/// use subaperture_core::link::max_frame_bytes;
/// // 9 + 192 + 8 * 128 = 1225 bytes, 5 codes (one for each 254 bytes begun) and the terminator.
/// assert_eq!(max_frame_bytes(128), 1231);
/// ```
pub const fn max_frame_bytes(samples: usize) -> usize {
    let bytes = max_received_bytes(samples);
    bytes + bytes.div_ceil(254) + 1
}

/// A message of either direction.
pub trait Message {
    /// Whether it opens a conversation: sent with sequence number 0, which begins the count anew.
    fn opens(&self) -> bool;
}

/// The sequence number after `sequence`: 0 is for opening messages alone, so 1 follows the largest.
pub(super) fn successor(sequence: u32) -> u32 {
    sequence.checked_add(1).unwrap_or(1)
}

/// Writes frames, and keeps the number of the next.
///
/// ```
/// use subaperture_core::link::{Command, Encoder};
/// let (mut encoder, mut buffer) = (Encoder::new(), [0; 32]);
/// // Version 1, sequence number 0, variant 0, CRC-32 of 01 00 00 00 00 00; codes at their places.
/// let bytes = encoder.encode(&Command::Hello, &mut buffer)?;
/// assert_eq!(bytes, [2, 1, 1, 1, 1, 1, 5, 0x06, 0x72, 0x9E, 0x7A, 0]);
/// # Ok::<(), subaperture_core::link::EncodeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Encoder {
    next: u32,
}

impl Encoder {
    /// The next frame has number 1, or 0 if it opens.
    pub const fn new() -> Self {
        Self { next: 1 }
    }

    /// The bytes to send, terminator included; they lie at the start of `buffer`.
    ///
    /// # Errors
    /// See [`EncodeError`]. Nothing has been counted then.
    pub fn encode<'b>(
        &mut self,
        message: &(impl Message + Serialize),
        buffer: &'b mut [u8],
    ) -> Result<&'b [u8], EncodeError> {
        let sequence = if message.opens() { 0 } else { self.next };
        let room = buffer.len();
        let full = EncodeError::Room { room };
        let mut frame = FrameWriter {
            stuffing: CobsEncoder::new(buffer),
            digest: CRC.digest(),
        };
        let written = frame
            .try_push(PROTOCOL_VERSION)
            .and_then(|()| frame.try_extend(&sequence.to_le_bytes()))
            .and_then(|()| postcard::serialize_with_flavor(message, frame));
        let len = match written {
            Ok(len) => len,
            Err(postcard::Error::SerializeBufferFull) => return Err(full),
            Err(_) => return Err(EncodeError::Message),
        };
        *buffer.get_mut(len).ok_or(full)? = 0;
        let bytes = buffer.get(..=len).ok_or(full)?;
        self.next = successor(sequence);
        Ok(bytes)
    }
}

impl Default for Encoder {
    fn default() -> Self {
        Self::new()
    }
}

/// Takes the bytes of a frame in order; gives the length of the stuffed frame, no terminator.
struct FrameWriter<'b> {
    stuffing: CobsEncoder<'b>,
    digest: Digest<'static, u32>,
}

impl FrameWriter<'_> {
    fn stuff(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        self.stuffing
            .push(bytes)
            .map_err(|_| postcard::Error::SerializeBufferFull)
    }
}

impl Flavor for FrameWriter<'_> {
    type Output = usize;

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.try_extend(&[byte])
    }

    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        self.digest.update(bytes);
        self.stuff(bytes)
    }

    fn finalize(mut self) -> postcard::Result<usize> {
        let crc = self.digest.clone().finalize();
        self.stuff(&crc.to_le_bytes())?;
        Ok(self.stuffing.finalize())
    }
}

/// Why a message could not be framed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncodeError {
    /// The frame is longer than the buffer; [`max_frame_bytes`] says what is enough.
    Room {
        /// Bytes that there was room for.
        room: usize,
    },
    /// The message cannot be serialised; none of this module's.
    Message,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Room { room } => write!(
                f,
                "the frame does not fit a buffer of {room} bytes; `max_frame_bytes` says how many \
                 are enough"
            ),
            Self::Message => f.write_str("the message has parts that cannot be serialised"),
        }
    }
}

impl core::error::Error for EncodeError {}
