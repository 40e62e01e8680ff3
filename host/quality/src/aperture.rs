//! Sub-aperture images, computed from an image alone by filtering its cross-range spectrum.
//!
//! The cross-range spectrum of an image is its aperture. After multiplication of each pixel by the conjugate phase of its path from the aperture's centre, the
//! contribution of a pulse at angle `a` off the centre has the cross-range spatial frequency `2 a / lambda` everywhere in the image. A patch (the window requested
//! and [`MARGIN`] pixels around it) is Fourier transformed, filtered to the frequencies between two bounds, and transformed back. A point that reflects evenly over
//! the aperture keeps its level.
//!
//! A sub-aperture is a range of fractions of the aperture, 0 to 1, clockwise about the scene seen from the side of the grid's normal; for a forward-looking
//! radar, from right to left. The image does not contain the time order.
//!
//! **Neglected.** The cross-range direction is that of the patch centre: at distance `d` it is rotated by `d / R`, which mixes that fraction of the range
//! bandwidth into cross-range. Cross-range frequencies scale with the carrier: at the band edges, the bounds are off by half the relative bandwidth times their
//! distance from the centre. The filter has sharp edges: points have sidelobes of -13 dB, and sidelobes longer than the margin wrap around. In an image from other
//! software the aperture lies along columns, as in SICD, centred at the patch's mean frequency.
//!
//! **Memory** 8 bytes per pixel of the patch, as much again for several sub-apertures at once, and the result. **Cost** one transform of the patch, and one per sub-aperture.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};
use subaperture_fft::{FftDirection, Real, Transforms};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, Tiling,
};

use crate::response::{Carrier, Geometry};

/// Margin around the requested window, pixels.
pub const MARGIN: usize = 64;

/// Rows and columns of a window of [`ApertureParts`]. With the margin 640, an efficient transform length.
const SIDE: usize = 512;

/// Mapping from an image's spatial frequencies to its aperture.
#[derive(Clone, Debug)]
pub struct Aperture {
    mapping: Mapping,
    /// Weights along the aperture, evenly spaced; empty if uniform or unknown.
    weights: Vec<f64>,
}

#[derive(Clone, Debug)]
enum Mapping {
    /// Along cross-range.
    Seen {
        carrier: Carrier,
        /// Bandwidth of the whole aperture, cycles per metre.
        width: f64,
    },
    /// Along columns: bandwidth of the whole aperture, cycles per pixel.
    Columns { width: f64 },
}

/// Centre and scale of the aperture's frequencies in a patch.
struct Band {
    /// Centre frequency, cycles per row and per column.
    centre: [f64; 2],
    /// Fraction of the aperture per cycle per row and per cycle per column.
    across: [f64; 2],
}

impl Aperture {
    /// Aperture of an image on a Cartesian grid, from the geometry of its record. `None` for a polar grid, or an aperture of 90 degrees or more, whose spectrum is no line.
    pub fn seen(seen: &Geometry, grid: &ImageGrid) -> Option<Self> {
        let angle = seen.aperture_angle_deg.to_radians();
        let sound = angle > 0.0 && angle < std::f64::consts::FRAC_PI_2 && seen.wavelength_m > 0.0;
        (sound && !grid.polar).then(|| Self {
            mapping: Mapping::Seen {
                carrier: Carrier::of(seen),
                width: 4.0 * libm::sin(angle / 2.0) / seen.wavelength_m,
            },
            weights: Vec::new(),
        })
    }

    /// Aperture along columns with a bandwidth of `width` cycles per pixel. `None` if `width` is not valid.
    pub fn columns(width: f64) -> Option<Self> {
        (width > 0.0 && width <= 1.0).then_some(Self {
            mapping: Mapping::Columns { width },
            weights: Vec::new(),
        })
    }

