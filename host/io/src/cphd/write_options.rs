//! Options and errors of the CPHD writer.

use super::conventions::{Domain, Polarization, Sgn};
use super::metadata::ReferenceSurface;
use crate::atomic;
use subaperture_model::phase_history::{PhaseHistory, ReadError};
use subaperture_model::radar::MountedAntennas;

/// Channel to write.
pub struct Channel<'a> {
    /// Identifier, unique in the file.
    pub id: String,
    /// Pulses of the channel in order of time.
    pub history: &'a dyn PhaseHistory,
    /// Polarisation transmitted.
    pub tx_polarization: Polarization,
    /// Polarisation received.
    pub rcv_polarization: Polarization,
    /// Antennas of the channel; described in the file if one of them has a pattern.
    pub antennas: Option<MountedAntennas>,
}

impl<'a> Channel<'a> {
    /// Create a channel of unspecified polarisation.
    pub fn new(id: impl Into<String>, history: &'a dyn PhaseHistory) -> Self {
        Self {
            id: id.into(),
            history,
            tx_polarization: Polarization::default(),
            rcv_polarization: Polarization::default(),
            antennas: None,
        }
    }

    /// Describe these antennas; isotropic ones are not described.
    #[must_use]
    pub fn with_antennas(self, antennas: MountedAntennas) -> Self {
        let antennas = antennas.is_directive().then_some(antennas);
        Self { antennas, ..self }
    }
}

/// Options of the writer and metadata of the collection.
#[derive(Clone, Debug)]
pub struct WriteOptions {
    /// Domain of the samples. FX reads back bit-identical, TOA to float32 rounding.
    pub domain: Domain,
    /// Sign of phase with delay.
    pub sgn: Sgn,
    /// Radar platform.
    pub collector_name: String,
    /// Name of the collection. `None`: that of the first channel's collection.
    pub core_name: Option<String>,
    /// The radar's own name of its mode.
    pub mode_id: Option<String>,
    /// Classification banner.
    pub classification: String,
    /// Release restrictions (`ReleaseInfo`).
    pub release_info: String,
    /// Surface on which image area coordinates are defined. One of constant height requires a scene frame with a
    /// vertical z axis.
    pub surface: ReferenceSurface,
    /// Date and time of the collection's start, UTC, as `YYYY-MM-DDThh:mm:ss.ssssssZ`.
    pub collection_start: String,
}

impl Default for WriteOptions {
    /// FX, SGN -1, a planar reference surface, unclassified and unrestricted, by "Subaperture", at an unknown date (1970).
    fn default() -> Self {
        Self {
            domain: Domain::Fx,
            sgn: Sgn::Minus,
            collector_name: "Subaperture".to_owned(),
            core_name: None,
            mode_id: None,
            classification: "UNCLASSIFIED".to_owned(),
            release_info: "UNRESTRICTED".to_owned(),
            surface: ReferenceSurface::Planar,
            collection_start: "1970-01-01T00:00:00.000000Z".to_owned(),
        }
    }
}

/// Error of writing a CPHD file; no partial file remains.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The file could not be written.
    #[error(transparent)]
    Write(#[from] atomic::WriteError),
    /// The pulses could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// CPHD cannot represent the collection or the options.
    #[error("{0}")]
    Unsuited(String),
    /// The monitor asked to stop.
    #[error("interrupted")]
    Cancelled,
}
