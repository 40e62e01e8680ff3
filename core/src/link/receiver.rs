//! The reader of frames: bytes in, whole messages out, everything else counted.
//!
//! **What it does.** [`Receiver`] unstuffs into the caller's buffer as bytes come, and at each zero
//! checks what it has: stuffing, CRC, version, message, sequence number, in this order. The message
//! borrows from the buffer; samples are not copied. How the bytes are split between calls makes no
//! difference.
//!
//! **Accuracy.** A frame is accepted only if its CRC is right. Up to 3 wrong bits of an unstuffed frame
//! shorter than 91 607 bits are always seen (Koopman 2002: Hamming distance 4 of this CRC); of other
//! damage, that to the codes of the stuffing included, one frame in `2^32` has a CRC that happens to be
//! right. At a hundred damaged frames a second that is one in 500 days; a message that then
//! does not deserialise to its last byte is refused still (`tests/link/frames.rs`).
//!
//! **Sequence numbers** count 1, 2, ... `2^32 - 1`, 1, ...; 0 is sent with [`Command::Hello`] and
//! [`Report::Identity`] alone and always, and begins the count anew, without a loss. That is safe
//! because these two change nothing at the receiver but this count, so that one too many does no harm,
//! and because nothing else with number 0 is accepted. What was lost before it is not known and not
//! counted; nor is what a peer sent before the first frame that was ever heard of it. A number ahead of
//! the expected one by less than half the cycle counts the frames between as lost; one behind is dropped
//! as repeated. A line neither repeats nor reorders: numbers behind mean a peer that began anew and whose
//! opening message was lost, to which the host answers with [`Command::Hello`].
//!
//! **Cost.** The buffer ([`super::max_received_bytes`]) and about 60 bytes; operations linear in the
//! bytes. **Errors**: [`Damage`]; reception goes on with the next frame.
//!
//! [`Command::Hello`]: super::Command::Hello
//! [`Report::Identity`]: super::Report::Identity

use core::fmt;

use cobs::{DecodeResult, DecoderState};
use serde::{Deserialize, Serialize};

use super::frame::{CRC, HEAD_BYTES, Message, PROTOCOL_VERSION, successor};

/// What has come over a link, in frames. Counts stop at the largest number.
///
/// A damaged zero joins two frames, a new one cuts a frame: `corrupt`, `malformed` and `too_long` count
/// pieces between zeros. `lost` counts frames: between two frames that were accepted,
/// `sent = frames + lost` as long as both sides have the same messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinkCounters {
    /// Accepted.
    pub frames: u32,
    /// Wrong CRC.
    pub corrupt: u32,
    /// Wrong stuffing, too short, or no message of those expected.
    pub malformed: u32,
    /// Longer than the receiver's buffer.
    pub too_long: u32,
    /// Right CRC, another protocol version.
    pub version: u32,
    /// Missing in the sequence.
    pub lost: u32,
    /// Behind in the sequence; dropped.
    pub repeated: u32,
}

/// Why what came before a zero was not accepted. It has been counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Damage {
    /// The CRC is wrong.
    Corrupt,
    /// The stuffing is wrong, or it is too short, or no message of those expected, or an opening one
    /// with a number other than 0, or another with 0.
    Malformed,
    /// It is longer than the receiver's buffer.
    TooLong,
    /// The frame is whole but of this protocol version.
    Version(u8),
    /// Its number, this one, is behind in the sequence.
    Repeated(u32),
}

/// An accepted frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Received<M> {
    /// Its number.
    pub sequence: u32,
    /// Frames lost just before it.
    pub lost: u32,
    /// Its message, borrowed from the receiver's buffer.
    pub message: M,
}

/// Finds frames in a stream of bytes.
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
    /// Unstuffed bytes so far.
    len: usize,
    stuffing: DecoderState,
    /// More has come than fits: discard to the next zero.
    overrun: bool,
    /// Number of the next frame; none before the first.
    expected: Option<u32>,
    counters: LinkCounters,
}

impl<'b> Receiver<'b> {
    /// A receiver that has heard nothing. Frames that do not fit `buffer` unstuffed
    /// ([`super::max_received_bytes`]) will be counted as too long.
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

    /// What has come so far.
    pub fn counters(&self) -> &LinkCounters {
        &self.counters
    }

    /// Takes one byte; a frame or its damage if the byte ends one.
    pub fn push<'s, M>(&'s mut self, byte: u8) -> Option<Result<Received<M>, Damage>>
    where
        M: Message + Deserialize<'s>,
    {
        match self.advance(byte)? {
            Ok(len) => Some(self.open(len)),
            Err(damage) => Some(Err(damage)),
        }
    }

    /// Takes bytes off the front of `bytes` up to the end of a frame, or all of them; call until none.
    pub fn receive<'s, M>(&'s mut self, bytes: &mut &[u8]) -> Option<Result<Received<M>, Damage>>
    where
        M: Message + Deserialize<'s>,
    {
        while let Some((byte, rest)) = bytes.split_first() {
            *bytes = rest;
            match self.advance(*byte) {
                None => {}
                Some(Ok(len)) => return Some(self.open(len)),
                Some(Err(damage)) => return Some(Err(damage)),
            }
        }
        None
    }

    /// Unstuffs a byte; the frame's unstuffed length at its end.
    fn advance(&mut self, byte: u8) -> Option<Result<usize, Damage>> {
        if self.overrun {
            if byte != 0 {
                return None;
            }
            self.begin();
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
                self.begin();
                Some(Ok(len))
            }
            // A zero before its time.
            Err(_) => {
                self.begin();
                increase(&mut self.counters.malformed, 1);
                Some(Err(Damage::Malformed))
            }
        }
    }

    /// Ready for the next frame's first byte.
    fn begin(&mut self) {
        self.stuffing = DecoderState::Idle;
        self.len = 0;
        self.overrun = false;
    }

    /// Checks the frame that the first `len` bytes of the buffer are.
    fn open<'s, M>(&'s mut self, len: usize) -> Result<Received<M>, Damage>
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

/// The message of an unstuffed frame, or its damage and the frames lost before it.
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
    // A frame that is whole has come, whether or not its message means anything here; but only a true
    // opening begins the count anew.
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

/// Steps of [`successor`] from `from` to `to`, neither of them 0.
fn distance(from: u32, to: u32) -> u32 {
    let steps = to.wrapping_sub(from);
    // The cycle has no 0.
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
            Self::Corrupt => f.write_str("a frame's checksum is wrong"),
            Self::Malformed => f.write_str("bytes between two zeros are no frame"),
            Self::TooLong => f.write_str("a frame is longer than the buffer for it"),
            Self::Version(version) => write!(
                f,
                "a frame of protocol version {version}; this side speaks {PROTOCOL_VERSION}"
            ),
            Self::Repeated(sequence) => write!(
                f,
                "frame {sequence} is behind in the sequence: it came before, or the peer began anew \
                 and must be greeted"
            ),
        }
    }
}

impl core::error::Error for Damage {}

#[cfg(test)]
mod tests {
    use super::{distance, successor};

    #[test]
    fn numbers_go_round_without_zero() {
        assert_eq!(successor(u32::MAX), 1);
        assert_eq!(distance(u32::MAX, 1), 1);
        assert_eq!(distance(5, 5), 0);
        assert_eq!(distance(5, 9), 4);
        // One step back is all of the cycle of 2^32 - 1 but one.
        assert_eq!(distance(5, 4), u32::MAX - 1);
        assert_eq!(distance(1, u32::MAX), u32::MAX - 1);
    }
}
