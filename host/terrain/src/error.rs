//! Why there is no surface, and what to do.

use std::io;
use std::path::PathBuf;

use subaperture_model::geometry::GridError;

/// Why there is no surface.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TerrainError {
    /// A file could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file is no model of the ground that is known here.
    #[error("{}: {what}", path.display())]
    Format {
        /// Which.
        path: PathBuf,
        /// What is wrong, and what to do.
        what: String,
    },
    /// A folder has no model of the ground that is wanted.
    #[error(
        "{}: no elevation model in it (.hgt, .tif) covers any of the scene, {region}", path.display()
    )]
    Nothing {
        /// The folder or file.
        path: PathBuf,
        /// What is wanted.
        region: String,
    },
    /// The part that is needed takes more than it may.
    #[error(
        "{}: the part that the scene needs takes {needed_mib} MiB and {allowed_mib} MiB are allowed: a smaller grid, a coarser \
         model or more memory would do", path.display()
    )]
    Memory {
        /// Which file.
        path: PathBuf,
        /// MiB.
        needed_mib: u64,
        /// MiB.
        allowed_mib: u64,
    },
    /// There is no height somewhere.
    #[error(
        "{surface} has no height at latitude {latitude_deg:.6}, longitude {longitude_deg:.6}: it ends there, or has a void: fill it, or \
         choose a smaller grid"
    )]
    Void {
        /// Of what.
        surface: String,
        /// Where, degrees.
        latitude_deg: f64,
        /// Where, degrees.
        longitude_deg: f64,
    },
    /// The geoid is not known somewhere.
    #[error(
        "the geoid's file has no undulation at latitude {latitude_deg:.6}, longitude {longitude_deg:.6}: take one that covers the scene"
    )]
    NoUndulation {
        /// Where, degrees.
        latitude_deg: f64,
        /// Where, degrees.
        longitude_deg: f64,
    },
    /// Nothing is known of the Earth.
    #[error(
        "the recording does not say where on the Earth it was, so that no surface of the Earth is known in its scene"
    )]
    Local,
    /// The plane's normals do not meet the surface once.
    #[error(
        "the grid's plane is too steep for {surface}: near latitude {latitude_deg:.6}, longitude {longitude_deg:.6} its normal meets it in no one \
         point; a horizontal grid would do"
    )]
    Steep {
        /// Of what.
        surface: String,
        /// Where, degrees.
        latitude_deg: f64,
        /// Where, degrees.
        longitude_deg: f64,
    },
    /// The heights are none that a grid takes.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The monitor asked to stop.
    #[error("interrupted")]
    Cancelled,
}
