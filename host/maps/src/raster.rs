//! The pixels of a map: north up, rows from the north, pixels as areas.

use subaperture_model::geometry::{Geodetic, ImageGrid, SceneFrame};

use crate::surface::Surface;
use crate::{Lying, MapError, Projection};

/// Most pixels of a side.
const MOST: f64 = (1u64 << 30) as f64;

/// Most of the image's pixels that a side of the map's may cover.
const MOST_FINE: f64 = 1024.0;

/// A map's pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Raster {
    /// What its coordinates are.
    pub projection: Projection,
    /// Coordinate of the western edge.
    pub west: f64,
    /// Coordinate of the northern edge.
    pub north: f64,
    /// From pixel to pixel to the east and, southwards, to the south; both positive.
    pub step: [f64; 2],
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
    /// On the ground, metres.
    pub pixel_m: f64,
}

impl Raster {
    /// The raster that covers an image. `pixel_m` is the distance of pixels on the ground; if it is not given, the image's own, the lesser of its
    /// rows' and columns'. Edges are at whole multiples of pixels, so that maps of one pixel fit together.
    ///
    /// # Errors
    /// [`MapError`].
    pub fn covering(
        grid: &ImageGrid,
        frame: &SceneFrame,
        projection: impl FnOnce(&Geodetic) -> Result<Projection, MapError>,
        pixel_m: Option<f64>,
    ) -> Result<Self, MapError> {
        Self::around(&Surface::of_grid(grid, frame)?, projection, pixel_m)
    }

    /// The raster that covers an image whose pixels lie as its metadata say, of so many rows and columns; as [`Self::covering`].
    ///
    /// # Errors
    /// [`MapError`].
    pub fn covering_told(
        lying: &dyn Lying,
        (rows, columns): (usize, usize),
        projection: impl FnOnce(&Geodetic) -> Result<Projection, MapError>,
        pixel_m: Option<f64>,
    ) -> Result<Self, MapError> {
        Self::around(&Surface::Told(lying, [rows, columns]), projection, pixel_m)
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
            return Err(size("1 to 1e9 a side are possible"));
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
        match raster.fine(surface) <= MOST_FINE {
            true => Ok(raster),
            false => Err(size(
                "a pixel may cover 1024 of the image's a side at the most: give smaller ones",
            )),
        }
    }

    /// The lesser of an image's steps.
    fn own_pixel_m(surface: &Surface) -> f64 {
        let [rows, columns] = surface.steps_m();
        rows.min(columns)
    }

    /// Into how many parts a pixel's side is cut, so that they are no coarser than the image.
    pub(crate) fn fine(&self, surface: &Surface) -> f64 {
        (self.pixel_m / Self::own_pixel_m(surface) - 1e-6)
            .ceil()
            .max(1.0)
    }

    /// Coordinates at a row and a column of the raster: the north-western corner of that pixel is at whole numbers.
    pub fn coordinates(&self, [row, column]: [f64; 2]) -> [f64; 2] {
        [
            self.west + column * self.step[0],
            self.north - row * self.step[1],
        ]
    }

    /// Row and column at which a place is, the inverse of that.
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
