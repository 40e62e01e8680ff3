//! Per-vector parameters: positions in a vector's record, reading and writing. 8-byte words, big endian.

use glam::DVec3;

use super::antenna_vectors::AntennaFields;
use super::conventions::Domain;
use crate::container::record::{Field, INTEGER, POSITION, SCALAR, Words, record_width};
use crate::container::{Element, MetadataError};
use crate::xml::Writer;

/// Positions of the parameters that are read.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// Length of a record in bytes.
    pub(super) num_bytes: u64,
    tx_time: Field,
    tx_pos: Field,
    rcv_pos: Field,
    srp_pos: Field,
    /// Velocities of transmitter and receiver, and aFRR2: the parameters of intra-pulse motion.
    sweep: Option<([Field; 2], Field)>,
    fx1: Field,
    fx2: Field,
    /// TOA1 and TOA2, if both are given.
    toa: Option<[Field; 2]>,
    sc0: Field,
    scss: Field,
    amp_sf: Option<Field>,
    signal: Option<Field>,
    true_antennas: Option<[Field; 2]>,
    /// Axes and boresights of the antennas, or the reason that they cannot be read.
    pub(super) antennas: Result<AntennaFields, String>,
}

/// Parameters of one vector, all finite.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vector {
    pub(super) tx_time: f64,
    pub(super) tx_pos: DVec3,
    pub(super) rcv_pos: DVec3,
    pub(super) srp_pos: DVec3,
    /// Velocities of transmitter and receiver, and aFRR2, where it is given.
    pub(super) sweep: Option<([DVec3; 2], f64)>,
    pub(super) fx1: f64,
    pub(super) fx2: f64,
    /// Interval of TOA1 to TOA2, seconds, where it is given.
    pub(super) toa: Option<[f64; 2]>,
    pub(super) sc0: f64,
    pub(super) scss: f64,
    pub(super) amp_sf: Option<f64>,
    /// True positions of transmitter and receiver.
    pub(super) true_antennas: Option<[DVec3; 2]>,
}

/// Names of the added parameters (`AddedPVP`) that hold the true positions, ECF, metres.
const TRUE_ANTENNAS: [&str; 2] = ["TxPosTrue", "RcvPosTrue"];

/// Value of SIGNAL for a vector that contains an echo of the scene.
const ECHO: i64 = 1;

