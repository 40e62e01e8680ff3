//! Picture as a scene, with reflectivity given by brightness.
//!
//! A pixel of brightness `b` (1 for white) has `sigma0 = white sigma0 b^2`: amplitude is proportional to brightness, as
//! in a radar image displayed in amplitude. The picture is stretched over an extent of the plane and divided into cells
//! of the spacing. The point at the centre of each cell has the cell's mean cross section,
//!
//! ```text
//! E |a|^2 = integral over the cell of sigma0 dA,
//! ```
//!
//! so that the total cross section is that of the picture at any spacing. Black cells have no point. With speckle,
//! amplitudes are complex Gaussian, as for rough ground. Without speckle they are real and positive, which is a smooth
//! plane: choose a spacing not finer than the resolution, since points in one cell then add up with the phases of their
//! paths.
//!
//! File formats: greyscale PNG with 8 or 16 bits (the top row has the largest y; 16 bits have 96 dB of dynamic range),
//! and real two-dimensional NumPy arrays (row 0 has the smallest y, as in images of this project; values are
//! brightness, not negative). Gamma is not corrected: values are used as they are.

use std::io::BufReader;
use std::path::Path;

use glam::DVec3;
use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use subaperture_io::input::open_file;

use super::SceneError;
use super::clutter::{MAX_POINTS, check_points};
use crate::Scatterer;
use crate::random::complex_normal;
use subaperture_io::npy;
use subaperture_model::geometry::Extent;
use subaperture_model::units::power_of_db;

/// Random stream.
const PICTURE: u64 = u64::from_be_bytes(*b"picture\0");

/// Maximum number of pixels of a PNG file.
const MAX_PIXELS: u64 = 1 << 28;

/// Largest compression ratio of Deflate, which PNG uses: 258 bytes from 2 bits.
const MAX_UNPACKING: u64 = 1032;

/// Largest array that is read, bytes: as many values as the maximum number of points.
const MAX_BYTES: u64 = 8 << 26;

/// Brightness on a rectangle, rows by ascending y.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    rows: usize,
    columns: usize,
    brightness: Vec<f32>,
}

/// Placement of a picture in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Rectangle covered by the picture.
    pub extent: Extent,
    /// Height (z), metres.
    pub height_m: f64,
    /// Spacing of the points, metres; rounded to a divisor of the extent.
    pub spacing_m: f64,
    /// Cross section per square metre of white pixels, dB.
    pub white_sigma0_db: f64,
    /// Whether amplitudes are complex Gaussian (speckle).
    pub speckle: bool,
}

impl Picture {
    /// Make a picture from `rows * columns` finite, non-negative brightness values; row 0 has the smallest y.
    ///
    /// # Errors
    /// [`SceneError`] for a wrong number of values, or a value that is negative or not finite.
    pub fn new(rows: usize, columns: usize, brightness: Vec<f32>) -> Result<Self, SceneError> {
        if rows == 0 || columns == 0 || rows.checked_mul(columns) != Some(brightness.len()) {
            return Err(SceneError(format!(
                "picture of {rows} x {columns} pixels with {} values: expected one value per pixel and at least one pixel",
                brightness.len()
            )));
        }
        if let Some(n) = brightness
            .iter()
            .position(|b| !(*b >= 0.0 && b.is_finite()))
        {
            return Err(SceneError(format!(
                "picture with a brightness of {} in row {}, column {}: expected finite values that are not negative",
                brightness[n],
                n / columns,
                n % columns
            )));
        }
        Ok(Self {
            rows,
            columns,
            brightness,
        })
    }

    /// Brightness of the pixel at a position in the picture, both coordinates from 0 to 1, from the smallest x and y.
    pub(crate) fn value_at(&self, x: f64, y: f64) -> f32 {
        let place = |part: f64, count: usize| ((part * count as f64) as usize).min(count - 1);
        let (row, column) = (place(y, self.rows), place(x, self.columns));
        self.brightness[row * self.columns + column]
    }

