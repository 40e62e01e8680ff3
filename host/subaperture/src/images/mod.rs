//! Opening images of any format, recognised by content, and relating pairs of images to common pixels.
//!
//! | path | image | values | pixel positions |
//! |---|---|---|---|
//! | folder with `image.json`, or that file | product of `subap focus` | complex | on its grid |
//! | the same while tiles are being formed (`image.zarr`) | product in progress | complex, NaN where no tile is formed | on its plan's grid |
//! | folder of `subap velocity` | velocity plane | complex | rows and columns only |
//! | Zarr group or array ([`crate::io::zarr`]); `FOLDER:N` is image `N` of several | stack | complex | on its grid, if recorded |
//! | `.npy` | array | complex | rows and columns only |
//! | NITF: SICD ([`crate::sicd::SicdFile`]) | complex image from any program | complex | by its metadata |
//! | NITF: SIDD ([`crate::sicd::SiddFile`]) | detected image | amplitudes, or grey levels of unknown scale | on its plane |
//! | TIFF with GeoTIFF keys | map | complex, amplitudes, or numbers of unknown meaning | on its raster |
//!
//! [`OpenImage::open`] reads headers and metadata; pixels are read in blocks ([`crate::image::ImageSource`]).
//!
//! [`Pair::new`] relates two images to the same pixels by their metadata, or states why it cannot.

mod compare;
mod geotiff;
mod growing;
mod kind;
mod lattice;
mod open;
mod pair;
mod project;
mod relate;
mod views;

use std::path::PathBuf;

use serde_json::Value;

use subaperture_io::npy::ImageFile;
use subaperture_io::product;
use subaperture_io::zarr::ZarrImage;
use subaperture_maps::Raster;
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::{Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks};
use subaperture_model::resolution::support::{Looks, RecordedLooks};
use subaperture_sicd::{Plane, SicdFile, SiddFile};
use subaperture_signal::window::Window;

use crate::on_map::SicdOnMap;
pub use compare::{CompareError, Compared, compare};
pub use geotiff::MapImage;
pub use growing::PartialImage;
pub use kind::ImageKind;
pub use open::{OpenError, Reading, product_folder};
pub use pair::{Pair, PairError};

/// Open image of any format.
#[derive(Debug)]
pub struct OpenImage {
    /// Path as given by the user.
    pub path: PathBuf,
    /// Pixels in their files.
    pub pixels: Pixels,
    /// Meaning of the pixels' values.
    pub values: Values,
    /// Position of the pixels.
    pub lies: PixelGeometry,
    /// Record of a product, `image.json`, or attributes of a Zarr group.
    pub record: Option<Value>,
}

/// Pixels in their files, by format.
#[derive(Debug)]
#[non_exhaustive]
pub enum Pixels {
    /// Product with all its pixels.
    Product(product::Pixels),
    /// Product in progress.
    Unfinished(PartialImage),
    /// Array of a velocity plane.
    Velocity(ImageFile),
    /// Array without metadata.
    Array(ImageFile),
    /// Array in Zarr format.
    Zarr(ZarrImage),
    /// Complex image in SICD format.
    Sicd(SicdFile),
    /// Detected image in SIDD format.
    Sidd(SiddFile),
    /// Raster in GeoTIFF format.
    Map(Box<MapImage>),
}

impl Pixels {
    fn parts(&self) -> &dyn ImageSource {
        match self {
            Self::Product(pixels) => pixels,
            Self::Unfinished(pixels) => pixels,
            Self::Velocity(file) | Self::Array(file) => file,
            Self::Zarr(image) => image,
            Self::Sicd(file) => file,
            Self::Sidd(file) => file,
            Self::Map(image) => &**image,
        }
    }
}

impl ImageSource for Pixels {
    fn size(&self) -> (usize, usize) {
        self.parts().size()
    }

    fn places(&self) -> PixelBlocks {
        self.parts().places()
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        self.parts().window(place)
    }
}

/// Meaning of pixel values.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Values {
    /// Complex amplitudes with phase.
    Complex,
    /// Amplitudes, square roots of power.
    Amplitudes,
    /// Amplitudes from quantised levels, limited to this range in dB.
    Levels([f64; 2]),
    /// Numbers or grey levels of unknown scale.
    Greys,
}

