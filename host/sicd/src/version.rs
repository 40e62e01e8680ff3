//! Versions of SICD that are written.

use std::str::FromStr;

use crate::SicdError;
use crate::aperture::Aperture;

/// Version of SICD to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum SicdVersion {
    /// SICD 1.3, monostatic images only.
    V1_3,
    /// SICD 1.4, the first that describes bistatic images.
    V1_4,
    /// SICD 1.5, which adds polygons of areas.
    V1_5,
}

impl SicdVersion {
    /// The version `wanted` if it describes the aperture; by default the lowest that does: 1.3, or 1.4 for bistatic images, which need
    /// `SCPCOA/Bistatic`.
    pub(crate) fn of(aperture: &Aperture, wanted: Option<Self>) -> Result<Self, SicdError> {
        let lowest = match aperture.pair {
            None => Self::V1_3,
            Some(_) => Self::V1_4,
        };
        match wanted {
            Some(version) if version < lowest => Err(SicdError::Unsuited(format!(
                "expected SICD {} or later, which describe bistatic images, found {}",
                lowest.number(),
                version.number()
            ))),
            wanted => Ok(wanted.unwrap_or(lowest)),
        }
    }

    pub(crate) fn number(self) -> &'static str {
        match self {
            Self::V1_3 => "1.3.0",
            Self::V1_4 => "1.4.0",
            Self::V1_5 => "1.5",
        }
    }

    pub(crate) fn namespace(self) -> &'static str {
        match self {
            Self::V1_3 => "urn:SICD:1.3.0",
            Self::V1_4 => "urn:SICD:1.4.0",
            Self::V1_5 => "urn:SICD:1.5",
        }
    }

    /// Date of the standard.
    pub(crate) fn date(self) -> &'static str {
        match self {
            Self::V1_3 => "2021-11-30T00:00:00Z",
            Self::V1_4 => "2023-10-26T00:00:00Z",
            Self::V1_5 => "2025-06-10",
        }
    }
}

/// Text that does not name a version.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected SICD version 1.3, 1.4 or 1.5, found {0}")]
pub struct UnknownVersion(String);

impl FromStr for SicdVersion {
    type Err = UnknownVersion;

    fn from_str(text: &str) -> Result<Self, UnknownVersion> {
        match text {
            "1.3" => Ok(Self::V1_3),
            "1.4" => Ok(Self::V1_4),
            "1.5" => Ok(Self::V1_5),
            other => Err(UnknownVersion(other.to_owned())),
        }
    }
}