    /// Read a `.png` or `.npy` file.
    ///
    /// # Errors
    /// [`SceneError`] if the file cannot be read or has another format.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        Self::with_white(path).map(|(picture, _)| picture)
    }

    /// Read the values of a `.png` or `.npy` file, as grey levels (0 to 255 or 65535) or as numbers.
    ///
    /// # Errors
    /// As of [`Self::read`].
    pub fn read_values(path: &Path) -> Result<Self, SceneError> {
        let (mut picture, white) = Self::with_white(path)?;
        for value in &mut picture.brightness {
            *value = (*value * white).round();
        }
        Ok(picture)
    }

    /// Picture, and its value of a brightness of 1.
    fn with_white(path: &Path) -> Result<(Self, f32), SceneError> {
        let about =
            |what: &dyn std::fmt::Display| SceneError(format!("{}: {what}", path.display()));
        match path.extension().and_then(|e| e.to_str()) {
            Some("npy") => {
                let array = npy::Array::read(path, None, MAX_BYTES)
                    .map_err(|e| SceneError(e.to_string()))?;
                let (Some(values), &[rows, columns]) = (array.real(), array.shape.as_slice())
                else {
                    return Err(about(
                        &"not a picture: expected a two-dimensional array of real numbers",
                    ));
                };
                let brightness = values.iter().map(|&v| v as f32).collect();
                let picture = Self::new(rows, columns, brightness).map_err(|e| about(&e.0))?;
                Ok((picture, 1.0))
            }
            Some("png") => read_png(path).map_err(|what| about(&what)),
            _ => Err(about(&"unknown picture format: expected .png or .npy")),
        }
    }

    /// Points of the picture; the same seed gives the same points. Pictures with one seed and different `index` differ.
    ///
    /// # Errors
    /// [`SceneError`] for an empty extent, values that are not finite, or more than 67 million points.
    pub fn points(
        &self,
        placement: &Placement,
        seed: u64,
        index: u32,
    ) -> Result<Vec<Scatterer>, SceneError> {
        self.points_within(placement, seed, index, MAX_POINTS)
    }

    /// [`Self::points`], with an error beyond `most` points.
    pub(crate) fn points_within(
        &self,
        placement: &Placement,
        seed: u64,
        index: u32,
        most: f64,
    ) -> Result<Vec<Scatterer>, SceneError> {
        let Extent { x_m, y_m } = placement.extent;
        let (width, depth) = (x_m.1 - x_m.0, y_m.1 - y_m.0);
        let lengths = [width, depth, placement.spacing_m];
        let known = placement.height_m.is_finite() && placement.white_sigma0_db.is_finite();
        if !known || lengths.iter().any(|l| !(*l > 0.0 && l.is_finite())) {
            return Err(SceneError(format!(
                "picture of {width} x {depth} m with a point spacing of {} m at height {} m, white {} dB: expected \
                                positive lengths and finite values",
                placement.spacing_m, placement.height_m, placement.white_sigma0_db
            )));
        }
        let cells = |length: f64| (length / placement.spacing_m).round().max(1.0);
        let (across, along) = (cells(width), cells(depth));
        if across * along > MAX_POINTS {
            return Err(SceneError(format!(
                "picture of {across} x {along} points: expected at most {MAX_POINTS}. Give a wider spacing"
            )));
        }
        check_points("picture", across * along, most)?;
        let (dx, dy) = (width / across, depth / along);
        let white_m2 = power_of_db(placement.white_sigma0_db) * dx * dy;
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(PICTURE + u64::from(index));
        let mut points = Vec::new();
        for row in 0..along as usize {
            let from_row = row as f64 / along * self.rows as f64;
            let to_row = (row + 1) as f64 / along * self.rows as f64;
            for column in 0..across as usize {
                let from_column = column as f64 / across * self.columns as f64;
                let to_column = (column + 1) as f64 / across * self.columns as f64;
                let sigma_m2 =
                    white_m2 * self.mean_square((from_row, to_row), (from_column, to_column));
                if sigma_m2 == 0.0 {
                    continue;
                }
                let amplitude = if placement.speckle {
                    complex_normal(&mut random) * (sigma_m2 / 2.0).sqrt()
                } else {
                    Complex64::from(sigma_m2.sqrt())
                };
                points.push(Scatterer {
                    position_m: DVec3::new(
                        x_m.0 + (column as f64 + 0.5) * dx,
                        y_m.0 + (row as f64 + 0.5) * dy,
                        placement.height_m,
                    ),
                    amplitude,
                });
            }
        }
        Ok(points)
    }

    /// Mean of `b^2` over a rectangle in pixel coordinates; pixels are weighted by the part of them inside.
    fn mean_square(&self, rows: (f64, f64), columns: (f64, f64)) -> f64 {
        let inside = |n: usize, (from, to): (f64, f64)| {
            (to.min(n as f64 + 1.0) - from.max(n as f64)).max(0.0)
        };
        let all =
            |(from, to): (f64, f64), count: usize| from as usize..(to.ceil() as usize).min(count);
        let mut sum = 0.0;
        for row in all(rows, self.rows) {
            let mut of_row = 0.0;
            for column in all(columns, self.columns) {
                let b = f64::from(self.brightness[row * self.columns + column]);
                of_row += b * b * inside(column, columns);
            }
            sum += of_row * inside(row, rows);
        }
        sum / ((rows.1 - rows.0) * (columns.1 - columns.0))
    }
}

