//! Frame of one pulse, as a radar transceiver's processor or an FPGA sends it to the module.
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 4 | synchronisation: A5 5A F0 0F |
//! | 4 | 4 | pulse number, little endian |
//! | 8 | 2 | number of samples `N`, little endian |
//! | 10 | 2 | order of the parts: 0 in-phase first, 1 quadrature first, little endian |
//! | 12 | 4 N | samples: two parts of 16 bits each, two's complement, little endian |
//! | 12 + 4 N | 4 | CRC-32/ISO-HDLC (as in zlib) of the bytes from 4 on, little endian |
//!
//! Both orders occur: transceivers of the AWR family send either, by a setting of theirs. The synchronisation may occur within the
//! samples; the CRC distinguishes frames from such a coincidence.

use subaperture_core::link::CRC;

/// First bytes of a frame.
pub const SYNC: [u8; 4] = [0xA5, 0x5A, 0xF0, 0x0F];

/// Bytes before the samples.
pub const HEAD_BYTES: usize = 12;

/// Bytes of a frame of `num_samples` samples.
pub const fn frame_bytes(num_samples: usize) -> usize {
    HEAD_BYTES + 4 * num_samples + 4
}

/// Order of the two parts of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// In-phase part, then quadrature part.
    InPhaseFirst,
    /// Quadrature part, then in-phase part.
    QuadratureFirst,
}

/// Head of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    /// Pulse number, counted by the sender.
    pub number: u32,
    /// Number of complex samples.
    pub num_samples: u16,
    /// Order of the two parts of a sample.
    pub order: Order,
}

impl Head {
    /// Parse the head of a frame. `None` if it is not one.
    pub fn parse(bytes: &[u8; HEAD_BYTES]) -> Option<Self> {
        let [a, b, c, d, n0, n1, n2, n3, s0, s1, o0, o1] = *bytes;
        if [a, b, c, d] != SYNC {
            return None;
        }
        Some(Self {
            number: u32::from_le_bytes([n0, n1, n2, n3]),
            num_samples: u16::from_le_bytes([s0, s1]),
            order: match u16::from_le_bytes([o0, o1]) {
                0 => Order::InPhaseFirst,
                1 => Order::QuadratureFirst,
                _ => return None,
            },
        })
    }

    /// Bytes of the frame.
    pub fn frame_bytes(&self) -> usize {
        frame_bytes(self.num_samples.into())
    }
}

/// Whether the last four bytes of a frame are its CRC.
pub(super) fn is_intact(frame: &[u8]) -> bool {
    frame
        .get(SYNC.len()..)
        .and_then(|checked| checked.split_last_chunk())
        .is_some_and(|(checked, crc)| CRC.checksum(checked) == u32::from_le_bytes(*crc))
}

/// Write the frame of a pulse: `samples` of 4 bytes each in the given order. `None` if `buffer` is too short, or `samples` are
/// more than 65 535 or incomplete.
pub fn write<'b>(
    number: u32,
    order: Order,
    samples: &[u8],
    buffer: &'b mut [u8],
) -> Option<&'b [u8]> {
    if !samples.len().is_multiple_of(4) {
        return None;
    }
    let num_samples = u16::try_from(samples.len() / 4).ok()?;
    let bytes = buffer.get_mut(..frame_bytes(num_samples.into()))?;
    let (head, rest) = bytes.split_first_chunk_mut::<HEAD_BYTES>()?;
    let ([a, b, c, d], [n0, n1, n2, n3]) = (SYNC, number.to_le_bytes());
    let [s0, s1] = num_samples.to_le_bytes();
    let order = u8::from(order == Order::QuadratureFirst);
    *head = [a, b, c, d, n0, n1, n2, n3, s0, s1, order, 0];
    let (body, crc) = rest.split_last_chunk_mut::<4>()?;
    body.copy_from_slice(samples);
    let mut digest = CRC.digest();
    digest.update(head.get(SYNC.len()..)?);
    digest.update(body);
    *crc = digest.finalize().to_le_bytes();
    Some(bytes)
}
