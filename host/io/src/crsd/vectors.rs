//! Per-vector parameters of the received signal.

use glam::DVec3;

use crate::container::record::{
    Field, INTEGER, POSITION, SCALAR, WHOLE_AND_FRACTION, Words, record_width,
};
use crate::container::{Element, MetadataError};
use crate::cphd::vectors::scale_fault;

/// Positions of the parameters that are read.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// Length of a record, bytes.
    pub(super) num_bytes: u64,
    start: Field,
    position: Field,
    velocity: Field,
    frcv1: Field,
    frcv2: Field,
    phase: Field,
    frequency: Field,
    offset: Field,
    rate: Field,
    signal: Field,
    scale: Field,
    pulse: Field,
}

/// Received vector.
#[derive(Clone, Copy, Debug)]
pub(super) struct Received {
    /// Time of sample 0: whole seconds and fraction.
    pub(super) start: (i64, f64),
    /// ECF position at that time in metres.
    pub(super) position: DVec3,
    pub(super) velocity: DVec3,
    pub(super) band_hz: [f64; 2],
    /// Phase of the reference signal at sample 0 in turns, fractional part.
    pub(super) phase: f64,
    pub(super) reference_hz: f64,
    /// Scale factor of the samples.
    pub(super) scale: f64,
    /// Index of the transmitted pulse.
    pub(super) pulse: u64,
}

/// Value of SIGNAL for a vector that contains an echo.
const ECHO: i64 = 1;

impl Layout {
    pub(super) fn parse(pvp: &Element, num_bytes: &Element) -> Result<Self, MetadataError> {
        let bytes = record_width(num_bytes)?;
        let field = |name: &'static str, format| {
            Field::parse(
                &pvp.child(name)?,
                name,
                format,
                bytes,
                "Data/Receive/NumBytesPVP",
            )
        };
        Ok(Self {
            num_bytes: bytes,
            start: field("RcvStart", WHOLE_AND_FRACTION)?,
            position: field("RcvPos", POSITION)?,
            velocity: field("RcvVel", POSITION)?,
            frcv1: field("FRCV1", SCALAR)?,
            frcv2: field("FRCV2", SCALAR)?,
            phase: field("RefPhi0", WHOLE_AND_FRACTION)?,
            frequency: field("RefFreq", SCALAR)?,
            offset: field("DFIC0", SCALAR)?,
            rate: field("FICRate", SCALAR)?,
            signal: field("SIGNAL", INTEGER)?,
            scale: field("AmpSF", SCALAR)?,
            pulse: field("TxPulseIndex", INTEGER)?,
        })
    }

    /// Decode vector `index` from its record. `None` if it contains no echo of a pulse: no signal, noise or
    /// calibration.
    pub(super) fn decode(&self, index: u64, bytes: &[u8]) -> Result<Option<Received>, String> {
        let record = Words {
            kind: "vector",
            index,
            bytes,
        };
        let signal = record.integer(self.signal);
        let Ok(pulse) = u64::try_from(record.integer(self.pulse)) else {
            return Ok(None);
        };
        if signal != ECHO {
            return Ok(None);
        }
        let scalar = |field| record.finite(field, 0);
        let received = Received {
            start: record.whole_and_fraction(self.start)?,
            position: record.position(self.position)?,
            velocity: record.position(self.velocity)?,
            band_hz: [scalar(self.frcv1)?, scalar(self.frcv2)?],
            phase: record.whole_and_fraction(self.phase)?.1,
            reference_hz: scalar(self.frequency)?,
            scale: match scalar(self.scale)? {
                scale if scale_fault(scale).is_none() => scale,
                scale => {
                    return Err(format!(
                        "vector {index}: {}",
                        scale_fault(scale).unwrap_or_default()
                    ));
                }
            },
            pulse,
        };
        for (field, value) in [
            (self.offset, scalar(self.offset)?),
            (self.rate, scalar(self.rate)?),
        ] {
            if value != 0.0 {
                return Err(format!(
                    "vector {index}: {} is {value:?}: the received band moves with time (deramping receiver), which is not supported; \
                     convert the file to CPHD 1.1 with its producer's tool",
                    field.name()
                ));
            }
        }
        if received.band_hz[0] >= received.band_hz[1] {
            return Err(record.fault(self.frcv1, "expected a value below FRCV2"));
        }
        Ok(Some(received))
    }
}