/// Picture, and the grey level of white.
fn read_png(path: &Path) -> Result<(Picture, f32), String> {
    let file = open_file(path).map_err(|e| e.to_string())?;
    let mut reader = png::Decoder::new(BufReader::new(file))
        .read_info()
        .map_err(|e| e.to_string())?;
    let info = reader.info();
    let (rows, columns) = (info.height as usize, info.width as usize);
    if u64::from(info.height) * u64::from(info.width) > MAX_PIXELS {
        return Err(format!(
            "{rows} x {columns} pixels: expected at most {MAX_PIXELS}"
        ));
    }
    let bytes = match (info.color_type, info.bit_depth) {
        (png::ColorType::Grayscale, png::BitDepth::Eight) => 1,
        (png::ColorType::Grayscale, png::BitDepth::Sixteen) => 2,
        (colour, depth) => {
            return Err(format!(
                "PNG of {colour:?}, {depth:?} bits: expected greyscale with 8 or 16 bits and no transparency"
            ));
        }
    };
    // Checked before memory is allocated, since a damaged file may state any size.
    let packed = path.metadata().map_err(|e| e.to_string())?.len();
    let size = rows as u64 * columns as u64 * bytes as u64;
    if size > packed.saturating_mul(MAX_UNPACKING) {
        return Err(format!(
            "damaged PNG: {packed} bytes cannot hold the stated {rows} x {columns} pixels"
        ));
    }
    let mut data = vec![0; rows * columns * bytes];
    let frame = reader.next_frame(&mut data).map_err(|e| e.to_string())?;
    if frame.line_size != columns * bytes {
        return Err("damaged PNG: the rows have another length than stated".to_owned());
    }
    let mut brightness = Vec::with_capacity(rows * columns);
    for row in data.chunks_exact(columns * bytes).rev() {
        if bytes == 2 {
            let values = row
                .chunks_exact(2)
                .map(|v| u16::from_be_bytes([v[0], v[1]]));
            brightness.extend(values.map(|v| f32::from(v) / f32::from(u16::MAX)));
        } else {
            brightness.extend(row.iter().map(|&v| f32::from(v) / f32::from(u8::MAX)));
        }
    }
    let picture = Picture::new(rows, columns, brightness).map_err(|e| e.0)?;
    let white = match bytes {
        2 => f32::from(u16::MAX),
        _ => f32::from(u8::MAX),
    };
    Ok((picture, white))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Placement over 60 m x 40 m.
    fn placement(spacing_m: f64, speckle: bool) -> Placement {
        Placement {
            extent: Extent {
                x_m: (-20.0, 40.0),
                y_m: (0.0, 40.0),
            },
            height_m: 1.5,
            spacing_m,
            white_sigma0_db: 3.0,
            speckle,
        }
    }

    /// Rows by ascending y: 0 0.5 0 / 1 0 0.
    fn six() -> Picture {
        Picture::new(2, 3, vec![0.0, 0.5, 0.0, 1.0, 0.0, 0.0]).unwrap()
    }

    #[test]
    fn brightness_becomes_amplitude_at_pixel_position() {
        // Pixels are 20 m x 20 m: one point each.
        let points = six().points(&placement(20.0, false), 0, 0).unwrap();
        let white = (10f64.powf(0.3) * 400.0).sqrt();
        let [grey, bright] = points[..] else {
            panic!("{points:?}");
        };
        assert_eq!(grey.position_m, DVec3::new(10.0, 10.0, 1.5));
        assert_eq!(bright.position_m, DVec3::new(-10.0, 30.0, 1.5));
        assert!((grey.amplitude - white / 2.0).norm() < 1e-12);
        assert!((bright.amplitude - white).norm() < 1e-12);
    }

    #[test]
    fn total_cross_section_is_kept_at_any_spacing() {
        // 400 m² of white, and 400 m² at a quarter of its power.
        let expected = 10f64.powf(0.3) * 500.0;
        for spacing_m in [0.5, 1.7, 20.0, 27.0, 60.0] {
            let points = six().points(&placement(spacing_m, false), 0, 0).unwrap();
            let sum: f64 = points.iter().map(|p| p.amplitude.norm_sqr()).sum();
            assert!((sum / expected - 1.0).abs() < 1e-12, "{spacing_m}: {sum}");
        }
    }

    #[test]
    fn speckle_keeps_mean_power_and_depends_on_seed() {
        let points = six().points(&placement(0.2, true), 4, 0).unwrap();
        // 20 000 points of exponential power, half of them a quarter as strong: standard error 1 %; five times this is
        // allowed.
        assert_eq!(points.len(), 20_000);
        let sum: f64 = points.iter().map(|p| p.amplitude.norm_sqr()).sum();
        assert!((sum / (10f64.powf(0.3) * 500.0) - 1.0).abs() < 0.05);
        let mean: Complex64 = points.iter().map(|p| p.amplitude).sum();
        // A random walk has length sqrt(sum); four times this is allowed.
        assert!(mean.norm() < 4.0 * sum.sqrt());
        assert_ne!(points, six().points(&placement(0.2, true), 5, 0).unwrap());
    }

    fn png_file(
        columns: u32,
        depth: png::BitDepth,
        colour: png::ColorType,
        data: &[u8],
    ) -> Vec<u8> {
        let mut out = Vec::new();
        let mut encoder = png::Encoder::new(&mut out, columns, 2);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(data).unwrap();
        writer.finish().unwrap();
        out
    }

    fn read(name: &str, bytes: &[u8]) -> Result<Picture, SceneError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        Picture::read(&path)
    }

    #[test]
    fn png_with_8_and_16_bits_and_npy_give_same_picture() {
        use png::{BitDepth, ColorType};
        // A PNG starts with the top row: 255 0 0 / 0 51 0.
        let eight = png_file(
            3,
            BitDepth::Eight,
            ColorType::Grayscale,
            &[255, 0, 0, 0, 51, 0],
        );
        let expected = Picture::new(2, 3, vec![0.0, 0.2, 0.0, 1.0, 0.0, 0.0]).unwrap();
        assert_eq!(read("a.png", &eight).unwrap(), expected);
        let wide = [0xff, 0xff, 0, 0, 0, 0, 0, 0, 0x33, 0x33, 0, 0];
        let sixteen = png_file(3, BitDepth::Sixteen, ColorType::Grayscale, &wide);
        assert_eq!(read("a.png", &sixteen).unwrap(), expected);
        let mut array = b"\x93NUMPY\x01\x00\x46\x00".to_vec();
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }";
        array.extend(format!("{header:<69}\n").bytes());
        for value in [0.0f64, 0.2, 0.0, 1.0, 0.0, 0.0] {
            array.extend(value.to_le_bytes());
        }
        assert_eq!(read("a.npy", &array).unwrap(), expected);
        let colour = png_file(1, BitDepth::Eight, ColorType::Rgb, &[1, 2, 3, 4, 5, 6]);
        let error = read("a.png", &colour).unwrap_err().to_string();
        assert!(error.contains("a.png: PNG of Rgb"), "{error}");
    }

    #[test]
    fn invalid_pictures_are_refused() {
        assert!(
            read("a.jpg", &[])
                .unwrap_err()
                .to_string()
                .contains(".png or .npy")
        );
        assert!(read("a.png", b"not").is_err());
        // A header that states a gigabyte.
        let mut claims = png_file(1, png::BitDepth::Eight, png::ColorType::Grayscale, &[1, 2]);
        claims[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
        let crc = crc32fast::hash(&claims[12..29]).to_be_bytes();
        claims[29..33].copy_from_slice(&crc);
        let error = read("a.png", &claims).unwrap_err().to_string();
        assert!(
            error.contains("cannot hold the stated 16384 x 16384 pixels"),
            "{error}"
        );
        assert!(Picture::read(Path::new("nowhere.png")).is_err());
        assert!(Picture::new(2, 3, vec![0.0; 5]).is_err());
        let negative = Picture::new(1, 2, vec![0.0, -1.0]).unwrap_err().to_string();
        assert!(negative.contains("row 0, column 1"), "{negative}");
        let fine = six().points(&placement(1e-3, false), 0, 0).unwrap_err();
        assert!(fine.to_string().contains("wider spacing"));
        assert!(six().points(&placement(0.0, false), 0, 0).is_err());
    }
}
