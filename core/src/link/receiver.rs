//! Frame receiver: extracts messages from a byte stream and counts damaged frames.
//!
//! [`Receiver`] decodes COBS into the caller's buffer as bytes arrive. At each zero it checks byte stuffing, CRC,
//! version, message and sequence number, in this order. The message borrows from the buffer; samples are not copied.
//! The result does not depend on how the bytes are split between calls.
//!
//! **Error detection.** A frame is accepted only with a correct CRC. Up to 3 bit errors in a decoded frame shorter
//! than 91 607 bits are always detected (Koopman 2002: Hamming distance 4 of this CRC). Of frames with other damage,
//! including damaged COBS codes, one in `2^32` has a correct CRC by chance. At a hundred damaged frames per second
//! this occurs once in 500 days. A message that then does not deserialise to its last byte is still rejected
//! (`tests/link/frames.rs`).
//!
//! **Sequence numbers** count 1, 2, ... `2^32 - 1`, 1, ... Number 0 is used by every [`Command::Hello`] and
//! [`Report::Identity`] and by nothing else. It resets the count without a loss. This is safe because these two
//! messages change nothing else at the receiver, so that a superfluous one is harmless, and because no other message
//! with number 0 is accepted. Losses before a reset, and before the first frame ever received, are unknown and not
//! counted. A number ahead of the expected one by less than half the cycle counts the frames in between as lost. A
//! number behind is dropped as repeated. A serial line neither repeats nor reorders, so such a number means that the
//! peer restarted and its opening message was lost. The host then sends [`Command::Hello`].
//!
//! **Cost**: the buffer ([`super::max_received_bytes`]) and about 60 bytes; operations linear in the number of bytes.
//! **Errors**: [`Damage`]; reception continues with the next frame.
//!
//! [`Command::Hello`]: super::Command::Hello
//! [`Report::Identity`]: super::Report::Identity

use core::fmt;

use cobs::{DecodeResult, DecoderState};
use serde::{Deserialize, Serialize};

use super::frame::{CRC, HEAD_BYTES, Message, PROTOCOL_VERSION, successor};

/// Frame counters of a link. Counts saturate.
///
/// A damaged zero joins two frames and an inserted zero splits one, so `corrupt`, `malformed` and `too_long` count
/// pieces between zeros. `lost` counts frames: between two accepted frames `sent = frames + lost`, as long as both
/// sides have the same messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinkCounters {
    /// Frames accepted.
    pub frames: u32,
    /// Frames with a wrong CRC.
    pub corrupt: u32,
    /// Frames with invalid byte stuffing, a length that is too short, or an unknown or invalid message.
    pub malformed: u32,
    /// Frames longer than the receiver's buffer.
    pub too_long: u32,
    /// Frames with a correct CRC but a different protocol version.
    pub version: u32,
    /// Frames missing in the sequence.
    pub lost: u32,
    /// Frames dropped because their number is behind in the sequence.
    pub repeated: u32,
}

/// Reason why a frame was rejected. It is counted in [`LinkCounters`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Damage {
    /// Wrong CRC.
    Corrupt,
    /// Invalid byte stuffing, too short, an unknown or invalid message, an opening message with a number other than 0, or
    /// another message with number 0.
    Malformed,
    /// Longer than the receiver's buffer.
    TooLong,
    /// Intact frame of a different protocol version, given here.
    Version(u8),
    /// Sequence number, given here, that is behind the expected one.
    Repeated(u32),
}

/// Accepted frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Received<M> {
    /// Sequence number.
    pub sequence: u32,
    /// Number of frames lost immediately before this one.
    pub lost: u32,
    /// Message, borrowed from the receiver's buffer.
    pub message: M,
}

