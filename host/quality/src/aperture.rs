//! Parts of the aperture: what an image would show had only some of its pulses been used, from the image alone.
//!
//! An image's spectrum across the line of sight is its aperture: where the phase of the path from the aperture's middle is taken off each pixel, what a pulse saw that
//! was an angle `a` off that middle has the spatial frequencies `2 a / lambda` across, wherever it lies. A patch of the image (what is asked for and [`MARGIN`] pixels around it) is
//! transformed, the frequencies between two bounds are kept, and it is transformed back. A point that is seen evenly keeps its level.
//!
//! A part is two fractions of the aperture: 0 where the antenna begins and 1 where it ends as it goes clockwise about the scene, seen from the side of the grid's normal; of a
//! radar that looks ahead, from its right to its left. Which was first in time the image does not tell.
//!
//! **Neglected.** The direction across is that of the patch's middle: `d` metres off it, it is turned by `d / R`, and a part of the band's width of frequencies in range by as much
//! taken for frequencies across. Frequencies across grow with the carrier: at the band's edges bounds are off by half the relative bandwidth of their distance from the
//! middle. Edges are sharp, so that points have side lobes of -13 dB, and those that reach farther than the margin wrap around. Of an image of another program the
//! aperture lies along columns, as SICD has it, and its middle is where the patch's energy is.
//!
//! Memory: 8 bytes a pixel of the patch, as much again where several parts are asked for at once, and the parts. Cost: a transform of the patch, and another for each part.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};
use subaperture_fft::{FftDirection, Real, Transforms};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Image, Parts, PartsError, Place};

use crate::response::{Carrier, Geometry};

/// Pixels around what is asked for that are transformed with it.
pub const MARGIN: usize = 64;

/// Rows and columns of the places of an [`ApertureParts`]: with the margin 640, of which transforms are fast.
const SIDE: usize = 512;

/// By which frequencies of an image parts of its aperture are told.
#[derive(Clone, Debug)]
pub struct Aperture {
    way: Way,
    /// Weights along it, evenly spaced; empty where they are alike or not known.
    weights: Vec<f64>,
}

#[derive(Clone, Debug)]
enum Way {
    /// Across the line of sight.
    Seen {
        carrier: Carrier,
        /// Of the whole aperture, cycles a metre.
        width: f64,
    },
    /// Along columns: of the whole aperture, cycles a pixel.
    Columns { width: f64 },
}

/// Which way and how far the aperture's frequencies reach.
struct Band {
    /// Of its middle, cycles a row and a column.
    centre: [f64; 2],
    /// What a cycle a row and a cycle a column come to, in apertures.
    across: [f64; 2],
}

impl Aperture {
    /// That of an image on a Cartesian grid, by the geometry of its record; `None` where the grid is polar or an aperture of 90 degrees or more is no line of frequencies.
    pub fn seen(seen: &Geometry, grid: &ImageGrid) -> Option<Self> {
        let angle = seen.aperture_angle_deg.to_radians();
        let sound = angle > 0.0 && angle < std::f64::consts::FRAC_PI_2 && seen.wavelength_m > 0.0;
        (sound && !grid.polar).then(|| Self {
            way: Way::Seen {
                carrier: Carrier::of(seen),
                width: 4.0 * libm::sin(angle / 2.0) / seen.wavelength_m,
            },
            weights: Vec::new(),
        })
    }

    /// That of an image whose aperture lies along columns and fills so many cycles a pixel.
    pub fn columns(width: f64) -> Option<Self> {
        (width > 0.0 && width <= 1.0).then_some(Self {
            way: Way::Columns { width },
            weights: Vec::new(),
        })
    }

    /// Of pulses that were weighted so, evenly from one end to the other: parts are made as bright as they would be had all weighed alike.
    pub fn weighted(mut self, weights: Vec<f64>) -> Self {
        self.weights = weights;
        self
    }

