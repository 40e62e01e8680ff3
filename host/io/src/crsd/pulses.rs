//! Per-pulse parameters (PPP) of the transmitted pulses.

use glam::DVec3;

use crate::container::record::{Field, POSITION, SCALAR, WHOLE_AND_FRACTION, Words, record_width};
use crate::container::{Element, MetadataError};

/// Places of the parameters that this reader uses.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// Length of a record, bytes.
    pub(super) num_bytes: u64,
    time: Field,
    position: Field,
    velocity: Field,
    fx1: Field,
    fx2: Field,
    length: Field,
    phase: Field,
    frequency: Field,
    rate: Field,
}

/// One pulse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sent {
    /// Whole seconds and their fraction of its middle.
    pub(super) time: (i64, f64),
    /// ECF, metres.
    pub(super) position: DVec3,
    pub(super) velocity: DVec3,
    pub(super) band_hz: [f64; 2],
    pub(super) wave: Wave,
    /// Turns at the pulse's middle, less whole ones.
    pub(super) phase: f64,
}

/// What a pulse's samples are, but for its phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wave {
    /// Frequency in the middle.
    pub(super) centre_hz: f64,
    pub(super) chirp_hz_s: f64,
    pub(super) length_s: f64,
}

impl Layout {
    pub(super) fn parse(ppp: &Element, num_bytes: &Element) -> Result<Self, MetadataError> {
        let bytes = record_width(num_bytes)?;
        let field = |name: &'static str, format| {
            Field::parse(
                &ppp.child(name)?,
                name,
                format,
                bytes,
                "Data/Transmit/NumBytesPPP",
            )
        };
        Ok(Self {
            num_bytes: bytes,
            time: field("TxTime", WHOLE_AND_FRACTION)?,
            position: field("TxPos", POSITION)?,
            velocity: field("TxVel", POSITION)?,
            fx1: field("FX1", SCALAR)?,
            fx2: field("FX2", SCALAR)?,
            length: field("TXmt", SCALAR)?,
            phase: field("PhiX0", WHOLE_AND_FRACTION)?,
            frequency: field("FxFreq0", SCALAR)?,
            rate: field("FxRate", SCALAR)?,
        })
    }

    /// Pulse `index` of its record.
    pub(super) fn decode(&self, index: u64, bytes: &[u8]) -> Result<Sent, String> {
        let record = Words {
            kind: "pulse",
            index,
            bytes,
        };
        let scalar = |field| record.finite(field, 0);
        let sent = Sent {
            time: record.whole_and_fraction(self.time)?,
            position: record.position(self.position)?,
            velocity: record.position(self.velocity)?,
            band_hz: [scalar(self.fx1)?, scalar(self.fx2)?],
            wave: Wave {
                centre_hz: scalar(self.frequency)?,
                chirp_hz_s: scalar(self.rate)?,
                length_s: scalar(self.length)?,
            },
            phase: record.whole_and_fraction(self.phase)?.1,
        };
        let Wave {
            centre_hz,
            chirp_hz_s,
            length_s,
        } = sent.wave;
        let fault = |field, value: f64, what: &str| {
            Err(record.fault(field, format!("is {value:?}: {what}")))
        };
        if centre_hz <= 0.0 {
            return fault(self.frequency, centre_hz, "frequencies are positive");
        }
        if length_s <= 0.0 {
            return fault(self.length, length_s, "a pulse lasts some time");
        }
        if chirp_hz_s == 0.0 {
            return fault(self.rate, chirp_hz_s, "a sweep has a rate");
        }
        if sent.band_hz[0] >= sent.band_hz[1] {
            return fault(self.fx1, sent.band_hz[0], "it is not below FX2");
        }
        Ok(sent)
    }
}

impl Wave {
    /// Whether another pulse can be filtered as this one: to a thousandth of a turn everywhere in it.
    pub(super) fn is_as(&self, other: &Self) -> bool {
        let half_s = 0.5 * self.length_s;
        let turns = (self.centre_hz - other.centre_hz).abs() * half_s
            + 0.5 * (self.chirp_hz_s - other.chirp_hz_s).abs() * half_s * half_s;
        let edge_turns = (self.length_s - other.length_s).abs() * self.chirp_hz_s.abs() * half_s;
        turns < 1e-3 && edge_turns < 1e-3
    }
}