/// Receiver that extracts frames from a stream of bytes.
///
/// ```
/// use subaperture_core::link::{Command, Encoder, Receiver};
/// let (mut wire, mut buffer) = ([0; 32], [0; 64]);
/// let mut receiver = Receiver::new(&mut buffer);
/// let mut bytes = Encoder::new().encode(&Command::Start { run: 7, first: 0 }, &mut wire)?;
/// let frame = receiver.receive::<Command>(&mut bytes).expect("a whole frame")?;
/// assert_eq!(frame.message, Command::Start { run: 7, first: 0 });
/// assert_eq!(receiver.counters().frames, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Receiver<'b> {
    buffer: &'b mut [u8],
    /// Number of decoded bytes of the current frame.
    len: usize,
    stuffing: DecoderState,
    /// The frame exceeds the buffer: discard up to the next zero.
    overrun: bool,
    /// Expected sequence number. `None` before the first frame.
    expected: Option<u32>,
    counters: LinkCounters,
}

impl<'b> Receiver<'b> {
    /// Create a receiver in its initial state. Frames that exceed `buffer` after decoding
    /// ([`super::max_received_bytes`]) are counted as too long.
    pub const fn new(buffer: &'b mut [u8]) -> Self {
        Self {
            buffer,
            len: 0,
            stuffing: DecoderState::Idle,
            overrun: false,
            expected: None,
            counters: LinkCounters {
                frames: 0,
                corrupt: 0,
                malformed: 0,
                too_long: 0,
                version: 0,
                lost: 0,
                repeated: 0,
            },
        }
    }

    /// Frame counters since construction.
    pub fn counters(&self) -> &LinkCounters {
        &self.counters
    }

    /// Process one byte. Returns a frame or its damage if the byte terminates one.
    pub fn push<'s, M>(&'s mut self, byte: u8) -> Option<Result<Received<M>, Damage>>
    where
        M: Message + Deserialize<'s>,
    {
        match self.advance(byte)? {
            Ok(len) => Some(self.decode(len)),
            Err(damage) => Some(Err(damage)),
        }
    }

    /// Consume bytes from the front of `bytes` up to the end of a frame, or all of them. Call until it returns `None`.
    pub fn receive<'s, M>(&'s mut self, bytes: &mut &[u8]) -> Option<Result<Received<M>, Damage>>
    where
        M: Message + Deserialize<'s>,
    {
        while let Some((byte, rest)) = bytes.split_first() {
            *bytes = rest;
            match self.advance(*byte) {
                None => {}
                Some(Ok(len)) => return Some(self.decode(len)),
                Some(Err(damage)) => return Some(Err(damage)),
            }
        }
        None
    }

    /// Decode one byte. Returns the decoded length at the end of a frame.
    fn advance(&mut self, byte: u8) -> Option<Result<usize, Damage>> {
        if self.overrun {
            if byte != 0 {
                return None;
            }
            self.reset();
            increase(&mut self.counters.too_long, 1);
            return Some(Err(Damage::TooLong));
        }
        match self.stuffing.feed(byte) {
            // A code, or a zero between frames.
            Ok(DecodeResult::NoData | DecodeResult::DataStart) => None,
            Ok(DecodeResult::DataContinue(plain)) => {
                match self.buffer.get_mut(self.len) {
                    Some(place) => {
                        *place = plain;
                        self.len = self.len.wrapping_add(1);
                    }
                    None => self.overrun = true,
                }
                None
            }
            Ok(DecodeResult::DataComplete) => {
                let len = self.len;
                self.reset();
                Some(Ok(len))
            }
            // A zero inside a COBS block.
            Err(_) => {
                self.reset();
                increase(&mut self.counters.malformed, 1);
                Some(Err(Damage::Malformed))
            }
        }
    }

    /// Prepare for the first byte of the next frame.
    fn reset(&mut self) {
        self.stuffing = DecoderState::Idle;
        self.len = 0;
        self.overrun = false;
    }

    /// Check the frame in the first `len` bytes of the buffer and count it.
    fn decode<'s, M>(&'s mut self, len: usize) -> Result<Received<M>, Damage>
    where
        M: Message + Deserialize<'s>,
    {
        let counters = &mut self.counters;
        let result = check(self.buffer.get(..len), &mut self.expected);
        let counter = match &result {
            Ok(received) => {
                increase(&mut counters.lost, received.lost);
                &mut counters.frames
            }
            Err((damage, lost)) => {
                increase(&mut counters.lost, *lost);
                match damage {
                    Damage::Corrupt => &mut counters.corrupt,
                    Damage::Malformed => &mut counters.malformed,
                    Damage::TooLong => &mut counters.too_long,
                    Damage::Version(_) => &mut counters.version,
                    Damage::Repeated(_) => &mut counters.repeated,
                }
            }
        };
        increase(counter, 1);
        result.map_err(|(damage, _)| damage)
    }
}