    /// Set the slow-time weights of the pulses, evenly spaced over the aperture. Sub-apertures are scaled to the level that uniform weights would give.
    pub fn weighted(mut self, weights: Vec<f64>) -> Self {
        self.weights = weights;
        self
    }

    /// Amplitude of an evenly reflecting point in a sub-aperture, relative to the whole.
    fn share(&self, [from, to]: [f64; 2]) -> f64 {
        let count = self.weights.len() as f64;
        let total: f64 = self.weights.iter().sum();
        // Each weight covers an equal fraction; the first and last may be cut.
        let parts = self.weights.iter().enumerate().map(|(i, weight)| {
            let (first, last) = (i as f64 / count, (i + 1) as f64 / count);
            weight * (to.min(last) - from.max(first)).max(0.0) * count
        });
        let share = parts.sum::<f64>() / total;
        // Without weights, or where they nearly vanish: the fraction of the aperture.
        match share > 1e-3 * (to - from) {
            true => share,
            false => to - from,
        }
    }

    /// Frequencies of the aperture in a patch; removes the path phase to the aperture's centre where it is known.
    fn band(&self, grid: &ImageGrid, place: &PixelBlock, patch: &mut Image) -> Option<Band> {
        match &self.mapping {
            Mapping::Seen { carrier, width } => {
                let middle = |i: usize| (place[i].start + place[i].end) as f64 / 2.0;
                let row_value = grid.rows.start + middle(0) * grid.rows.step;
                let column_value = grid.columns.start + middle(1) * grid.columns.step;
                // Without the phase gradient per pixel, the centre is unknown too.
                carrier.turn(grid, row_value, column_value)?;
                let sight = carrier.antenna_m - grid.point_m(row_value, column_value);
                let (x, y) = (sight.dot(grid.x_axis), sight.dot(grid.y_axis));
                let flat = libm::hypot(x, y);
                // No cross-range direction for a vertical line of sight.
                if flat < 1e-3 * sight.length() {
                    return None;
                }
                take_off(carrier, grid, place, patch);
                Some(Band {
                    centre: [0.0; 2],
                    across: [
                        x / flat / grid.rows.step / width,
                        -y / flat / grid.columns.step / width,
                    ],
                })
            }
            Mapping::Columns { width } => Some(Band {
                centre: [0.0, middle_frequency(patch)],
                across: [0.0, 1.0 / width],
            }),
        }
    }
}

/// Multiply each pixel by the conjugate two-way path phase from the aperture's centre.
fn take_off(carrier: &Carrier, grid: &ImageGrid, [rows, columns]: &PixelBlock, patch: &mut Image) {
    let lines = patch.pixels.chunks_exact_mut(columns.len().max(1));
    for (row, line) in rows.clone().zip(lines) {
        for (column, z) in columns.clone().zip(line) {
            let range_m = grid.position_m(row, column).distance(carrier.antenna_m);
            let turns = 2.0 * range_m / carrier.wavelength_m;
            let (sin, cos) = libm::sincosf((TAU * (turns - turns.round())) as f32);
            *z *= Complex32::new(cos, -sin);
        }
    }
}

/// Mean frequency of a patch along columns, cycles per pixel: circular mean of the phase step.
fn middle_frequency(patch: &Image) -> f64 {
    let mut sum = Complex64::ZERO;
    for line in patch.pixels.chunks_exact(patch.columns) {
        for pair in line.windows(2) {
            let product = pair[1] * pair[0].conj();
            sum += Complex64::new(product.re.into(), product.im.into());
        }
    }
    sum.arg() / TAU
}

