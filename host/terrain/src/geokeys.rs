//! What GeoTIFF says of where its pixels are: OGC 19-008, of which this reads
//! - models: geographic, and projected by UTM, both on WGS 84, by their EPSG codes;
//! - places: one tie point and a scale, or a matrix without rotation;
//! - pixels as areas, whose heights are those of their middles, and as points;
//! - heights in metres.
//!
//! Everything else is refused, and says what it is.

use subaperture_model::geometry::Zone;

use crate::lattice::{Lattice, Projection};

const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const GEOGRAPHIC_TYPE: u16 = 2048;
const ANGULAR_UNITS: u16 = 2054;
const PROJECTED_TYPE: u16 = 3072;
const LINEAR_UNITS: u16 = 3076;
const VERTICAL_UNITS: u16 = 4099;

const PROJECTED: u16 = 1;
const GEOGRAPHIC: u16 = 2;
const AREA: u16 = 1;
const POINT: u16 = 2;
/// Geographic systems that are WGS 84: two and three dimensions.
const WGS_84: [u16; 2] = [4326, 4979];
const DEGREE: u16 = 9102;
const METRE: u16 = 9001;

/// The tags, as they are.
#[derive(Debug, Default)]
pub(crate) struct GeoTags {
    /// `GeoKeyDirectory`.
    pub(crate) keys: Vec<u16>,
    /// `ModelPixelScale`.
    pub(crate) scale: Vec<f64>,
    /// `ModelTiepoint`.
    pub(crate) tie: Vec<f64>,
    /// `ModelTransformation`.
    pub(crate) matrix: Vec<f64>,
}

impl GeoTags {
    /// A key's value, if it is there and held in the directory itself.
    fn key(&self, wanted: u16) -> Option<u16> {
        let entries = self.keys.get(4..)?.chunks_exact(4);
        let mut own = entries.filter(|entry| entry[0] == wanted && entry[1] == 0);
        own.next().map(|entry| entry[3])
    }

    /// Where posts lie, of so many columns.
    pub(crate) fn lattice(&self, columns: usize) -> Result<Lattice, String> {
        if self.keys.len() < 4 {
            return Err(
                "it is a TIFF without GeoTIFF's keys, so that nobody knows where it lies"
                    .to_owned(),
            );
        }
        let projection = self.projection()?;
        let units = [
            (ANGULAR_UNITS, DEGREE, "angles in degrees"),
            (LINEAR_UNITS, METRE, "lengths in metres"),
            (VERTICAL_UNITS, METRE, "heights in metres"),
        ];
        for (key, wanted, what) in units {
            if let Some(found) = self.key(key).filter(|&found| found != wanted) {
                return Err(format!(
                    "its units are EPSG {found} (key {key}), and {what} are read (EPSG {wanted}): convert it"
                ));
            }
        }
        // Pixel coordinates of the first post: the middle of an area.
        let first = match self.key(RASTER_TYPE) {
            None | Some(AREA) => 0.5,
            Some(POINT) => 0.0,
            Some(other) => {
                return Err(format!(
                    "its raster type is {other} (key {RASTER_TYPE}), and 1 (pixel is area) and 2 (pixel is point) are known"
                ));
            }
        };
        let [[a, d], [e, h]] = self.affine()?;
        let lattice = Lattice {
            projection,
            origin: [d + a * first, h + e * first],
            steps: [e, a],
            middle_column: 0.5 * columns.saturating_sub(1) as f64,
        };
        let numbers = [lattice.origin, lattice.steps].concat();
        match numbers.iter().all(|x| x.is_finite()) && a > 0.0 && e != 0.0 {
            true => Ok(lattice),
            false => Err(format!(
                "its pixels are {a} by {e} apart from {d}, {h}: positive steps eastwards, and finite numbers, are read"
            )),
        }
    }

    fn projection(&self) -> Result<Projection, String> {
        let convert = "convert it to EPSG 4326 or to UTM on WGS 84 (EPSG 32601 to 32660, 32701 to 32760), as gdalwarp -t_srs does";
        match self.key(MODEL_TYPE) {
            Some(GEOGRAPHIC) => match self.key(GEOGRAPHIC_TYPE) {
                Some(code) if WGS_84.contains(&code) => Ok(Projection::Geographic),
                Some(code) => Err(format!("its coordinates are of EPSG {code}: {convert}")),
                None => Err(format!(
                    "its geographic coordinates are of no known system: {convert}"
                )),
            },
            Some(PROJECTED) => {
                let code = self.key(PROJECTED_TYPE);
                let zone = match code {
                    Some(code @ 32601..=32660) => Zone::new((code - 32600) as u8, true).ok(),
                    Some(code @ 32701..=32760) => Zone::new((code - 32700) as u8, false).ok(),
                    _ => None,
                };
                let named = code.map_or("of no known system".to_owned(), |code| {
                    format!("of EPSG {code}")
                });
                zone.map(Projection::Utm)
                    .ok_or_else(|| format!("its coordinates are {named}: {convert}"))
            }
            _ => Err(format!(
                "its coordinates are neither geographic nor projected: {convert}"
            )),
        }
    }

    /// `[[east a column, east at 0], [north a row, north at 0]]`, in pixel coordinates.
    fn affine(&self) -> Result<[[f64; 2]; 2], String> {
        if let [a, b, _, d, e, f, _, h, ..] = self.matrix[..] {
            return match b == 0.0 && e == 0.0 {
                true => Ok([[a, d], [f, h]]),
                false => Err(
                    "its rows and columns are turned against east and north: warp it, as gdalwarp does"
                        .to_owned(),
                ),
            };
        }
        match (&self.scale[..], &self.tie[..]) {
            (&[x, y, ..], &[column, row, _, east, north, _]) => {
                Ok([[x, east - column * x], [-y, north + row * y]])
            }
            (_, tie) if tie.len() > 6 => Err(format!(
                "it has {} tie points, and one with a scale is read: warp it, as gdalwarp does",
                tie.len() / 6
            )),
            _ => Err("it says no places of its pixels (ModelPixelScale and ModelTiepoint, or ModelTransformation)".to_owned()),
        }
    }
}
