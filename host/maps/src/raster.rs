//! Pixel raster of a map: north up, rows from north to south, pixels as areas.

use subaperture_model::geometry::{Geodetic, ImageGrid, SceneFrame};

use crate::surface::Surface;
use crate::{MapError, Projection, ProjectionModel};

/// Largest number of pixels per side.
const MOST: f64 = (1u64 << 30) as f64;

/// Largest ratio of a map pixel's side to an image pixel's side.
const MAX_FINE: f64 = 1024.0;

/// Pixel raster of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Raster {
    /// Projection of the coordinates.
    pub projection: Projection,
    /// Coordinate of the western edge, in the projection's unit.
    pub west: f64,
    /// Coordinate of the northern edge, in the projection's unit.
    pub north: f64,
    /// Pixel spacing eastwards and southwards, in the projection's unit; both positive.
    pub step: [f64; 2],
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Pixel spacing on the ground, metres.
    pub pixel_m: f64,
}

impl Raster {
    /// Raster that covers an image. `pixel_m` is the pixel spacing on the ground; default: the smaller of the image's row and column spacing. Edges are
    /// multiples of the pixel spacing, so that maps of equal spacing align.
    ///
    /// # Errors
    /// [`MapError`] if the image has no position on the Earth, its plane is vertical, or the number of pixels is out of range.
    pub fn covering(
        grid: &ImageGrid,
        frame: &SceneFrame,
        projection: impl FnOnce(&Geodetic) -> Result<Projection, MapError>,
        pixel_m: Option<f64>,
    ) -> Result<Self, MapError> {
        Self::around(&Surface::of_grid(grid, frame)?, projection, pixel_m)
    }

    /// Raster that covers an image of `(rows, columns)` pixels that its own metadata project; see [`Self::covering`].
    ///
    /// # Errors
    /// [`MapError`] if the outline does not project to the Earth, or the number of pixels is out of range.
    pub fn covering_projected(
        model: &dyn ProjectionModel,
        (rows, columns): (usize, usize),
        projection: impl FnOnce(&Geodetic) -> Result<Projection, MapError>,
        pixel_m: Option<f64>,
    ) -> Result<Self, MapError> {
        Self::around(
            &Surface::Projected(model, [rows, columns]),
            projection,
            pixel_m,
        )
    }

    fn around(
        surface: &Surface,
        projection: impl FnOnce(&Geodetic) -> Result<Projection, MapError>,
        pixel_m: Option<f64>,
    ) -> Result<Self, MapError> {
        let centre = surface.centre()?;
        let projection = projection(&centre)?;
        let pixel_m = pixel_m.unwrap_or_else(|| Self::own_pixel_m(surface));
        let step = projection.metres(&centre).map(|metres| pixel_m / metres);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for place in surface.whole_outline()? {
            let at = projection.coordinates(&place)?;
            for i in 0..2 {
                low[i] = low[i].min(at[i]);
                high[i] = high[i].max(at[i]);
            }
        }
        let first = [0, 1].map(|i| (low[i] / step[i] + 1e-6).floor());
        let count = [0, 1].map(|i| (high[i] / step[i] - 1e-6).ceil() - first[i]);
        let size = |what| MapError::Size {
            rows: count[1],
            columns: count[0],
            pixel_m,
            what,
        };
        if !(pixel_m > 0.0 && count.iter().all(|n| (1.0..=MOST).contains(n))) {
            return Err(size("expected 1 to 1e9 pixels per side"));
        }
        let raster = Self {
            projection,
            west: first[0] * step[0],
            north: (first[1] + count[1]) * step[1],
            step,
            rows: count[1] as usize,
            columns: count[0] as usize,
            pixel_m,
        };
        match raster.fine(surface) <= MAX_FINE {
            true => Ok(raster),
            false => Err(size(
                "a map pixel may cover at most 1024 image pixels per side; use smaller pixels",
            )),
        }
    }

    /// Smaller of an image's row and column spacing, metres.
    fn own_pixel_m(surface: &Surface) -> f64 {
        let [rows, columns] = surface.steps_m();
        rows.min(columns)
    }

    /// Samples per pixel side such that they are no coarser than the image.
    pub(crate) fn fine(&self, surface: &Surface) -> f64 {
        (self.pixel_m / Self::own_pixel_m(surface) - 1e-6)
            .ceil()
            .max(1.0)
    }

    /// Coordinates of a fractional row and column; whole numbers are the north-western corners of pixels.
    pub fn coordinates(&self, [row, column]: [f64; 2]) -> [f64; 2] {
        [
            self.west + column * self.step[0],
            self.north - row * self.step[1],
        ]
    }

    /// Fractional row and column of a position. The inverse of [`Self::coordinates`].
    ///
    /// # Errors
    /// [`MapError::Utm`] far from the map.
    pub fn at(&self, place: &Geodetic) -> Result<[f64; 2], MapError> {
        let [east, north] = self.projection.coordinates(place)?;
        Ok([
            (self.north - north) / self.step[1],
            (east - self.west) / self.step[0],
        ])
    }
}
