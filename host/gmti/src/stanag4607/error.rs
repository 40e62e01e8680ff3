//! Errors of STANAG 4607 packets.

/// Error of a STANAG 4607 packet.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StanagError {
    /// A value is outside the range of its field, or not finite.
    #[error("{field}: expected {least} to {most} {unit}, found {found}: correct the value")]
    Range {
        /// Number and name of the field.
        field: String,
        /// Smallest value of the field.
        least: f64,
        /// Largest value of the field.
        most: f64,
        /// Unit of all three values.
        unit: &'static str,
        /// Given value in this unit.
        found: f64,
    },
    /// A text is too long, too short, or has characters outside the Basic Character Set.
    #[error(
        "{field}: expected {expected} printable ASCII characters, found '{found}': correct the text"
    )]
    Text {
        /// Number and name of the field.
        field: String,
        /// Accepted number of characters.
        expected: String,
        /// Given text with escaped characters.
        found: String,
    },
    /// A field was given without a field that the standard sends with it.
    #[error("{field}: expected together with {needed}: give both or omit {field}")]
    Missing {
        /// Number and name of the given field.
        field: String,
        /// Number and name of the missing field.
        needed: String,
    },
    /// A field is present in some target reports of a dwell and absent from others, which share one existence mask.
    #[error(
        "{field}: expected in all target reports of the dwell or in no report, found presence different from report 0: write two dwells"
    )]
    Mixed {
        /// Number of the field.
        field: String,
    },
    /// The corners of the bounding area are not in the order of the standard.
    #[error(
        "J6 to J13 (bounding area): expected a convex quadrilateral with corners in clockwise order, found a left turn or no turn at corner {corner}: reorder the corners"
    )]
    BoundingArea {
        /// Index of the corner.
        corner: usize,
    },
    /// The recording has no position on the Earth.
    #[error(
        "expected a recording with a position on the Earth, found a local frame: positions have no latitude and longitude"
    )]
    NotGeoreferenced,
    /// A dwell has too many target reports.
    #[error("D5 (target report count): expected at most 65535, found {found}: split the dwell")]
    Targets {
        /// Number of target reports.
        found: usize,
    },
    /// The packet is longer than its size field permits.
    #[error(
        "P2 (packet size): expected at most 4294967295 bytes, found {found} or more: write the dwells to several packets"
    )]
    Size {
        /// Bytes up to the segment that exceeds the limit.
        found: u64,
    },
    /// A dwell or a target report is not valid.
    #[error("{place} {index}: {error}")]
    At {
        /// Kind of the faulty part: dwell or target report.
        place: &'static str,
        /// Index of the faulty part.
        index: usize,
        /// Error in that part.
        error: Box<StanagError>,
    },
}

impl StanagError {
    /// The same error with its place.
    pub(super) fn at(self, place: &'static str, index: usize) -> Self {
        Self::At {
            place,
            index,
            error: Box::new(self),
        }
    }
}
