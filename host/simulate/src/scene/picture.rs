//! A picture as a scene: brightness becomes reflectivity.
//!
//! A pixel of brightness `b` (white is 1) has `sigma0 = white sigma0 b^2`: amplitude is proportional to
//! brightness, as in a radar image shown in amplitude. The picture is stretched over an extent of the
//! plane and cut into cells of the spacing; a point in the middle of each cell has the cell's mean
//! cross section,
//!
//! ```text
//! E |a|^2 = integral over the cell of sigma0 dA,
//! ```
//!
//! so the whole has the cross section of the picture at any spacing. Cells of nothing but black have no
//! point. With speckle amplitudes are complex Gaussian, as of rough ground. Without, they
//! are real and positive: give a spacing not finer than the resolution, as neighbours in one cell add up
//! with the phases of their paths, and a smooth plane reflects elsewhere.
//!
//! Read are grey PNG files of 8 or 16 bits (the top row has the largest y; 16 bits keep 96 dB) and real
//! NumPy arrays of two dimensions (row 0 has the smallest y, as in the project's images; values are
//! brightness, not negative). Gamma is not undone: values count as they stand.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use glam::DVec3;
use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::SceneError;
use super::clutter::{MOST_POINTS, check_points};
use crate::Scatterer;
use crate::random::complex_normal;
use subaperture_io::npy;
use subaperture_model::geometry::Extent;
use subaperture_model::units::power_of_db;

/// Stream of random numbers.
const PICTURE: u64 = u64::from_be_bytes(*b"picture\0");

/// Most pixels of a PNG file.
const MOST_PIXELS: u64 = 1 << 28;

/// Deflate, which PNG packs by, makes 258 bytes of 2 bits at the most.
const MOST_UNPACKING: u64 = 1032;

/// Largest array of brightnesses that is read, bytes: as many values as points are possible.
const MOST_BYTES: u64 = 8 << 26;

/// Brightness on a rectangle, rows with y ascending.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    rows: usize,
    columns: usize,
    brightness: Vec<f32>,
}

/// How a picture lies in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// The rectangle it fills.
    pub extent: Extent,
    /// Its height, metres.
    pub height_m: f64,
    /// Distance from point to point, metres; rounded so that it divides the extent.
    pub spacing_m: f64,
    /// Cross section of a square metre of white, dB.
    pub white_sigma0_db: f64,
    /// Whether amplitudes are complex Gaussian.
    pub speckle: bool,
}

impl Picture {
    /// From brightness, `rows * columns` finite values of at least 0, row 0 with the smallest y.
    ///
    /// # Errors
    /// [`SceneError`] if it is none.
    pub fn new(rows: usize, columns: usize, brightness: Vec<f32>) -> Result<Self, SceneError> {
        if rows == 0 || columns == 0 || rows.checked_mul(columns) != Some(brightness.len()) {
            return Err(SceneError(format!(
                "a picture of {rows} x {columns} with {} values",
                brightness.len()
            )));
        }
        if let Some(n) = brightness
            .iter()
            .position(|b| !(*b >= 0.0 && b.is_finite()))
        {
            return Err(SceneError(format!(
                "a picture with {} in row {}, column {}; brightness has to be finite and not negative",
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

    /// Reads a `.png` or `.npy` file.
    ///
    /// # Errors
    /// [`SceneError`] if it cannot be read or is of another kind.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let about =
            |what: &dyn std::fmt::Display| SceneError(format!("{}: {what}", path.display()));
        match path.extension().and_then(|e| e.to_str()) {
            Some("npy") => {
                let array = npy::Array::read(path, None, MOST_BYTES)
                    .map_err(|e| SceneError(e.to_string()))?;
                let (Some(values), &[rows, columns]) = (array.real(), array.shape.as_slice())
                else {
                    return Err(about(&"not a picture; real numbers of two dimensions are"));
                };
                let brightness = values.iter().map(|&v| v as f32).collect();
                Self::new(rows, columns, brightness).map_err(|e| about(&e.0))
            }
            Some("png") => read_png(path).map_err(|what| about(&what)),
            _ => Err(about(&"not a picture; .png and .npy are read")),
        }
    }

    /// Its points; the same seed gives the same ones. Pictures of one seed and different `index` differ.
    ///
    /// # Errors
    /// [`SceneError`] for an extent that is empty, or more than 67 million points.
    pub fn points(
        &self,
        placement: &Placement,
        seed: u64,
        index: u32,
    ) -> Result<Vec<Scatterer>, SceneError> {
        self.points_within(placement, seed, index, MOST_POINTS)
    }

    /// [`Self::points`], at most so many of them.
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
                "a picture of {width} x {depth} m with points {} m apart at height {} m, white {} dB; give \
                 positive lengths and finite values",
                placement.spacing_m, placement.height_m, placement.white_sigma0_db
            )));
        }
        let cells = |length: f64| (length / placement.spacing_m).round().max(1.0);
        let (across, along) = (cells(width), cells(depth));
        if across * along > MOST_POINTS {
            return Err(SceneError(format!(
                "a picture of {across} x {along} points; {MOST_POINTS} are possible: give a wider spacing"
            )));
        }
        check_points("a picture", across * along, most)?;
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