/// Message of a decoded frame, or its damage and the number of frames lost before it.
fn check<'s, M>(
    frame: Option<&'s [u8]>,
    expected: &mut Option<u32>,
) -> Result<Received<M>, (Damage, u32)>
where
    M: Message + Deserialize<'s>,
{
    let short = (Damage::Malformed, 0);
    let (body, crc) = frame.and_then(|all| all.split_last_chunk()).ok_or(short)?;
    let (head, payload) = body.split_first_chunk::<HEAD_BYTES>().ok_or(short)?;
    let [version, sequence @ ..] = *head;
    if CRC.checksum(body) != u32::from_le_bytes(*crc) {
        return Err((Damage::Corrupt, 0));
    }
    if version != PROTOCOL_VERSION {
        return Err((Damage::Version(version), 0));
    }
    let sequence = u32::from_le_bytes(sequence);
    let message = match postcard::take_from_bytes::<M>(payload) {
        Ok((message, [])) if message.opens() == (sequence == 0) => Some(message),
        _ => None,
    };
    let lost = if sequence == 0 {
        0
    } else {
        let ahead = expected.map_or(0, |expected| distance(expected, sequence));
        if ahead > u32::MAX / 2 {
            return Err((Damage::Repeated(sequence), 0));
        }
        ahead
    };
    // An intact frame advances the sequence even if its message is unknown. Only a valid opening message resets
    // the count.
    if sequence != 0 || message.is_some() {
        *expected = Some(successor(sequence));
    }
    match message {
        Some(message) => Ok(Received {
            sequence,
            lost,
            message,
        }),
        None => Err((Damage::Malformed, lost)),
    }
}

/// Number of [`successor`] steps from `from` to `to`, neither of them 0.
fn distance(from: u32, to: u32) -> u32 {
    let steps = to.wrapping_sub(from);
    // The cycle skips 0.
    if to < from {
        steps.wrapping_sub(1)
    } else {
        steps
    }
}

fn increase(counter: &mut u32, by: u32) {
    *counter = counter.saturating_add(by);
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Corrupt => f.write_str("frame with a wrong checksum"),
            Self::Malformed => f.write_str("malformed frame between two zero bytes"),
            Self::TooLong => f.write_str("frame longer than the receive buffer"),
            Self::Version(version) => write!(
                f,
                "frame of protocol version {version}: expected version {PROTOCOL_VERSION}"
            ),
            Self::Repeated(sequence) => write!(
                f,
                "frame {sequence} is behind in the sequence: a repeated frame, or the peer restarted \
                 and needs a Hello"
            ),
        }
    }
}

impl core::error::Error for Damage {}

#[cfg(test)]
mod tests {
    use super::{distance, successor};

    #[test]
    fn sequence_numbers_skip_zero_on_wraparound() {
        assert_eq!(successor(u32::MAX), 1);
        assert_eq!(distance(u32::MAX, 1), 1);
        assert_eq!(distance(5, 5), 0);
        assert_eq!(distance(5, 9), 4);
        // One step back is the whole cycle of 2^32 - 1 less one.
        assert_eq!(distance(5, 4), u32::MAX - 1);
        assert_eq!(distance(1, u32::MAX), u32::MAX - 1);
    }
}