impl Layout {
    pub(super) fn parse(pvp: &Element, num_bytes: &Element) -> Result<Self, MetadataError> {
        let bytes = record_width(num_bytes)?;
        let place = |node: &Element, name: &'static str, format: &str| {
            Field::parse(node, name, format, bytes, "CPHD/Data/NumBytesPVP")
        };
        let field = |name: &'static str, format: &str| -> Result<Option<Field>, MetadataError> {
            let node = pvp.optional(name);
            node.map(|node| place(&node, name, format)).transpose()
        };
        let added = |name: &'static str| -> Result<Option<Field>, MetadataError> {
            let named = |node: &Element| node.optional_text("Name").as_deref() == Some(name);
            let node = pvp.children("AddedPVP").find(named);
            node.map(|node| place(&node, name, POSITION)).transpose()
        };
        let [transmitter, receiver] = TRUE_ANTENNAS;
        let true_antennas = added(transmitter)?.zip(added(receiver)?);
        let required = |name: &'static str, format| place(&pvp.child(name)?, name, format);
        Ok(Self {
            num_bytes: bytes,
            tx_time: required("TxTime", SCALAR)?,
            tx_pos: required("TxPos", POSITION)?,
            rcv_pos: required("RcvPos", POSITION)?,
            srp_pos: required("SRPPos", POSITION)?,
            sweep: field("TxVel", POSITION)?
                .zip(field("RcvVel", POSITION)?)
                .zip(field("aFRR2", SCALAR)?)
                .map(|((transmitter, receiver), rate)| ([transmitter, receiver], rate)),
            fx1: required("FX1", SCALAR)?,
            fx2: required("FX2", SCALAR)?,
            toa: field("TOA1", SCALAR)?
                .zip(field("TOA2", SCALAR)?)
                .map(|(first, last)| [first, last]),
            sc0: required("SC0", SCALAR)?,
            scss: required("SCSS", SCALAR)?,
            amp_sf: field("AmpSF", SCALAR)?,
            signal: field("SIGNAL", INTEGER)?,
            true_antennas: true_antennas.map(|(transmitter, receiver)| [transmitter, receiver]),
            antennas: AntennaFields::parse(pvp, bytes).map_err(|fault| fault.to_string()),
        })
    }

    /// Whether samples are to be multiplied by AmpSF.
    pub(super) fn has_amp_sf(&self) -> bool {
        self.amp_sf.is_some()
    }

    /// Whether vectors have true positions.
    pub(super) fn has_true_antennas(&self) -> bool {
        self.true_antennas.is_some()
    }

    /// Decode vector `index` from its record of [`Self::num_bytes`]. `None` if it contains no echo (`SIGNAL` other
    /// than 1); its other parameters are then not checked.
    pub(super) fn decode(
        &self,
        index: u64,
        record: &[u8],
        domain: Domain,
    ) -> Result<Option<Vector>, String> {
        let record = Words {
            kind: "vector",
            index,
            bytes: record,
        };
        if self
            .signal
            .is_some_and(|field| record.integer(field) != ECHO)
        {
            return Ok(None);
        }
        let fault = |field: Field, what: String| record.fault(field, what);
        let finite = |field: Field, word: usize| record.finite(field, word);
        let position = |field| record.position(field);
        let vector = Vector {
            tx_time: finite(self.tx_time, 0)?,
            tx_pos: position(self.tx_pos)?,
            rcv_pos: position(self.rcv_pos)?,
            srp_pos: position(self.srp_pos)?,
            sweep: match self.sweep {
                // Zero means not given, NaN means unknown.
                Some((velocities, rate)) => {
                    let rate = record.number(rate);
                    if rate.is_finite() && rate != 0.0 {
                        let [transmitter, receiver] = velocities;
                        Some(([position(transmitter)?, position(receiver)?], rate))
                    } else {
                        None
                    }
                }
                None => None,
            },
            fx1: finite(self.fx1, 0)?,
            fx2: finite(self.fx2, 0)?,
            // Equal, exchanged or undefined numbers state no interval.
            toa: (self
                .toa
                .map(|fields| fields.map(|field| record.number(field))))
            .filter(|[first, last]| first < last && first.is_finite() && last.is_finite()),
            sc0: finite(self.sc0, 0)?,
            scss: finite(self.scss, 0)?,
            amp_sf: self.amp_sf.map(|f| finite(f, 0)).transpose()?,
            true_antennas: match self.true_antennas {
                Some([transmitter, receiver]) => {
                    Some([position(transmitter)?, position(receiver)?])
                }
                None => None,
            },
        };
        if vector.scss <= 0.0 {
            let what = format!(
                "expected a positive sample spacing, found {:?}",
                vector.scss
            );
            return Err(fault(self.scss, what));
        }
        if domain == Domain::Fx && vector.sc0 <= 0.0 {
            let what = format!("expected a positive frequency, found {:?} Hz", vector.sc0);
            return Err(fault(self.sc0, what));
        }
        if vector.fx1 >= vector.fx2 {
            let what = format!(
                "expected a value below FX2, {1:?} Hz, found {0:?} Hz",
                vector.fx1, vector.fx2
            );
            return Err(fault(self.fx1, what));
        }
        Ok(Some(vector))
    }
}

