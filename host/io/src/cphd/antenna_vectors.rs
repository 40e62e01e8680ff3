//! Axes and electrical boresights of antennas given per vector (`UseACFPVP`, `UseEBPVP`).

use glam::DVec3;

use crate::container::record::{COSINES, Field, POSITION, Words};
use crate::container::{Element, MetadataError};

/// Per-vector parameters of the transmitting and of the receiving antenna: element, its X axis, Y axis and electrical boresight.
const NAMES: [[&str; 4]; 2] = [
    ["TxAntenna", "TxACX", "TxACY", "TxEB"],
    ["RcvAntenna", "RcvACX", "RcvACY", "RcvEB"],
];

/// Places of the parameters of both antennas in a vector's record.
#[derive(Clone, Debug)]
pub(super) struct AntennaFields([[Field; 3]; 2]);

/// One antenna at one vector. Numbers that are not finite give no direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct AntennaVector {
    /// Axes X and Y of the antenna's coordinate frame, ECF.
    pub(super) axes: [DVec3; 2],
    /// Electrical boresight, direction cosines along X and Y.
    pub(super) boresight: [f64; 2],
}

impl AntennaFields {
    /// Those of the PVP branch, records of `record_bytes`.
    ///
    /// # Errors
    /// The first element that is missing or wrong.
    pub(super) fn parse(pvp: &Element, record_bytes: u64) -> Result<Self, MetadataError> {
        let fields = NAMES.map(|[element, x, y, boresight]| {
            let antenna = pvp.child(element)?;
            let field = |name: &'static str, format: &str| -> Result<Field, MetadataError> {
                let stated_at = "CPHD/Data/NumBytesPVP";
                Field::parse(&antenna.child(name)?, name, format, record_bytes, stated_at)
            };
            Ok([
                field(x, POSITION)?,
                field(y, POSITION)?,
                field(boresight, COSINES)?,
            ])
        });
        let [transmitter, receiver] = fields;
        Ok(Self([transmitter?, receiver?]))
    }

    /// Decode the antennas of a vector.
    pub(super) fn decode(&self, index: u64, record: &[u8]) -> [AntennaVector; 2] {
        let record = Words {
            kind: "vector",
            index,
            bytes: record,
        };
        self.0.map(|[x, y, boresight]| AntennaVector {
            axes: [x, y].map(|axis| DVec3::from_array(record.numbers(axis))),
            boresight: record.numbers(boresight),
        })
    }
}
