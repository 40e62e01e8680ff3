//! GeoTIFF files as images.

use std::path::Path;
use std::sync::Mutex;

use num_complex::Complex32;

use subaperture_maps::terrain::TerrainError;
use subaperture_maps::terrain::bands::{GeoTiff, Tags};
use subaperture_maps::{Projection, Raster};
use subaperture_model::geometry::Zone;
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, blocks,
};

use super::Values;

const RASTER_TYPE: u16 = 1025;
const GEOGRAPHIC_TYPE: u16 = 2048;
const PROJECTED_TYPE: u16 = 3072;
/// Value of `GTRasterType` for pixels as points.
const POINT: u16 = 2;
const WGS_84: u16 = 4326;
/// Maximum number of pixels. Compressed strips do not limit it.
const MAX_PIXELS: u128 = 1 << 36;

/// Open GeoTIFF. Pixels without data are NaN.
#[derive(Debug)]
pub struct MapImage {
    // Windows are read one at a time.
    file: Mutex<GeoTiff>,
    size: (usize, usize),
    values: Values,
    /// Scale and offset of quantised levels, dB.
    decibels: Option<[f64; 2]>,
    raster: Result<Raster, String>,
}

impl MapImage {
    /// Open a file; an unpacked strip or tile may take up to `allowed_bytes`.
    ///
    /// # Errors
    /// [`TerrainError`], also if there are several bands other than a real and an imaginary part.
    pub fn open(path: &Path, allowed_bytes: u64) -> Result<Self, TerrainError> {
        let file = GeoTiff::open(path, allowed_bytes)?;
        let format = |what: String| TerrainError::Format {
            path: path.to_owned(),
            what,
        };
        let number = |role: &str| file.item(role).and_then(|text| text.parse::<f64>().ok());
        let scaled = number("scale").zip(number("offset"));
        let decibels = scaled
            .filter(|_| file.item("unittype") == Some("dB"))
            .map(|(scale, offset)| [scale, offset]);
        let values = match (file.bands(), file.item("description"), decibels) {
            (2, Some("real part"), _) => Values::Complex,
            (1, _, Some([scale, offset])) if file.is_bytes() => {
                Values::Levels([offset + scale, offset + 255.0 * scale])
            }
            (1, Some("amplitude"), _) => Values::Amplitudes,
            (1, ..) => Values::Greys,
            (bands, ..) => {
                return Err(format(format!(
                    "expected one band, or a real and an imaginary part; found {bands} bands without these names"
                )));
            }
        };
        let size = file.size();
        if size.0 == 0 || size.1 == 0 {
            return Err(format(
                "expected an image, found one without pixels".to_owned(),
            ));
        }
        let pixels = size.0 as u128 * size.1 as u128;
        if pixels > MAX_PIXELS {
            return Err(format(format!(
                "expected at most {MAX_PIXELS} pixels, found {} rows x {} columns",
                size.0, size.1
            )));
        }
        Ok(Self {
            size,
            values,
            decibels: decibels.filter(|_| matches!(values, Values::Levels(_))),
            raster: raster(file.tags(), size),
            file: Mutex::new(file),
        })
    }

    /// Meaning of the pixel values.
    pub fn values(&self) -> Values {
        self.values
    }

    /// Position of the pixels on the map.
    ///
    /// # Errors
    /// The reason why the tags do not define a supported raster.
    pub fn raster(&self) -> Result<Raster, String> {
        self.raster.clone()
    }
}

impl ImageSource for MapImage {
    fn size(&self) -> (usize, usize) {
        self.size
    }

    fn places(&self) -> PixelBlocks {
        blocks(self.size.0, self.size.1)
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        let numbers = self
            .file
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .window(place)?;
        let pixels = match (self.values, self.decibels) {
            (Values::Complex, _) => numbers
                .chunks_exact(2)
                .map(|pair| Complex32::new(pair[0], pair[1]))
                .collect(),
            (_, Some([scale, offset])) => numbers
                .into_iter()
                .map(|grey| {
                    let level_db = offset + scale * f64::from(grey);
                    Complex32::new(libm::pow(10.0, level_db / 20.0) as f32, 0.0)
                })
                .collect(),
            _ => numbers
                .into_iter()
                .map(|number| Complex32::new(number, 0.0))
                .collect(),
        };
        Ok(Image {
            rows: place[0].len(),
            columns: place[1].len(),
            pixels,
        })
    }
}

/// Raster defined by the tags: WGS 84 by UTM or in degrees, north up.
fn raster(tags: &Tags, (rows, columns): (usize, usize)) -> Result<Raster, String> {
    let (&[step_x, step_y, ..], &[i, j, _, x, y, _]) = (&tags.scale[..], &tags.tie[..]) else {
        return Err(
            "expected one tie point and a pixel scale (north up); found none, or a rotated raster"
                .to_owned(),
        );
    };
    if !(step_x > 0.0 && step_y > 0.0 && [step_x, step_y, i, j, x, y].iter().all(|n| n.is_finite()))
    {
        return Err(format!(
            "expected a positive pixel scale and a finite tie point, found a scale of {step_x} x {step_y}"
        ));
    }
    // For pixels as points, the tie point is the pixel centre.
    let half = match tags.key(RASTER_TYPE) {
        Some(POINT) => 0.5,
        _ => 0.0,
    };
    let (west, north) = (x - (i + half) * step_x, y + (j + half) * step_y);
    let code = tags.key(PROJECTED_TYPE);
    let projection = match (code, tags.key(GEOGRAPHIC_TYPE)) {
        (Some(code), _) => {
            let number = |first: u16| code.checked_sub(first).and_then(|n| u8::try_from(n).ok());
            let zone = match code {
                32_601..=32_660 => number(32_600).map(|n| Zone::new(n, true)),
                32_701..=32_760 => number(32_700).map(|n| Zone::new(n, false)),
                _ => None,
            };
            let Some(Ok(zone)) = zone else {
                return Err(format!(
                    "expected UTM on WGS 84 (EPSG 32601 to 32660, 32701 to 32760), found EPSG {code}"
                ));
            };
            Projection::Utm(zone)
        }
        (None, Some(WGS_84)) => Projection::Geographic {
            near_deg: west + 0.5 * columns as f64 * step_x,
        },
        (None, found) => {
            return Err(match found {
                Some(code) => format!("expected WGS 84 (EPSG 4326), found EPSG {code}"),
                None => "expected WGS 84 (EPSG 4326), found no coordinate system".to_owned(),
            });
        }
    };
    let centre = projection.place([
        west + 0.5 * columns as f64 * step_x,
        north - 0.5 * rows as f64 * step_y,
    ]);
    Ok(Raster {
        projection,
        west,
        north,
        step: [step_x, step_y],
        rows,
        columns,
        pixel_m: step_x * projection.metres(&centre)[0],
    })
}
