//! Errors of elevation models and reliefs.

use std::io;
use std::path::PathBuf;

use subaperture_model::geometry::GridError;

/// Error of reading an elevation model or computing a relief.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TerrainError {
    /// A file could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// A file is damaged or not a supported elevation model.
    #[error("{}: {what}", path.display())]
    Format {
        /// File.
        path: PathBuf,
        /// Fault of the file and remedy.
        what: String,
    },
    /// No elevation model in the file or folder overlaps the scene.
    #[error(
        "{}: expected an elevation model (.hgt, .tif) that overlaps the scene, {region}; found none", path.display()
    )]
    Nothing {
        /// Folder or file.
        path: PathBuf,
        /// Extent of the scene.
        region: String,
    },
    /// The part of a file that the scene needs exceeds the memory limit.
    #[error(
        "{}: the scene needs {needed_mib} MiB of this file, {allowed_mib} MiB are allowed; use a smaller grid, a coarser \
         model or more memory", path.display()
    )]
    Memory {
        /// File.
        path: PathBuf,
        /// Memory needed, MiB.
        needed_mib: u64,
        /// Memory limit, MiB.
        allowed_mib: u64,
    },
    /// The surface has no height at a position of the scene.
    #[error(
        "{surface} has no height at latitude {latitude_deg:.6}, longitude {longitude_deg:.6} (outside the model, or no data); fill the void or \
         use a smaller grid"
    )]
    Void {
        /// Description of the surface.
        surface: String,
        /// Latitude, degrees.
        latitude_deg: f64,
        /// Longitude, degrees.
        longitude_deg: f64,
    },
    /// The geoid file has no undulation at a position of the scene.
    #[error(
        "the geoid file has no undulation at latitude {latitude_deg:.6}, longitude {longitude_deg:.6}; use one that covers the scene"
    )]
    NoUndulation {
        /// Latitude, degrees.
        latitude_deg: f64,
        /// Longitude, degrees.
        longitude_deg: f64,
    },
    /// The scene's position on the Earth is unknown.
    #[error(
        "the recording does not contain the scene's position on the Earth; an Earth surface needs it"
    )]
    Local,
    /// A normal of the grid's plane does not intersect the surface exactly once.
    #[error(
        "the grid's plane is too steep for {surface}: its normal near latitude {latitude_deg:.6}, longitude {longitude_deg:.6} does not intersect it in \
         exactly one point; use a horizontal grid"
    )]
    Steep {
        /// Description of the surface.
        surface: String,
        /// Latitude, degrees.
        latitude_deg: f64,
        /// Longitude, degrees.
        longitude_deg: f64,
    },
    /// The grid rejects the heights.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// Cancelled by the monitor.
    #[error("interrupted")]
    Cancelled,
}