    /// Mean of `b^2` over a rectangle of the picture, in pixels; pixels count with the part of them inside.
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

fn read_png(path: &Path) -> Result<Picture, String> {
    let file = File::open(path).map_err(|e| e.to_string())?;
    let mut reader = png::Decoder::new(BufReader::new(file))
        .read_info()
        .map_err(|e| e.to_string())?;
    let info = reader.info();
    let (rows, columns) = (info.height as usize, info.width as usize);
    if u64::from(info.height) * u64::from(info.width) > MOST_PIXELS {
        return Err(format!(
            "{rows} x {columns} pixels; {MOST_PIXELS} are possible"
        ));
    }
    let bytes = match (info.color_type, info.bit_depth) {
        (png::ColorType::Grayscale, png::BitDepth::Eight) => 1,
        (png::ColorType::Grayscale, png::BitDepth::Sixteen) => 2,
        (colour, depth) => {
            return Err(format!(
                "a PNG of {colour:?}, {depth:?} bits; save it in grey of 8 or 16 bits without transparency"
            ));
        }
    };
    // Checked before memory is taken: a file may say anything.
    let packed = path.metadata().map_err(|e| e.to_string())?.len();
    let size = rows as u64 * columns as u64 * bytes as u64;
    if size > packed.saturating_mul(MOST_UNPACKING) {
        return Err(format!(
            "a PNG of {packed} bytes cannot hold the {rows} x {columns} pixels that it says: it is damaged"
        ));
    }
    let mut data = vec![0; rows * columns * bytes];
    let frame = reader.next_frame(&mut data).map_err(|e| e.to_string())?;
    if frame.line_size != columns * bytes {
        return Err("a PNG whose rows are not as long as it says".to_owned());
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
    Picture::new(rows, columns, brightness).map_err(|e| e.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 60 m x 40 m.
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

    /// Rows of y ascending: 0 0.5 0 / 1 0 0.
    fn six() -> Picture {
        Picture::new(2, 3, vec![0.0, 0.5, 0.0, 1.0, 0.0, 0.0]).unwrap()
    }

    #[test]
    fn brightness_is_amplitude_and_lies_where_the_picture_has_it() {
        // Pixels are 20 m x 20 m: a point each.
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
    fn the_whole_cross_section_is_kept_at_any_spacing() {
        // 400 m² of white and 400 m² of a quarter.
        let expected = 10f64.powf(0.3) * 500.0;
        for spacing_m in [0.5, 1.7, 20.0, 27.0, 60.0] {
            let points = six().points(&placement(spacing_m, false), 0, 0).unwrap();
            let sum: f64 = points.iter().map(|p| p.amplitude.norm_sqr()).sum();
            assert!((sum / expected - 1.0).abs() < 1e-12, "{spacing_m}: {sum}");
        }
    }

    #[test]
    fn speckle_keeps_the_mean_and_has_seeds() {
        let points = six().points(&placement(0.2, true), 4, 0).unwrap();
        // 20 000 points of exponential power, half of them a quarter as strong: 1 % standard error; five.
        assert_eq!(points.len(), 20_000);
        let sum: f64 = points.iter().map(|p| p.amplitude.norm_sqr()).sum();
        assert!((sum / (10f64.powf(0.3) * 500.0) - 1.0).abs() < 0.05);
        let mean: Complex64 = points.iter().map(|p| p.amplitude).sum();
        // A random walk: sqrt(sum) long, four of them.
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
    fn png_of_8_and_16_bits_and_real_arrays_give_the_same_picture() {
        use png::{BitDepth, ColorType};
        // The top row comes first in a PNG: 255 0 0 / 0 51 0.
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
        assert!(error.contains("a.png: a PNG of Rgb"), "{error}");
    }

    #[test]
    fn what_is_no_picture_is_refused() {
        assert!(
            read("a.jpg", &[])
                .unwrap_err()
                .to_string()
                .contains(".png and .npy")
        );
        assert!(read("a.png", b"not").is_err());
        // A header that asks for a gigabyte.
        let mut claims = png_file(1, png::BitDepth::Eight, png::ColorType::Grayscale, &[1, 2]);
        claims[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
        let crc = crc32fast::hash(&claims[12..29]).to_be_bytes();
        claims[29..33].copy_from_slice(&crc);
        let error = read("a.png", &claims).unwrap_err().to_string();
        assert!(
            error.contains("cannot hold the 16384 x 16384 pixels"),
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