/// Window of an image in each of several sub-apertures; `None` where the aperture is unknown.
///
/// # Errors
/// [`ImageSourceError`] if the image cannot be read.
pub fn parts_of(
    image: &dyn ImageSource,
    grid: &ImageGrid,
    aperture: &Aperture,
    place: &PixelBlock,
    parts: &[[f64; 2]],
) -> Result<Option<Vec<Image>>, ImageSourceError> {
    let (rows, columns) = image.size();
    let size = [rows, columns];
    let around: PixelBlock =
        [0, 1].map(|i| place[i].start.saturating_sub(MARGIN)..(place[i].end + MARGIN).min(size[i]));
    let mut patch = image.window(&around)?;
    patch.pixels.iter_mut().for_each(make_finite);
    let Some(band) = aperture.band(grid, &around, &mut patch) else {
        return Ok(None);
    };
    transform(&mut patch, FftDirection::Forward);
    let inner: PixelBlock =
        [0, 1].map(|i| place[i].start - around[i].start..place[i].end - around[i].start);
    let show = |mut kept: Image, part: &[f64; 2]| {
        keep(&mut kept, &band, *part, aperture.share(*part));
        transform(&mut kept, FftDirection::Inverse);
        kept.window(&inner)
    };
    let Some((last, others)) = parts.split_last() else {
        return Ok(Some(Vec::new()));
    };
    let mut shown = Vec::with_capacity(parts.len());
    for part in others {
        shown.push(show(patch.clone(), part)?);
    }
    // The last reuses the spectrum's memory.
    shown.push(show(patch, last)?);
    Ok(Some(shown))
}

/// Replace a non-finite pixel by 0, since it would affect the whole patch.
fn make_finite(z: &mut Complex32) {
    if !z.is_finite() {
        *z = Complex32::ZERO;
    }
}

/// Sub-aperture image, computed window by window. Where the path is known, phases are relative to the path to the aperture's centre.
#[derive(Debug)]
pub struct AperturePart<'a> {
    image: &'a dyn ImageSource,
    grid: &'a ImageGrid,
    aperture: &'a Aperture,
    part: [f64; 2],
}

impl<'a> AperturePart<'a> {
    /// Sub-aperture between two fractions of the aperture, for an image on a grid.
    pub fn new(
        image: &'a dyn ImageSource,
        grid: &'a ImageGrid,
        aperture: &'a Aperture,
        part: [f64; 2],
    ) -> Self {
        Self {
            image,
            grid,
            aperture,
            part,
        }
    }
}

impl ImageSource for AperturePart<'_> {
    fn size(&self) -> (usize, usize) {
        self.image.size()
    }

    fn places(&self) -> PixelBlocks {
        let (rows, columns) = self.size();
        let image = [rows, columns];
        PixelBlocks::of_size(Tiling { image, tile: image }, [SIDE; 2])
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        let found = parts_of(self.image, self.grid, self.aperture, place, &[self.part])?;
        let one = found.and_then(|mut found| found.pop());
        one.ok_or_else(|| NOT_KNOWN.into())
    }
}

/// Error text of an unknown aperture.
const NOT_KNOWN: &str = "the mapping of image frequencies to the aperture is unknown: the line of sight is vertical, or the pixels are too coarse";

/// Filter a patch's spectrum to a sub-aperture (fractions from 0 to 1).
fn keep(patch: &mut Image, band: &Band, part: [f64; 2], share: f64) {
    let size = [patch.rows, patch.columns];
    let count = (size[0] * size[1]) as f32;
    let gain = 1.0 / (count * share.max(1e-3) as f32);
    // Frequency from the aperture's centre, cycles per row and per column, within half a cycle.
    let from_middle = |i: usize, k: usize| {
        let cycles = k as f64 / size[i] as f64 - band.centre[i];
        (cycles - cycles.round()) * band.across[i]
    };
    let across: Vec<f64> = (0..size[1]).map(|k| from_middle(1, k)).collect();
    for (k, line) in patch.pixels.chunks_exact_mut(size[1]).enumerate() {
        let down = from_middle(0, k);
        for (z, across) in line.iter_mut().zip(&across) {
            let at = down + across + 0.5;
            *z = match part[0] <= at && at < part[1] {
                true => *z * gain,
                false => Complex32::ZERO,
            };
        }
    }
}

