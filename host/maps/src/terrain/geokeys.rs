//! Georeference of a GeoTIFF (OGC 19-008). Supported:
//! - coordinate systems: geographic and UTM, both on WGS 84 or NAD83, by EPSG code;
//! - transforms: one tie point and a scale, or a matrix without rotation;
//! - `PixelIsArea`, with heights at pixel centres, and `PixelIsPoint`;
//! - heights in metres and feet: [`vertical`].
//!
//! NAD83 coordinates are used as WGS 84, from which they differ by 1 to 2 m in North America; [`Tags::is_nad83`] reports it.
//!
//! Everything else is an error that names what was found.

use subaperture_model::geometry::Zone;

use crate::terrain::lattice::{Lattice, Projection};
use crate::terrain::vertical::{self, VERTICAL_TYPE, VERTICAL_UNITS, Vertical};

const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const GEOGRAPHIC_TYPE: u16 = 2048;
const ANGULAR_UNITS: u16 = 2054;
const PROJECTED_TYPE: u16 = 3072;
const LINEAR_UNITS: u16 = 3076;

const PROJECTED: u16 = 1;
const GEOGRAPHIC: u16 = 2;
const AREA: u16 = 1;
const POINT: u16 = 2;
/// EPSG codes of WGS 84, two- and three-dimensional.
const WGS_84: [u16; 2] = [4326, 4979];
/// EPSG codes of NAD83: original, CSRS (Canada), HARN, NSRS2007, 2011 in two and three dimensions.
const NAD83: [u16; 6] = [4269, 4617, 4152, 4759, 6318, 6319];
const DEGREE: u16 = 9102;
const METRE: u16 = 9001;

/// Geographic tags of a GeoTIFF, unparsed; empty where absent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tags {
    /// `GeoKeyDirectory`.
    pub keys: Vec<u16>,
    /// `ModelPixelScale`.
    pub scale: Vec<f64>,
    /// `ModelTiepoint`.
    pub tie: Vec<f64>,
    /// `ModelTransformation`.
    pub matrix: Vec<f64>,
}

/// Northern UTM zone of an EPSG code of NAD83 or NAD83(2011).
fn nad83_zone(code: u16) -> Option<u8> {
    match code {
        26901..=26923 => Some((code - 26900) as u8),
        6328..=6329 => Some((code - 6328 + 59) as u8),
        6330..=6348 => Some((code - 6329) as u8),
        _ => None,
    }
}

impl Tags {
    /// A key's value, if it is stored in the key directory itself.
    pub fn key(&self, wanted: u16) -> Option<u16> {
        let entries = self.keys.get(4..)?.chunks_exact(4);
        let mut own = entries.filter(|entry| entry[0] == wanted && entry[1] == 0);
        own.next().map(|entry| entry[3])
    }

    /// Post positions of a raster of `columns` columns.
    pub(crate) fn lattice(&self, columns: usize) -> Result<Lattice, String> {
        if self.keys.len() < 4 {
            return Err(
                "expected GeoTIFF keys (GeoKeyDirectory), found none; the position of the raster is unknown"
                    .to_owned(),
            );
        }
        let projection = self.projection()?;
        let units = [
            (ANGULAR_UNITS, DEGREE, "angles in degrees"),
            (LINEAR_UNITS, METRE, "lengths in metres"),
        ];
        for (key, wanted, what) in units {
            if let Some(found) = self.key(key).filter(|&found| found != wanted) {
                return Err(format!(
                    "expected {what} (EPSG {wanted}), found units of EPSG {found} (key {key}); convert the file"
                ));
            }
        }
        // Pixel coordinates of the first post: the centre of an area.
        let first = match self.key(RASTER_TYPE) {
            None | Some(AREA) => 0.5,
            Some(POINT) => 0.0,
            Some(other) => {
                return Err(format!(
                    "expected raster type 1 (PixelIsArea) or 2 (PixelIsPoint), found {other} (key {RASTER_TYPE})"
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
                "pixel spacing {a} by {e} from {d}, {h}: expected finite numbers and a positive step eastwards"
            )),
        }
    }

    /// Whether coordinates are NAD83.
    pub(crate) fn is_nad83(&self) -> bool {
        match self.key(MODEL_TYPE) {
            Some(GEOGRAPHIC) => self
                .key(GEOGRAPHIC_TYPE)
                .is_some_and(|code| NAD83.contains(&code)),
            Some(PROJECTED) => self.key(PROJECTED_TYPE).and_then(nad83_zone).is_some(),
            _ => false,
        }
    }

    /// Unit and datum of heights; `band` is GDAL's band unit, empty if absent.
    pub(crate) fn vertical(&self, band: &str) -> Result<Vertical, String> {
        vertical::of(self.key(VERTICAL_TYPE), self.key(VERTICAL_UNITS), band)
    }

    fn projection(&self) -> Result<Projection, String> {
        let convert = "convert the file to EPSG 4326 or to UTM on WGS 84 (EPSG 32601 to 32660, 32701 to 32760), for example with gdalwarp -t_srs";
        match self.key(MODEL_TYPE) {
            Some(GEOGRAPHIC) => match self.key(GEOGRAPHIC_TYPE) {
                Some(code) if WGS_84.contains(&code) || NAD83.contains(&code) => {
                    Ok(Projection::Geographic)
                }
                Some(code) => Err(format!(
                    "unsupported coordinate system EPSG {code}; {convert}"
                )),
                None => Err(format!(
                    "geographic coordinates without an EPSG code; {convert}"
                )),
            },
            Some(PROJECTED) => {
                let code = self.key(PROJECTED_TYPE);
                let zone = match code {
                    Some(code @ 32601..=32660) => Zone::new((code - 32600) as u8, true).ok(),
                    Some(code @ 32701..=32760) => Zone::new((code - 32700) as u8, false).ok(),
                    Some(code) => nad83_zone(code).and_then(|zone| Zone::new(zone, true).ok()),
                    None => None,
                };
                let named = code.map_or("without an EPSG code".to_owned(), |code| {
                    format!("EPSG {code}")
                });
                zone.map(Projection::Utm).ok_or_else(|| {
                    format!("unsupported projected coordinate system, {named}; {convert}")
                })
            }
            _ => Err(format!(
                "coordinates are neither geographic nor projected; {convert}"
            )),
        }
    }

    /// `[[east per column, east at 0], [north per row, north at 0]]`, in pixel coordinates.
    fn affine(&self) -> Result<[[f64; 2]; 2], String> {
        if let [a, b, _, d, e, f, _, h, ..] = self.matrix[..] {
            return match b == 0.0 && e == 0.0 {
                true => Ok([[a, d], [f, h]]),
                false => Err(
                    "rows and columns are rotated against east and north; warp the file, for example with gdalwarp"
                        .to_owned(),
                ),
            };
        }
        match (&self.scale[..], &self.tie[..]) {
            (&[x, y, ..], &[column, row, _, east, north, _]) => {
                Ok([[x, east - column * x], [-y, north + row * y]])
            }
            (_, tie) if tie.len() > 6 => Err(format!(
                "expected one tie point and a scale, found {} tie points; warp the file, for example with gdalwarp",
                tie.len() / 6
            )),
            _ => Err(
                "expected ModelPixelScale and ModelTiepoint, or ModelTransformation; found neither"
                    .to_owned(),
            ),
        }
    }
}
