//! Viewer for images of any size in a browser, with free pan and zoom.
//!
//! ```text
//! Product (pixels in their files, grid, frame) ─┐                       ┌─ tiles, phases, values, cuts, responses: computed on request
//! Layer (GeoJSON, a track) ─────────────────────┴─> Gallery ─> Server ──┴─ page: Leaflet and scripts, embedded in the program
//! ```
//!
//! | path | content |
//! |---|---|
//! | `/`, `/view.css`, `/view.js`, `/histogram.js`, `/axes.js`, `/measure.js`, `/region.js`, `/doppler.js`, `/leaflet.css`, `/leaflet.js`, `/licences` | the page |
//! | `/colours` | colour maps, JSON |
//! | `/state` | images shown, and the progress of their overviews, JSON |
//! | `/tile/IMAGE/LEVEL/ROW/COLUMN` | 256 x 256 cells of `2^LEVEL` pixels a side: mean power in 16-bit tenths of dB, little-endian; the lowest number marks a missing level |
//! | `/phase/IMAGE/ROW/COLUMN` | phases of the pixels of a level-0 tile: one byte each, in 1/256 turn |
//! | `/look/IMAGE/FROM/TO/LEVEL/ROW/COLUMN` | sub-aperture tile; FROM and TO in thousandths of the aperture ([`subaperture_quality::aperture`]) |
//! | `/value/IMAGE/ROW/COLUMN` | value and position of a pixel, JSON |
//! | `/cut/IMAGE/ROW/COLUMN/ROW/COLUMN` | levels along a line, JSON |
//! | `/statistics/IMAGE/ROW/COLUMN/ROW/COLUMN` | statistics of the intensity between a first row and column and a last row and column (excluded), JSON |
//! | `/point/IMAGE/ROW/COLUMN/SEARCH` | point response of the brightest point near a pixel, JSON |
//! | `/doppler/MAPS/SUBCPI/IMAGE/ROW/COLUMN` | range-Doppler map around a pixel's position, JSON |
//! | `/layer/LAYER/IMAGE` | shapes of a layer in rows and columns of an image, JSON |
//!
//! Images are numbered from 0: no file path is part of a request. No request changes any state.
//!
//! The state of each image has these fields, among others:
//!
//! | field | content |
//! |---|---|
//! | `right`, `up` | 1 if columns run to the right, and rows up, on the page; else -1 |
//! | `steps_m` | row and column spacing in the image's plane, metres (mid-range for a polar grid); `null` without a grid |
//! | `axes.rows`, `axes.columns` | `name`, `unit`, `start` (value of the first pixel's centre) and `step` of the values along rows and columns |
//! | `axes.tilt_deg` | angle between the image's plane and the horizontal plane: 0 for a ground plane, the slant angle for a slant plane |
//! | `axes.north`, `axes.look` | direction of north, and from the antenna to the scene, at the image's centre: unit vector along ascending rows and columns; `null` if unknown. Of a polar grid: `north` along the plane's y and x axes, no `look` |
//! | `axes.antenna_m` | antenna of a polar grid: metres from the pole along the plane's x and y axes and its normal; otherwise `null` |
//! | `scale`, `histogram` | automatic levels (upper level, dynamic range), and the counts that they were chosen from |
//!
//! # Limits
//! A preview of every n-th pixel is available at once. One thread then computes the overview in one pass: planes of
//! mean power from the third level on, or as fine as memory allows, at 1/12 byte per pixel. Finer tiles are computed on
//! request from at most 2048 x 2048 pixels, read 1 MiB at a time. A sub-aperture tile transforms 768 x 768 pixels at a time
//! and takes 22 MB; statistics of a region take 1 MiB whatever its size, and end when the client does; a point response thousands of pixels wide takes up to 170 MB. The number of concurrent computations
//! is [`Bounds::computing`]; further requests wait, except for the state, which is encoded on a thread of its own. 48 MiB of decoded tiles are cached per tiled image. Connections are
//! limited as for the capture page.
//!
//! The levels at the start and the histogram are those of the picture that [`subaperture_plot::quicklook_within`] draws of the same image
//! within [`Bounds::picture_bytes`]; of an image whose tiles are not all there, those of its overview of at most 512 x 512 cells.

mod axes;
mod cut;
mod doppler;
mod gallery;
mod histogram;
mod layer;
mod look;
mod overview;
mod pixels;
mod point;
mod region;
mod routes;
#[cfg(test)]
mod samples;
mod shown;
mod tile;

use glam::DVec3;
use subaperture_model::geometry::{Axis, ImageGrid, SceneFrame};
use subaperture_model::image::ImageSource;
use subaperture_model::resolution::support::Looks;
use subaperture_quality::response::Carrier;

pub use doppler::{DopplerMap, DopplerMaps};
pub use gallery::{Bounds, Gallery, MAX_STATE_BYTES};
pub use layer::Layer;
pub use overview::TILE;
pub use pixels::Pixels;
pub(crate) use routes::product_routes;
pub use subaperture_quality::aperture::Aperture;

/// Full check of an image's file against its metadata. Returns a description of the fault.
pub type Check = Box<dyn Fn() -> Result<(), String> + Send + Sync>;

/// Image with its metadata.
pub struct Product {
    /// Name shown on the page.
    pub name: String,
    /// Pixels of the image.
    pub pixels: Pixels,
    /// Image grid; `None` for a plain array.
    pub grid: Option<ImageGrid>,
    /// Scene frame of the grid.
    pub frame: SceneFrame,
    /// Whether rows run downwards on the page, as in SICD. Otherwise row 0 is at the bottom.
    pub rows_down: bool,
    /// Whether the grid lies in a slant plane. A pixel's position on the Earth is then found by projection along the
    /// plane's normal to the ground at the height of the frame's origin. This neglects the curvature of wave fronts:
    /// the error is the squared distance from the origin over twice the range.
    pub slant: bool,
    /// Antenna position at mid-aperture and wavelength at mid-band, for the line of sight of point responses.
    pub carrier: Option<Carrier>,
    /// Antenna position at mid-aperture for the direction of view on the page, metres, scene frame. Default: that of `carrier`.
    pub antenna_m: Option<DVec3>,
    /// Pulses and weights that the image was formed from, for the theoretical resolution.
    pub looks: Option<Looks>,
    /// Mapping from spatial frequency to aperture position, for sub-aperture tiles.
    pub aperture: Option<Aperture>,
    /// Full check of the file, run once all images are shown.
    pub check: Option<Check>,
}

impl Product {
    /// Image without metadata.
    pub fn new(name: String, pixels: Pixels) -> Self {
        Self {
            name,
            pixels,
            grid: None,
            frame: SceneFrame::Local,
            rows_down: false,
            slant: false,
            carrier: None,
            antenna_m: None,
            looks: None,
            aperture: None,
            check: None,
        }
    }

    /// Image grid, or a grid in pixels if there is none.
    fn any_grid(&self) -> ImageGrid {
        let (rows, columns) = self.pixels.size();
        let axis = |count| Axis {
            start: 0.0,
            step: 1.0,
            count,
        };
        self.grid
            .clone()
            .unwrap_or_else(|| ImageGrid::horizontal(axis(columns), axis(rows), 0.0))
    }
}