/// Transform both axes in place, without normalisation.
fn transform(patch: &mut Image, direction: FftDirection) {
    let (rows, columns) = (patch.rows, patch.columns);
    f32::plan(Transforms::Fastest, columns, direction).process(&mut patch.pixels);
    let down = f32::plan(Transforms::Fastest, rows, direction);
    let mut scratch = vec![Complex32::ZERO; down.get_inplace_scratch_len()];
    let mut column = vec![Complex32::ZERO; rows];
    for first in 0..columns {
        let from = patch.pixels[first..].iter().step_by(columns);
        column.iter_mut().zip(from).for_each(|(to, z)| *to = *z);
        down.process_with_scratch(&mut column, &mut scratch);
        let to = patch.pixels[first..].iter_mut().step_by(columns);
        to.zip(&column).for_each(|(to, z)| *to = *z);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radar at y = -10 km and 3 km height, wavelength 3 cm, aperture 2 degrees.
    fn seen() -> Geometry {
        Geometry {
            scene_centre_m: [0.0; 3],
            slant_range_m: 1e4,
            grazing_angle_deg: 17.0,
            azimuth_deg: -90.0,
            aperture_angle_deg: 2.0,
            bistatic_angle_deg: 0.0,
            wavelength_m: 0.03,
        }
    }

    /// Defining sum of two points, exact distances: one seen in the first half of the aperture only (towards -x of the centre), one
    /// in the second.
    fn image(grid: &ImageGrid) -> Image {
        let points = [([-8.0, 0.0], 0..16), ([8.0, 3.0], 16..32)];
        let (up, across) = (17f64.to_radians().sin(), 17f64.to_radians().cos());
        let mut pixels = Vec::new();
        for row in 0..grid.rows.count {
            for column in 0..grid.columns.count {
                let p = grid.position_m(row, column);
                let mut sum = num_complex::Complex64::ZERO;
                for (q, pulses) in &points {
                    for pulse in pulses.clone() {
                        let angle = (f64::from(pulse) - 15.5) / 32.0 * 2f64.to_radians();
                        let antenna = glam::DVec3::new(
                            1e4 * across * angle.tan() / across,
                            -1e4 * across,
                            1e4 * up,
                        );
                        let q = glam::DVec3::new(q[0], q[1], 0.0);
                        let path = 2.0 * (antenna.distance(p) - antenna.distance(q));
                        for frequency in 0..8 {
                            let wave_number =
                                (1.0 + (f64::from(frequency) - 3.5) / 8.0 * 0.015) / 0.03;
                            sum += num_complex::Complex64::cis(TAU * wave_number * path);
                        }
                    }
                }
                pixels.push(Complex32::new(sum.re as f32 / 128.0, sum.im as f32 / 128.0));
            }
        }
        Image {
            rows: grid.rows.count,
            columns: grid.columns.count,
            pixels,
        }
    }

    /// Each half of the aperture shows its own point at the level of the whole, the other 20 dB lower: leakage from the band edges and the pulse
    /// steps of 1/32 is less than one pulse of 16 (-24 dB).
    #[test]
    fn each_half_aperture_shows_its_own_point() {
        // Cells of 0.43 m across and 1 m along the ground.
        let grid: ImageGrid = "x=-24:24:0.2,y=-12:12:0.25,z=0".parse().unwrap();
        let pixels = image(&grid);
        let aperture = Aperture::seen(&seen(), &grid).unwrap();
        let at = |x: f64, y: f64| {
            let column = ((x + 24.0) / 0.2).round() as usize;
            let row = ((y + 12.0) / 0.25).round() as usize;
            (row, column)
        };
        let level = |part: [f64; 2], (row, column): (usize, usize)| {
            let place = [row..row + 1, column..column + 1];
            let found = parts_of(&pixels, &grid, &aperture, &place, &[part]);
            let one = found.unwrap().unwrap()[0].pixels[0];
            20.0 * f64::from(one.norm()).log10()
        };
        let (first, second) = (at(-8.0, 0.0), at(8.0, 3.0));
        let whole = pixels
            .window(&[first.0..first.0 + 1, first.1..first.1 + 1])
            .unwrap();
        assert!((whole.pixels[0].norm() - 1.0).abs() < 0.05);
        // The whole aperture with a margin keeps the image unchanged.
        assert!((level([-0.2, 1.2], first) + 20.0 * 1.4f64.log10()).abs() < 0.3);
        let halves = [[0.0, 0.5], [0.5, 1.0]].map(|part| [level(part, first), level(part, second)]);
        let own = halves[0][0].max(halves[1][0]);
        // A point contained in one half keeps its energy over half the aperture: 6 dB more.
        assert!((own - 6.0).abs() < 0.7, "{halves:?}");
        for half in halves {
            assert!((half[0] - half[1]).abs() > 20.0, "{halves:?}");
        }
        // Pulses of the first half have smaller x than the centre, the radar's left: the last half of the aperture.
        assert!(
            halves[0][0] < halves[0][1] && halves[1][0] > halves[1][1],
            "{halves:?}"
        );
    }

    /// Along columns: waves of 0.02 and 0.12 cycles per pixel about a centre of 0.07; each half keeps one.
    #[test]
    fn column_sub_apertures_split_column_frequencies() {
        let wave = |c: usize, f: f64| {
            let (sin, cos) = libm::sincos(TAU * f * c as f64);
            Complex32::new(cos as f32, sin as f32)
        };
        let image = Image {
            rows: 8,
            columns: 200,
            pixels: (0..1600)
                .map(|i| wave(i % 200, 0.02) + wave(i % 200, 0.12))
                .collect(),
        };
        let grid: ImageGrid = "x=0:200:1,y=0:8:1".parse().unwrap();
        let aperture = Aperture::columns(0.2).unwrap();
        for part in [[0.0, 0.5], [0.5, 1.0]] {
            let seen = AperturePart::new(&image, &grid, &aperture, part);
            // One of two waves, doubled: 4, within float32 rounding of the transforms.
            for z in seen.window(&[0..8, 0..200]).unwrap().pixels {
                assert!((z.norm_sqr() - 4.0).abs() < 1e-3, "{z}");
            }
        }
        assert!(Aperture::columns(1.5).is_none());
        // Weights 1, 3, 3, 1: an outer quarter has an eighth of the sum, the middle half three quarters.
        let tapered = aperture.clone().weighted(vec![1.0, 3.0, 3.0, 1.0]);
        for (part, share) in [
            ([0.0, 0.25], 0.125),
            ([0.25, 0.75], 0.75),
            ([0.0, 0.125], 0.0625),
        ] {
            assert!((tapered.share(part) - share).abs() < 1e-12, "{part:?}");
        }
        assert_eq!(aperture.share([0.25, 0.5]), 0.25);
        // Several at once equal each alone; windows cover the image once.
        let parts = [[0.0, 0.3], [0.3, 1.0]];
        let place = [2..7, 20..150];
        let both = parts_of(&image, &grid, &aperture, &place, &parts).unwrap();
        for (part, shown) in parts.iter().zip(both.unwrap()) {
            let alone = AperturePart::new(&image, &grid, &aperture, *part);
            assert_eq!(alone.window(&place).unwrap(), shown);
        }
        let large = Image {
            rows: 513,
            columns: 1030,
            pixels: vec![Complex32::ZERO; 513 * 1030],
        };
        let places = AperturePart::new(&large, &grid, &aperture, [0.0, 1.0]).places();
        let covered: usize = places.clone().map(|[r, c]| r.len() * c.len()).sum();
        assert_eq!((places.count(), covered), (6, 513 * 1030));
    }
}
