//! Frame format and encoder.
//!
//! [`Encoder`] prefixes a message with version and sequence number, appends a CRC, applies COBS byte stuffing
//! (Cheshire and Baker 1999) so that the frame contains no zero byte, and terminates it with a zero. Everything
//! happens in one pass into the caller's buffer: serialiser, CRC and byte stuffing process the same byte slices and
//! nothing is buffered twice. The frame layout is documented in [`crate::link`].
//!
//! **Cost**: 4 bytes of state, 1 KiB of CRC table; operations linear in the frame length.
//! **Errors**: [`EncodeError`]; the sequence number is then not consumed.

use core::fmt;

use cobs::CobsEncoder;
use crc::{CRC_32_ISO_HDLC, Crc, Digest};
use postcard::ser_flavors::Flavor;
use serde::Serialize;

/// Version of the wire format, first byte of every frame. A changed message requires a new version. A message or
/// refusal appended after the existing ones does not: an older peer counts its frame as malformed.
pub const PROTOCOL_VERSION: u8 = 3;

/// Size of version and sequence number in bytes.
pub(super) const HEAD_BYTES: usize = 5;

/// Bytes of a frame in addition to its message, before byte stuffing: version, sequence number and CRC.
pub const OVERHEAD_BYTES: usize = HEAD_BYTES + 4;

/// Maximum size of a message in bytes without samples, including its variant number, text and detections.
pub const MAX_MESSAGE_BYTES: usize = 192;

/// CRC-32/ISO-HDLC as in Ethernet and zlib: polynomial 0x04C11DB7 reflected, initial value and final XOR all ones;
/// 0xCBF43926 for `123456789`.
pub static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Receiver buffer size in bytes for messages of up to `samples` samples of 8 bytes.
///
/// For the module, which receives pulses, `samples` is the maximum number of frequencies per pulse. For the host,
/// which receives rows, it is the maximum number of range bins of a patch or columns of a chip.
pub const fn max_received_bytes(samples: usize) -> usize {
    OVERHEAD_BYTES + MAX_MESSAGE_BYTES + 8 * samples
}

/// Buffer size in bytes that [`Encoder::encode`] needs for the longest frame with up to `samples` samples of 8 bytes,
/// terminator included.
///
/// ```
/// use subaperture_core::link::max_frame_bytes;
/// // 9 + 192 + 8 * 128 = 1225 bytes, 5 COBS codes (one per 254 bytes or part thereof) and the terminator.
/// assert_eq!(max_frame_bytes(128), 1231);
/// ```
pub const fn max_frame_bytes(samples: usize) -> usize {
    let bytes = max_received_bytes(samples);
    bytes + bytes.div_ceil(254) + 1
}

/// Message of either direction.
pub trait Message {
    /// Whether the message opens a conversation. It then has sequence number 0, which resets the sequence count.
    fn opens(&self) -> bool;
}

/// Sequence number after `sequence`. 0 is reserved for opening messages, so 1 follows the largest.
pub(super) fn successor(sequence: u32) -> u32 {
    sequence.checked_add(1).unwrap_or(1)
}

/// Frame encoder with a sequence counter.
///
/// ```
/// use subaperture_core::link::{Command, Encoder};
/// let (mut encoder, mut buffer) = (Encoder::new(), [0; 32]);
/// // Version 3, sequence number 0, variant 0, CRC-32 of 03 00 00 00 00 00, with the COBS codes in between.
/// let bytes = encoder.encode(&Command::Hello, &mut buffer)?;
/// assert_eq!(bytes, [2, 3, 1, 1, 1, 1, 5, 0x0D, 0xD3, 0x56, 0x37, 0]);
/// # Ok::<(), subaperture_core::link::EncodeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Encoder {
    next: u32,
}

impl Encoder {
    /// Create an encoder. The first frame has number 1, or 0 if its message opens a conversation.
    pub const fn new() -> Self {
        Self { next: 1 }
    }

    /// Encode `message` into `buffer`. Returns the bytes to send, terminator included.
    ///
    /// # Errors
    /// [`EncodeError`]. The sequence number is then not consumed.
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

/// Serialiser output that writes a stuffed frame. Finalises to its length without terminator.
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

/// Reason why a message could not be encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum EncodeError {
    /// The frame is longer than the buffer. [`max_frame_bytes`] returns a sufficient size.
    Room {
        /// Size of the buffer in bytes.
        room: usize,
    },
    /// The message cannot be serialised. Does not occur for the messages of this crate.
    Message,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Room { room } => write!(
                f,
                "frame does not fit a buffer of {room} bytes: use the size that `max_frame_bytes` \
                 returns"
            ),
            Self::Message => f.write_str("message contains a value that cannot be serialised"),
        }
    }
}

impl core::error::Error for EncodeError {}
