//! Sample format and size of SICD image segments.

use subaperture_io::container::nitf::Layout;

/// Sample format of a SICD (`PixelType`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Samples {
    Float32,
    Int16,
    AmplitudePhase,
}

/// Size and sample format of a SICD image segment.
#[derive(Clone, Debug)]
pub(crate) struct ImageHeader {
    pub(crate) name: String,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) samples: Samples,
}

impl ImageHeader {
    pub(crate) fn of(layout: Layout) -> Result<Self, String> {
        if layout.bands != 2 {
            return Err(format!(
                "expected 2 bands of a complex image, found {}",
                layout.bands
            ));
        }
        if layout.mode != "P" || layout.blocks != [1, 1] {
            return Err(format!(
                "expected one block interleaved by pixel (IMODE P), found IMODE {} with {} x {} blocks",
                layout.mode, layout.blocks[0], layout.blocks[1]
            ));
        }
        let samples = match (layout.kind.as_str(), layout.bits) {
            ("R", 32) => Samples::Float32,
            ("SI", 16) => Samples::Int16,
            ("INT", 8) => Samples::AmplitudePhase,
            (kind, bits) => {
                return Err(format!(
                    "expected SICD samples (R 32, SI 16 or INT 8), found {kind} of {bits} bits"
                ));
            }
        };
        Ok(Self {
            name: layout.name,
            rows: layout.rows,
            columns: layout.columns,
            samples,
        })
    }

    /// Check the segment's data length.
    pub(crate) fn check(&self, data_bytes: u64) -> Result<(), String> {
        let each = match self.samples {
            Samples::Float32 => 8,
            Samples::Int16 => 4,
            Samples::AmplitudePhase => 2u64,
        };
        // Eight digits each: no overflow of 64 bits.
        let expected = self.rows as u64 * self.columns as u64 * each;
        match expected == data_bytes {
            true => Ok(()),
            false => Err(format!(
                "{} rows of {} columns: expected {expected} bytes, found {data_bytes}",
                self.rows, self.columns
            )),
        }
    }
}
