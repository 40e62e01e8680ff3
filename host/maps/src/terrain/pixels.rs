//! Surface of the pixels of an image: the grid's plane, rotated or with a relief.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use glam::DVec3;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::Collection;
use subaperture_model::resolution::slant::{slant_axes, slant_grid};
use subaperture_model::resolution::survey::NoDefaultGrid;

use crate::terrain::ground::height_m;
use crate::terrain::{Geoid, Ground, Region, Surface, TerrainError, relief};

/// Divisor of the memory for an elevation model, which is released before the image is formed.
const SHARE: u64 = 2;

/// Height error of the relief, in pixels, above which a warning is given.
const WARNED_PIXELS: f64 = 1.0;

/// Expected texts of a surface.
const SURFACES: &str = "give plane, slant, hae, hae:HEIGHT (as hae:43m) or dem:FILE";

/// Surface of the pixels of an image. Its text is `plane`, `slant`, `hae`, `hae:HEIGHT` or `dem:FILE`.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum PixelSurface {
    /// Plane of the grid. Default.
    #[default]
    Plane,
    /// Slant plane of the collection: x of the grid is cross-range, y range.
    Slant,
    /// Height above the ellipsoid, metres; `None` for that of the grid's origin.
    Ellipsoid(Option<f64>),
    /// Elevation model: a file, or a folder of them.
    Dem(PathBuf),
}

/// Grid whose pixels lie on a surface.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Grid with the relief of the surface.
    pub grid: ImageGrid,
    /// Extent and nodes of the relief; `None` for planes.
    pub relief: Option<String>,
    /// Warnings about the heights, one sentence each.
    pub warnings: Vec<String>,
}

/// Error of placing a grid on a surface.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlacementError {
    /// A geoid is given for a surface with heights above the ellipsoid.
    #[error(
        "geoid: expected with the surface dem:FILE only, other surfaces have heights above the ellipsoid"
    )]
    Geoid,
    /// The grid for the slant plane is rotated or polar.
    #[error(
        "surface slant rotates the grid: expected a grid with x (cross-range) and y (range) only, without yaw, pitch or roll"
    )]
    Rotated,
    /// The collection has no slant plane.
    #[error(
        "surface slant: the antennas do not move across their line of sight, so that no slant plane is defined"
    )]
    NoSlantPlane,
    /// The default grid has no slant plane.
    #[error(transparent)]
    NoDefault(#[from] NoDefaultGrid),
    /// The elevation model or the relief failed.
    #[error(transparent)]
    Terrain(#[from] TerrainError),
}

impl PixelSurface {
    /// The file or folder of an elevation model.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::Dem(path) => Some(path),
            _ => None,
        }
    }

    /// Check before any file is read that geoid and grid suit the surface. `given` is the requested grid, `None` for the default one.
    ///
    /// # Errors
    /// [`PlacementError::Geoid`], [`PlacementError::Rotated`].
    pub fn check(&self, geoid: &Geoid, given: Option<&ImageGrid>) -> Result<(), PlacementError> {
        let is_plain =
            |grid: &ImageGrid| grid.x_axis == DVec3::X && grid.y_axis == DVec3::Y && !grid.polar;
        match self {
            Self::Slant if !given.is_none_or(is_plain) => Err(PlacementError::Rotated),
            Self::Dem(_) => Ok(()),
            _ if *geoid != Geoid::None => Err(PlacementError::Geoid),
            _ => Ok(()),
        }
    }

    /// Place a grid on this surface. `is_default` is whether the grid is the default one of the collection, which becomes a default grid in the slant
    /// plane. An elevation model takes half of `memory_bytes`.
    ///
    /// # Errors
    /// [`PlacementError`].
    pub fn place(
        &self,
        (plane, is_default): (ImageGrid, bool),
        geoid: &Geoid,
        collection: &Collection,
        memory_bytes: u64,
        monitor: &dyn Monitor,
    ) -> Result<Placed, PlacementError> {
        self.check(geoid, (!is_default).then_some(&plane))?;
        let flat = |grid| Placed {
            grid,
            relief: None,
            warnings: Vec::new(),
        };
        match self {
            Self::Plane => Ok(flat(plane)),
            Self::Slant if is_default => Ok(flat(slant_grid(collection, &plane)?)),
            Self::Slant => {
                let axes = slant_axes(collection, plane.origin_m);
                let [x_axis, y_axis] = axes.ok_or(PlacementError::NoSlantPlane)?;
                Ok(flat(ImageGrid {
                    x_axis,
                    y_axis,
                    ..plane
                }))
            }
            Self::Ellipsoid(height_m) => {
                let origin = collection.frame.geodetic(plane.origin_m);
                let own_m = origin.map_or(0.0, |origin| origin.height_m);
                let surface = Surface::Ellipsoid(height_m.unwrap_or(own_m));
                laid(collection, plane, surface, monitor)
            }
            Self::Dem(path) => {
                let region = Region::of(&plane, &collection.frame)?;
                let ground = Ground::open(path, geoid, &region, memory_bytes / SHARE)?;
                let mut placed = laid(collection, plane, Surface::Ground(&ground), monitor)?;
                placed
                    .warnings
                    .splice(0..0, ground.warnings().iter().cloned());
                Ok(placed)
            }
        }
    }
}

/// Add the relief of a surface to the plane.
fn laid(
    collection: &Collection,
    plane: ImageGrid,
    surface: Surface,
    monitor: &dyn Monitor,
) -> Result<Placed, PlacementError> {
    let relief = relief(&plane, &collection.frame, surface, monitor)?;
    let pixel_m = plane.rows.step.min(plane.columns.step);
    let [low_m, high_m] = relief.range_m();
    let summary = format!(
        "relief: {}, {low_m:.1} to {high_m:.1} m above the grid's plane, {} x {} nodes, height error {:.2} m",
        relief.surface(),
        relief.columns().count,
        relief.rows().count,
        relief.error_m(),
    );
    let is_fine = plane.polar || relief.error_m() <= WARNED_PIXELS * pixel_m;
    let grid = plane.on(relief);
    Ok(match is_fine {
        true => Placed {
            grid,
            relief: Some(summary),
            warnings: Vec::new(),
        },
        false => Placed {
            grid,
            relief: None,
            warnings: vec![format!(
                "{summary}: more than a pixel; use a smaller grid, which has finer nodes"
            )],
        },
    })
}

impl fmt::Display for PixelSurface {
    /// Text that [`FromStr`] reads.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plane => f.write_str("plane"),
            Self::Slant => f.write_str("slant"),
            Self::Ellipsoid(None) => f.write_str("hae"),
            Self::Ellipsoid(Some(height_m)) => write!(f, "hae:{height_m}"),
            Self::Dem(path) => write!(f, "dem:{}", path.display()),
        }
    }
}

impl FromStr for PixelSurface {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None => match text {
                "plane" => Ok(Self::Plane),
                "slant" => Ok(Self::Slant),
                "hae" => Ok(Self::Ellipsoid(None)),
                _ => Err(SURFACES.to_owned()),
            },
            Some(("hae", text)) => height_m(text).map(|h| Self::Ellipsoid(Some(h))),
            Some(("dem", path)) if !path.is_empty() => Ok(Self::Dem(path.into())),
            Some(_) => Err(SURFACES.to_owned()),
        }
    }
}