/// Position of an image's pixels.
#[derive(Debug)]
#[non_exhaustive]
pub enum PixelGeometry {
    /// Not recorded: rows and columns only.
    Pixels,
    /// On a grid in a scene frame.
    Grid {
        /// Grid of the pixel centres.
        grid: ImageGrid,
        /// Scene frame; `None` if not recorded.
        frame: Option<SceneFrame>,
    },
    /// By the metadata of a SICD.
    Sicd {
        /// Plane of rows and columns, if the metadata contain one.
        plane: Option<Plane>,
        /// Projection to the ground, or the reason why the metadata define none.
        on_map: Box<Result<SicdOnMap, String>>,
    },
    /// On the raster of a map.
    Map(Raster),
}

impl OpenImage {
    /// Grid and frame of pixels in or over a plane: of a product, a SICD plane or a SIDD.
    pub fn grid(&self) -> Option<(&ImageGrid, Option<SceneFrame>)> {
        match &self.lies {
            PixelGeometry::Grid { grid, frame } => Some((grid, *frame)),
            PixelGeometry::Sicd { plane, .. } => {
                plane.as_ref().map(|plane| (&plane.grid, Some(plane.frame)))
            }
            PixelGeometry::Pixels | PixelGeometry::Map(_) => None,
        }
    }

    /// Representative pulses of the recording under the image's windows, which give its spectral support. `None` if not recorded.
    pub fn looks(&self) -> Option<Looks> {
        let record = self.record.as_ref()?;
        let recorded: RecordedLooks = serde_json::from_value(record["support"].clone()).ok()?;
        let window =
            |key: &str| -> Option<Window> { record["settings"][key].as_str()?.parse().ok() };
        recorded.looks(
            window("window").unwrap_or_default(),
            window("slow_window").unwrap_or_default(),
        )
    }

    /// Whether the image has a scene without georeference or without a recorded frame.
    pub fn is_unplaced(&self) -> bool {
        matches!(
            &self.lies,
            PixelGeometry::Grid {
                frame: None | Some(SceneFrame::Local),
                ..
            }
        )
    }

    /// Fraction of the column spectrum filled by a SICD's aperture, cycles per pixel, if stated in the metadata.
    pub fn column_band(&self) -> Option<f64> {
        match &self.lies {
            PixelGeometry::Sicd { plane, .. } => plane.as_ref()?.column_band,
            _ => None,
        }
    }

    /// Whether both images have the same size and the same pixels: grids, frames and rasters must be equal where both are known.
    pub fn has_pixels_of(&self, other: &Self) -> bool {
        if let (PixelGeometry::Map(own), PixelGeometry::Map(theirs)) = (&self.lies, &other.lies) {
            return own == theirs;
        }
        let (Some((own, own_frame)), Some((theirs, their_frame))) = (self.grid(), other.grid())
        else {
            // Missing metadata cannot contradict the other image.
            return true;
        };
        let local = SceneFrame::Local;
        let frames = [own_frame.unwrap_or(local), their_frame.unwrap_or(local)];
        own == theirs && (frames.contains(&local) || frames[0].agrees_with(&frames[1]))
    }

    /// Move the grid by a number of pixels along rows and columns, so that its pixels show the points `p + pixels` of the original grid. Returns whether the image has such a
    /// grid: flat, and recorded.
    pub fn move_grid(&mut self, pixels: [f64; 2]) -> bool {
        match &mut self.lies {
            PixelGeometry::Grid { grid, .. } if grid.relief.is_none() => {
                grid.rows.start += pixels[0] * grid.rows.step;
                grid.columns.start += pixels[1] * grid.columns.step;
                true
            }
            _ => false,
        }
    }

    /// Georeference the scene's origin, with x east and y north, replacing the recorded frame. Images without a scene frame are unchanged.
    #[must_use]
    pub fn placed(mut self, origin: &subaperture_model::geometry::Geodetic) -> Self {
        if let PixelGeometry::Grid { frame, .. } = &mut self.lies {
            *frame = Some(SceneFrame::east_north_up(origin));
        }
        self
    }
}