/// All parameters of a vector to write.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record {
    pub(super) tx_time: f64,
    pub(super) tx_pos: DVec3,
    pub(super) tx_vel: DVec3,
    pub(super) rcv_time: f64,
    pub(super) rcv_pos: DVec3,
    pub(super) rcv_vel: DVec3,
    pub(super) srp_pos: DVec3,
    pub(super) a_fdop: f64,
    /// `2 / (c rate)` for a sweep rate in hertz per second; 0 if samples are simultaneous. aFRR1 is this times the
    /// centre frequency.
    pub(super) a_frr2: f64,
    pub(super) fx1: f64,
    pub(super) fx2: f64,
    pub(super) toa1: f64,
    pub(super) toa2: f64,
    pub(super) sc0: f64,
    pub(super) scss: f64,
    /// True positions of transmitter and receiver; in all records of a file or in none.
    pub(super) true_antennas: Option<[DVec3; 2]>,
}

/// Parameters in writing order.
const WRITTEN: [(&str, &str); 18] = [
    ("TxTime", SCALAR),
    ("TxPos", POSITION),
    ("TxVel", POSITION),
    ("RcvTime", SCALAR),
    ("RcvPos", POSITION),
    ("RcvVel", POSITION),
    ("SRPPos", POSITION),
    ("aFDOP", SCALAR),
    ("aFRR1", SCALAR),
    ("aFRR2", SCALAR),
    ("FX1", SCALAR),
    ("FX2", SCALAR),
    ("TOA1", SCALAR),
    ("TOA2", SCALAR),
    ("TDTropoSRP", SCALAR),
    ("SC0", SCALAR),
    ("SCSS", SCALAR),
    ("SIGNAL", INTEGER),
];

/// Length of a written record, bytes: 13 scalars and 5 positions, and 2 more if true positions are
/// known.
pub(super) const fn record_bytes(with_truth: bool) -> u64 {
    8 * (13 + if with_truth { 7 } else { 5 } * 3)
}

impl Record {
    /// Append a record of [`record_bytes`]. aFRR1 and aFRR2 are zero (not given) for all vectors with simultaneous
    /// samples; TDTropoSRP is zero (vacuum); SIGNAL is 1 (normal signal).
    pub(super) fn encode(&self, bytes: &mut Vec<u8>) {
        let mut put = |values: &[f64]| {
            for value in values {
                bytes.extend_from_slice(&value.to_be_bytes());
            }
        };
        put(&[self.tx_time]);
        put(&self.tx_pos.to_array());
        put(&self.tx_vel.to_array());
        put(&[self.rcv_time]);
        put(&self.rcv_pos.to_array());
        put(&self.rcv_vel.to_array());
        put(&self.srp_pos.to_array());
        let a_frr1 = 0.5 * (self.fx1 + self.fx2) * self.a_frr2;
        put(&[self.a_fdop, a_frr1, self.a_frr2, self.fx1, self.fx2]);
        put(&[self.toa1, self.toa2, 0.0, self.sc0, self.scss]);
        bytes.extend_from_slice(&1i64.to_be_bytes());
        for position in self.true_antennas.iter().flatten() {
            for value in position.to_array() {
                bytes.extend_from_slice(&value.to_be_bytes());
            }
        }
    }

    /// The time at which the wavefront is at the SRP's range from the transmitter (6.5.1 (5)).
    pub(super) fn reference_time(&self) -> f64 {
        let transmit = (self.tx_pos - self.srp_pos).length();
        let receive = (self.rcv_pos - self.srp_pos).length();
        self.tx_time + transmit / (transmit + receive) * (self.rcv_time - self.tx_time)
    }
}

/// Writes the PVP branch of the XML.
pub(super) fn describe(w: &mut Writer, with_truth: bool) {
    w.element("PVP", "", |w| {
        let mut offset = 0;
        let mut place = |w: &mut Writer, format: &str| {
            let size = if format == POSITION { 3 } else { 1 };
            w.text("Offset", offset);
            w.text("Size", size);
            w.text("Format", format);
            offset += size;
        };
        for (name, format) in WRITTEN {
            w.element(name, "", |w| place(w, format));
        }
        if with_truth {
            for name in TRUE_ANTENNAS {
                w.element("AddedPVP", "", |w| {
                    w.text("Name", name);
                    place(w, POSITION);
                });
            }
        }
    });
}
