//! Per-pulse parameters (PPP) of the transmitted pulses.

use glam::DVec3;

use crate::container::record::{Field, POSITION, SCALAR, WHOLE_AND_FRACTION, Words, record_width};
use crate::container::{Element, MetadataError};

/// Positions of the parameters that are read.
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

/// Transmitted pulse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sent {
    /// Time of the pulse's middle: whole seconds and fraction.
    pub(super) time: (i64, f64),
    /// ECF position in metres.
    pub(super) position: DVec3,
    pub(super) velocity: DVec3,
    pub(super) band_hz: [f64; 2],
    pub(super) wave: Wave,
    /// Phase at the pulse's middle in turns, fractional part.
    pub(super) phase: f64,
}

/// Waveform of a pulse, without its phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wave {
    /// Centre frequency in hertz.
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

    /// Decode pulse `index` from its record.
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
            Err(record.fault(field, format!("{what}, found {value:?}")))
        };
        if centre_hz <= 0.0 {
            return fault(self.frequency, centre_hz, "expected a positive frequency");
        }
        if length_s <= 0.0 {
            return fault(self.length, length_s, "expected a positive duration");
        }
        if chirp_hz_s == 0.0 {
            return fault(self.rate, chirp_hz_s, "expected a rate other than 0");
        }
        if sent.band_hz[0] >= sent.band_hz[1] {
            return fault(self.fx1, sent.band_hz[0], "expected a value below FX2");
        }
        Ok(sent)
    }
}

impl Wave {
    /// Whether both waveforms can use one filter: equal within a thousandth of a turn over the pulse.
    pub(super) fn is_as(&self, other: &Self) -> bool {
        let half_s = 0.5 * self.length_s;
        let turns = (self.centre_hz - other.centre_hz).abs() * half_s
            + 0.5 * (self.chirp_hz_s - other.chirp_hz_s).abs() * half_s * half_s;
        let edge_turns = (self.length_s - other.length_s).abs() * self.chirp_hz_s.abs() * half_s;
        turns < 1e-3 && edge_turns < 1e-3
    }
}
