//! Images in a browser: as large as they are, any part of them, any zoom.
//!
//! ```text
//! Product (pixels in their files, grid, frame) ─┐                       ┌─ tiles, phases, values, cuts, responses: computed when they are asked for
//! Layer (GeoJSON, a track) ─────────────────────┴─> Gallery ─> Server ──┴─ the page: Leaflet and a script, in the program
//! ```
//!
//! | path | what it is |
//! |---|---|
//! | `/`, `/view.css`, `/view.js`, `/measure.js`, `/doppler.js`, `/leaflet.css`, `/leaflet.js`, `/licences` | the page |
//! | `/colours` | colour maps, JSON |
//! | `/state` | what is shown, and how far its overview is, JSON |
//! | `/tile/IMAGE/LEVEL/ROW/COLUMN` | 256 x 256 cells of `2^LEVEL` pixels a side: 16-bit tenths of dB of their mean power, little-endian, the lowest number where there is nothing |
//! | `/phase/IMAGE/ROW/COLUMN` | phases of the pixels of such a tile of level 0: 256ths of a turn, a byte each |
//! | `/look/IMAGE/FROM/TO/LEVEL/ROW/COLUMN` | a tile of a part of the aperture, in thousandths of it ([`subaperture_quality::aperture`]) |
//! | `/value/IMAGE/ROW/COLUMN` | a pixel and where it is, JSON |
//! | `/cut/IMAGE/ROW/COLUMN/ROW/COLUMN` | levels along a line, JSON |
//! | `/point/IMAGE/ROW/COLUMN` | the response of the brightest point near a pixel, JSON |
//! | `/doppler/MAPS/SUBCPI/IMAGE/ROW/COLUMN` | a range-Doppler map about a pixel's place, JSON |
//! | `/layer/LAYER/IMAGE` | a layer's shapes in rows and columns of an image, JSON |
//!
//! Images are numbers from 0: no path of a file is ever part of a request. Nothing that a client asks changes anything.
//!
//! # Bounds
//! A first look at every so manieth pixel is there at once. The overview, planes of mean power from the third level on or as fine as memory allows,
//! is made in one pass by one thread: a twelfth of a byte a pixel. Finer tiles are computed of their pixels, at most 2048 x 2048, 1 MiB at a
//! time (those of a part of the aperture of 1152 x 1152 at once, 20 MB; the response of a point that is thousands of pixels wide up to 170 MB), as many at once as there are threads; who asks meanwhile waits. Of an image in tiles 48 MiB of them are kept.
//! Connections are bounded as those of a capture's page.

mod cut;
mod doppler;
mod gallery;
mod layer;
mod look;
mod overview;
mod pixels;
mod point;
mod routes;
mod shown;
mod tile;

use subaperture_model::geometry::{Axis, ImageGrid, SceneFrame};
use subaperture_model::image::Parts;
use subaperture_quality::response::Carrier;
use subaperture_resolution::support::Looks;

pub use doppler::{DopplerMap, DopplerMaps};
pub use gallery::{Bounds, Gallery};
pub use layer::Layer;
pub use overview::TILE;
pub use pixels::Pixels;
pub(crate) use routes::product_routes;
pub use subaperture_quality::aperture::Aperture;

/// Reads all of an image's file, for what its record says of it; what is wrong.
pub type Check = Box<dyn Fn() -> Result<(), String> + Send + Sync>;

/// An image to be shown, and what is known of it.
pub struct Product {
    /// What it is called.
    pub name: String,
    /// Its pixels.
    pub pixels: Pixels,
    /// Where they lie; none of an array alone.
    pub grid: Option<ImageGrid>,
    /// Where the grid is.
    pub frame: SceneFrame,
    /// Whether rows run downwards on the page, as in SICD; else row 0 is the lowest.
    pub rows_down: bool,
    /// Whether the grid's plane is none of the ground, so that a pixel's place on the Earth is that on the ground at the height of the frame's origin, along
    /// the plane's normal: right to the curvature of wave fronts, a square of the distance from the origin over twice the range.
    pub slant: bool,
    /// Where it was seen from.
    pub carrier: Option<Carrier>,
    /// What it was formed of.
    pub looks: Option<Looks>,
    /// By which frequencies parts of its aperture are told.
    pub aperture: Option<Aperture>,
    /// Reads all of it for faults, once everything is shown.
    pub check: Option<Check>,
}

impl Product {
    /// An image of which nothing else is known.
    pub fn new(name: String, pixels: Pixels) -> Self {
        Self {
            name,
            pixels,
            grid: None,
            frame: SceneFrame::Local,
            rows_down: false,
            slant: false,
            carrier: None,
            looks: None,
            aperture: None,
            check: None,
        }
    }

    /// Its grid, or one of pixels.
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