    /// What a part of a point that is seen evenly has in amplitude, of the whole.
    fn share(&self, [from, to]: [f64; 2]) -> f64 {
        let count = self.weights.len() as f64;
        let total: f64 = self.weights.iter().sum();
        // Each weight is of as much of the aperture, the first and last of those cut in part.
        let parts = self.weights.iter().enumerate().map(|(i, weight)| {
            let (first, last) = (i as f64 / count, (i + 1) as f64 / count);
            weight * (to.min(last) - from.max(first)).max(0.0) * count
        });
        let share = parts.sum::<f64>() / total;
        // Where nothing is known, or next to nothing was weighed, it is what the part is of the aperture.
        match share > 1e-3 * (to - from) {
            true => share,
            false => to - from,
        }
    }

    /// The aperture of a patch, from which the phase of its middle's paths is taken off where they are known.
    fn band(&self, grid: &ImageGrid, place: &Place, patch: &mut Image) -> Option<Band> {
        match &self.way {
            Way::Seen { carrier, width } => {
                let middle = |i: usize| (place[i].start + place[i].end) as f64 / 2.0;
                let row_value = grid.rows.start + middle(0) * grid.rows.step;
                let column_value = grid.columns.start + middle(1) * grid.columns.step;
                // Where turns from pixel to pixel are not known, nor is the middle.
                carrier.turn(grid, row_value, column_value)?;
                let sight = carrier.antenna_m - grid.point_m(row_value, column_value);
                let (x, y) = (sight.dot(grid.x_axis), sight.dot(grid.y_axis));
                let flat = libm::hypot(x, y);
                // Seen from above there is no direction across.
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
            Way::Columns { width } => Some(Band {
                centre: [0.0, middle_frequency(patch)],
                across: [0.0, 1.0 / width],
            }),
        }
    }
}

/// Takes the phase of the path from the middle of the aperture, there and back, off each pixel.
fn take_off(carrier: &Carrier, grid: &ImageGrid, [rows, columns]: &Place, patch: &mut Image) {
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

/// Cycles a column at which a patch's energy lies: the mean turn from pixel to pixel.
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

/// A place of an image as each of some parts of its aperture shows it; `None` where the aperture is not known.
///
/// # Errors
/// If the image cannot be read.
pub fn parts_of(
    image: &dyn Parts,
    grid: &ImageGrid,
    aperture: &Aperture,
    place: &Place,
    parts: &[[f64; 2]],
) -> Result<Option<Vec<Image>>, PartsError> {
    let (rows, columns) = image.size();
    let size = [rows, columns];
    let around: Place =
        [0, 1].map(|i| place[i].start.saturating_sub(MARGIN)..(place[i].end + MARGIN).min(size[i]));
    let mut patch = image.window(&around)?;
    patch.pixels.iter_mut().for_each(make_finite);
    let Some(band) = aperture.band(grid, &around, &mut patch) else {
        return Ok(None);
    };
    transform(&mut patch, FftDirection::Forward);
    let inner: Place =
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
    // The last takes the spectrum itself.
    shown.push(show(patch, last)?);
    Ok(Some(shown))
}

/// One pixel that is no number would make all of a patch so.
fn make_finite(z: &mut Complex32) {
    if !z.is_finite() {
        *z = Complex32::ZERO;
    }
}

/// An image as a part of its aperture shows it, read part by part. Phases are those about the path to the middle of the aperture, where that is known.
#[derive(Debug)]
pub struct AperturePart<'a> {
    image: &'a dyn Parts,
    grid: &'a ImageGrid,
    aperture: &'a Aperture,
    part: [f64; 2],
}

impl<'a> AperturePart<'a> {
    /// The part of an image on a grid between two fractions of its aperture.
    pub fn new(
        image: &'a dyn Parts,
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

impl Parts for AperturePart<'_> {
    fn size(&self) -> (usize, usize) {
        self.image.size()
    }

    fn places(&self) -> Vec<Place> {
        let (rows, columns) = self.size();
        let range = |first: usize, count: usize| first..(first + SIDE).min(count);
        let places = (0..rows).step_by(SIDE).flat_map(|row| {
            let across = (0..columns).step_by(SIDE);
            across.map(move |column| [range(row, rows), range(column, columns)])
        });
        places.collect()
    }

    fn window(&self, place: &Place) -> Result<Image, PartsError> {
        let found = parts_of(self.image, self.grid, self.aperture, place, &[self.part])?;
        let one = found.and_then(|mut found| found.pop());
        one.ok_or_else(|| NOT_KNOWN.into())
    }
}

/// Why there are no parts.
const NOT_KNOWN: &str = "which frequencies of the image are which part of the aperture is not known: it was seen from above, or its pixels are too coarse";

/// Keeps the frequencies of a part of the aperture of a patch's spectrum, fractions from 0 to 1 of it.
fn keep(patch: &mut Image, band: &Band, part: [f64; 2], share: f64) {
    let size = [patch.rows, patch.columns];
    let count = (size[0] * size[1]) as f32;
    let gain = 1.0 / (count * share.max(1e-3) as f32);
    // Bins of cycles a row and a column from the middle of the aperture, within half a cycle of it.
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

/// Both axes, in place, without a factor.
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

    /// A radar 10 km along -y of the scene and 3 km above it, of 3 cm, over 2 degrees.
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

    /// An image of two points, each the sum over pulses and frequencies that defines it: one seen in the first half of the aperture alone (towards -x of the middle), one
    /// in the second. Distances exact.
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

    /// Each half of the aperture shows its own point at the level of the whole and the other 20 dB down: what is left of it is what edges of the band and of the pulses'
    /// steps of 1/32 take from one half to the other, less than one pulse of 16 (-24 dB).
    #[test]
    fn each_half_of_the_aperture_shows_what_it_saw() {
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
        // The whole aperture, and a little more for its edges: nothing is lost.
        assert!((level([-0.2, 1.2], first) + 20.0 * 1.4f64.log10()).abs() < 0.3);
        let halves = [[0.0, 0.5], [0.5, 1.0]].map(|part| [level(part, first), level(part, second)]);
        let own = halves[0][0].max(halves[1][0]);
        // A point of which one half has all keeps what it had, over half the aperture: 6 dB more.
        assert!((own - 6.0).abs() < 0.7, "{halves:?}");
        for half in halves {
            assert!((half[0] - half[1]).abs() > 20.0, "{halves:?}");
        }
        // Pulses of the first half are from where x is less than the middle's, the radar's left: the last half of the aperture.
        assert!(
            halves[0][0] < halves[0][1] && halves[1][0] > halves[1][1],
            "{halves:?}"
        );
    }

    /// Of columns: waves of 0.02 and 0.12 cycles a pixel about a middle of 0.07, of which a half each is kept.
    #[test]
    fn parts_of_columns_are_parts_of_their_frequencies() {
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
            // One wave of two, doubled, evenly: 4, to the rounding of float32 transforms.
            for z in seen.window(&[0..8, 0..200]).unwrap().pixels {
                assert!((z.norm_sqr() - 4.0).abs() < 1e-3, "{z}");
            }
        }
        assert!(Aperture::columns(1.5).is_none());
        // Weights 1, 3, 3, 1: a quarter of the outer ones is an eighth of all, the middle half three quarters.
        let tapered = aperture.clone().weighted(vec![1.0, 3.0, 3.0, 1.0]);
        for (part, share) in [
            ([0.0, 0.25], 0.125),
            ([0.25, 0.75], 0.75),
            ([0.0, 0.125], 0.0625),
        ] {
            assert!((tapered.share(part) - share).abs() < 1e-12, "{part:?}");
        }
        assert_eq!(aperture.share([0.25, 0.5]), 0.25);
        // Several at once are the same as each alone, and places cover the image once.
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
        let covered: usize = places.iter().map(|[r, c]| r.len() * c.len()).sum();
        assert_eq!((places.len(), covered), (6, 513 * 1030));
    }
}
