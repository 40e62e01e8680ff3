//! Sub-aperture images, computed from an image alone by filtering its cross-range spectrum.
//!
//! A sub-aperture is a range of fractions of the aperture ([`crate::aperture`]). It is a filter that passes the frequencies between two bounds. A point that
//! reflects evenly over the aperture keeps its level. The first and the last sub-aperture have no outer bound.
//!
//! **Filter** The strip of frequencies between two bounds, convolved with a Gaussian of standard deviation `1 / (2 pi sigma)`, `sigma` = [`MARGIN`] / 5 pixels:
//! the impulse response is that of the strip times a Gaussian window, and is below 1e-7 of its peak from [`MARGIN`] pixels on. The cross-range direction is that
//! of nodes every 512 pixels; between nodes, the four filtered images are interpolated. A pixel's value therefore depends on the image alone: windows of any size
//! and position agree to float32 rounding, and windows side by side have no seam. The image is continued periodically over its edges.
//!
//! **Neglected.** At distance `d` from a node the cross-range direction is rotated by `d / R`, which mixes that fraction of the range bandwidth into cross-range.
//! The bounds are smooth over 0.016 cycles per pixel (10 % to 90 %), frequencies above 0.475 cycles per pixel are removed along axes that cross-range has a part of, and
//! within [`MARGIN`] pixels of an edge the opposite edge is visible.
//!
//! **Memory** 16 bytes per pixel of a patch of at most 768 x 768 pixels, and the result. **Cost** per 512 x 512 pixels one transform of the patch, and four per sub-aperture (one
//! along columns).

use std::f64::consts::{SQRT_2, TAU};
use std::ops::Range;

use num_complex::Complex32;
use subaperture_fft::{FftDirection, Real, Transforms};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, Tiling,
};

use crate::aperture::{Aperture, Band};

/// Half-length of the filter's impulse response, pixels.
pub const MARGIN: usize = 128;

/// Standard deviation of the smoothed edges of a filter, cycles per pixel.
const EDGE: f64 = 5.0 / (TAU * MARGIN as f64);

/// Spacing of the nodes of the cross-range direction, pixels. With the margins 768, an efficient transform length.
const SIDE: usize = 512;

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
    let [rows, columns] = [0, 1].map(|i| place[i].len());
    let empty = Image {
        rows,
        columns,
        pixels: vec![Complex32::ZERO; rows * columns],
    };
    let mut shown = vec![empty; parts.len()];
    let cells = |i: usize| place[i].start / SIDE..place[i].end.div_ceil(SIDE);
    for cell_row in cells(0) {
        for cell_column in cells(1) {
            let cell = [cell_row, cell_column];
            let within = [0, 1].map(|i| {
                (cell[i] * SIDE).max(place[i].start)..((cell[i] + 1) * SIDE).min(place[i].end)
            });
            if !add_cell(
                image,
                grid,
                aperture,
                (cell, &within),
                parts,
                (place, &mut shown),
            )? {
                return Ok(None);
            }
        }
    }
    Ok(Some(shown))
}

/// Compute the pixels of a block between nodes in each sub-aperture. Returns `false` if the aperture is unknown there.
fn add_cell(
    image: &dyn ImageSource,
    grid: &ImageGrid,
    aperture: &Aperture,
    (cell, within): ([usize; 2], &PixelBlock),
    parts: &[[f64; 2]],
    (place, shown): (&PixelBlock, &mut [Image]),
) -> Result<bool, ImageSourceError> {
    let nodes = nodes(aperture, cell);
    let mut bands = Vec::with_capacity(nodes.len());
    for node in &nodes {
        match aperture.band(grid, *node) {
            Some(band) => bands.push(band),
            None => return Ok(false),
        }
    }
    let (rows, columns) = image.size();
    let around = [around(&within[0], rows), around(&within[1], columns)];
    let mut spectrum = periodic(image, grid, aperture, &around)?;
    transform(&mut spectrum, FftDirection::Forward);
    // Position of the block in the patch, and in the window.
    let patch = [spectrum.rows, spectrum.columns];
    let first = [0, 1].map(|i| match patch[i] == [rows, columns][i] {
        true => within[i].start,
        false => MARGIN,
    });
    let to = [0, 1].map(|i| within[i].start - place[i].start);
    for (part, image) in parts.iter().zip(shown) {
        for (node, band) in nodes.iter().zip(&bands) {
            let mut kept = spectrum.clone();
            let edge = EDGE * libm::hypot(band.across[0], band.across[1]);
            keep(
                &mut kept,
                band,
                *part,
                (edge, share(aperture.weights(), *part, edge)),
            );
            transform(&mut kept, FftDirection::Inverse);
            for row in 0..within[0].len() {
                let from = &kept.pixels[(first[0] + row) * kept.columns + first[1]..];
                let line = &mut image.pixels[(to[0] + row) * image.columns + to[1]..];
                for (column, (z, kept)) in
                    line.iter_mut().zip(from).take(within[1].len()).enumerate()
                {
                    let pixel = [within[0].start + row, within[1].start + column];
                    *z += match nodes.len() {
                        1 => *kept,
                        _ => kept * weight(*node, pixel),
                    };
                }
            }
        }
    }
    Ok(true)
}

/// Pixels of an axis around some of its pixels, as two ranges (the second may be empty): with margins, continued periodically over the ends; the whole axis if it
/// is shorter than that.
fn around(within: &Range<usize>, count: usize) -> [Range<usize>; 2] {
    if within.len() + 2 * MARGIN >= count {
        return [0..count, 0..0];
    }
    let (start, end) = (within.start, within.end + MARGIN);
    match start.checked_sub(MARGIN) {
        None => [count + start - MARGIN..count, 0..end],
        Some(start) if end > count => [start..count, 0..end - count],
        Some(start) => [start..end, 0..0],
    }
}

/// Patch of an image, assembled of ranges of rows and columns; without the path phase to the aperture's centre where it is known.
fn periodic(
    image: &dyn ImageSource,
    grid: &ImageGrid,
    aperture: &Aperture,
    around: &[[Range<usize>; 2]; 2],
) -> Result<Image, ImageSourceError> {
    let [rows, columns] = [0, 1].map(|i| around[i].iter().map(Range::len).sum());
    let mut pixels = vec![Complex32::ZERO; rows * columns];
    let mut down = 0;
    let some = |i: usize| around[i].iter().filter(|range| !range.is_empty());
    for row_range in some(0) {
        let mut across = 0;
        for column_range in some(1) {
            let place = [row_range.clone(), column_range.clone()];
            let piece = aperture.window(image, grid, &place)?;
            let lines = piece.pixels.chunks_exact(piece.columns);
            for (row, line) in lines.enumerate() {
                pixels[(down + row) * columns + across..][..line.len()].copy_from_slice(line);
            }
            across += column_range.len();
        }
        down += row_range.len();
    }
    Ok(Image {
        rows,
        columns,
        pixels,
    })
}

/// Nodes around a block between nodes. Along columns, the filter is the same everywhere.
fn nodes(aperture: &Aperture, cell: [usize; 2]) -> Vec<[usize; 2]> {
    let first = cell.map(|k| k * SIDE);
    let last = cell.map(|k| (k + 1) * SIDE);
    match aperture.is_uniform() {
        true => vec![first],
        false => vec![first, [first[0], last[1]], [last[0], first[1]], last],
    }
}

/// Amplitude of an evenly reflecting point in a sub-aperture with edges of standard deviation `edge`, relative to the whole.
fn share(weights: &[f64], part: [f64; 2], edge: f64) -> f64 {
    let bounds = bounds(part);
    // Mean of the filter over an interval of the aperture.
    let mean = |from: f64, to: f64| {
        let under =
            |t: f64| step_integral(t - bounds[0], edge) - step_integral(t - bounds[1], edge);
        (under(to) - under(from)) / (to - from)
    };
    let count = weights.len() as f64;
    let total: f64 = weights.iter().sum();
    let ends = |i: usize| (i as f64 / count, (i + 1) as f64 / count);
    let each = weights.iter().enumerate();
    let parts = each.map(|(i, weight)| weight * mean(ends(i).0, ends(i).1));
    let share = parts.sum::<f64>() / total;
    // Without weights, or where they nearly vanish: uniform weights.
    let ends = [part[0].min(0.0), part[1].max(1.0)];
    let uniform = mean(ends[0], ends[1]) * (ends[1] - ends[0]);
    match share > 1e-3 * uniform {
        true => share,
        false => uniform,
    }
}

/// Bounds of a sub-aperture; the outermost ones lie far outside of the aperture, where the image has no power.
fn bounds(part: [f64; 2]) -> [f64; 2] {
    [
        if part[0] <= 0.0 { -10.0 } else { part[0] },
        if part[1] >= 1.0 { 10.0 } else { part[1] },
    ]
}

/// Interpolation weight of a node at a pixel less than [`SIDE`] away.
fn weight(node: [usize; 2], pixel: [usize; 2]) -> f32 {
    let near = |i: usize| 1.0 - node[i].abs_diff(pixel[i]) as f32 / SIDE as f32;
    near(0) * near(1)
}

/// Smoothed step: 0 far below zero, 1 far above.
fn step(x: f64, edge: f64) -> f64 {
    0.5 * libm::erfc(-x / (SQRT_2 * edge))
}

/// Integral of [`step`] from far below zero to `x`.
fn step_integral(x: f64, edge: f64) -> f64 {
    let scaled = x / edge;
    x * step(x, edge) + edge * libm::exp(-0.5 * scaled * scaled) / TAU.sqrt()
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

/// Filter a patch's spectrum to a sub-aperture (fractions from 0 to 1). `edge` is the standard deviation of the smoothed bounds, a fraction of the aperture.
fn keep(patch: &mut Image, band: &Band, part: [f64; 2], (edge, share): (f64, f64)) {
    let size = [patch.rows, patch.columns];
    let count = (size[0] * size[1]) as f64;
    let gain = 1.0 / (count * share.max(1e-3));
    // Frequency from the aperture's centre, cycles per row and per column, within half a cycle.
    let from_middle = |i: usize, k: usize| {
        let cycles = k as f64 / size[i] as f64 - band.centre[i];
        cycles - cycles.round()
    };
    // The highest frequencies along an axis that the bounds depend on are removed smoothly, since the filter is not periodic there.
    let highest = |i: usize, cycles: f64| match band.across[i] == 0.0 {
        true => 1.0,
        false => step(0.5 - 4.0 * EDGE - cycles.abs(), EDGE),
    };
    let axis = |i: usize| -> Vec<[f64; 2]> {
        let cycles = (0..size[i]).map(|k| from_middle(i, k));
        let both = cycles.map(|cycles| [cycles * band.across[i], highest(i, cycles)]);
        both.collect()
    };
    let [down, across] = [axis(0), axis(1)];
    let bounds = bounds(part);
    // Farther from a bound, the smoothed step is 0 or 1 in float32.
    let far = 6.0 * edge;
    for ([down, kept_down], line) in down.iter().zip(patch.pixels.chunks_exact_mut(size[1])) {
        let gain = gain * kept_down;
        for (z, [across, kept_across]) in line.iter_mut().zip(&across) {
            let at = down + across + 0.5;
            let (above, below) = (at - bounds[0], bounds[1] - at);
            let nearest = above.min(below);
            let pass = if nearest > far {
                1.0
            } else if nearest < -far {
                0.0
            } else {
                step(above, edge) - step(-below, edge)
            };
            *z *= (pass * gain * kept_across) as f32;
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
    use num_complex::Complex64;

    use super::*;
    use crate::response::{Carrier, Geometry};

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
                let mut sum = Complex64::ZERO;
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
                            sum += Complex64::cis(TAU * wave_number * path);
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
        let aperture = Aperture::columns(0.2, &image).unwrap().unwrap();
        for part in [[0.0, 0.5], [0.5, 1.0]] {
            let seen = AperturePart::new(&image, &grid, &aperture, part);
            // One of two waves, doubled: 4, within float32 rounding of the transforms.
            for z in seen.window(&[0..8, 0..200]).unwrap().pixels {
                assert!((z.norm_sqr() - 4.0).abs() < 1e-3, "{z}");
            }
        }
        assert!(Aperture::columns(1.5, &image).unwrap().is_none());
        // Weights 1, 3, 3, 1: an outer quarter has an eighth of the sum, the middle half three quarters.
        let tapered = aperture.clone().weighted(vec![1.0, 3.0, 3.0, 1.0]);
        for (part, share) in [
            ([0.0, 0.25], 0.125),
            ([0.25, 0.75], 0.75),
            ([0.0, 0.125], 0.0625),
        ] {
            // Sharp bounds.
            assert!(
                (super::share(tapered.weights(), part, 1e-15) - share).abs() < 1e-12,
                "{part:?}"
            );
        }
        assert!((share(aperture.weights(), [0.25, 0.5], 0.01) - 0.25).abs() < 1e-12);
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

    /// Noise of a band around `centre` cycles per pixel along columns, 0.6 wide: a sum of waves with random phases.
    fn noise(rows: usize, columns: usize, centre: impl Fn(usize) -> f64) -> Image {
        let mut state = 1u64;
        let mut turns = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let waves: Vec<[f64; 3]> = (0..24)
            .map(|_| [0.6 * (turns() - 0.5), 0.6 * (turns() - 0.5), turns()])
            .collect();
        let value = |row: usize, column: usize| {
            let all = waves.iter().map(|[down, across, phase]| {
                let across = across + centre(column);
                Complex64::cis(TAU * (down * row as f64 + across * column as f64 + phase))
            });
            let z: Complex64 = all.sum();
            Complex32::new(z.re as f32, z.im as f32)
        };
        Image {
            rows,
            columns,
            pixels: (0..rows * columns)
                .map(|i| value(i / columns, i % columns))
                .collect(),
        }
    }

    /// Largest difference of windows from the image in one piece, relative to the image's RMS.
    fn largest_difference(
        image: &Image,
        grid: &ImageGrid,
        aperture: &Aperture,
        side: usize,
    ) -> f32 {
        let size = [image.rows, image.columns];
        let part = [0.25, 0.5];
        let seen = |place: &PixelBlock| {
            let found = parts_of(image, grid, aperture, place, &[part]).unwrap();
            found.unwrap().pop().unwrap()
        };
        let whole = seen(&[0..size[0], 0..size[1]]);
        let power: f32 = whole.pixels.iter().map(|z| z.norm_sqr()).sum();
        let rms = (power / whole.pixels.len() as f32).sqrt();
        assert!(rms > 0.1, "{rms}");
        let tiling = Tiling {
            image: size,
            tile: [side; 2],
        };
        (0..tiling.count()).fold(0.0, |most, index| {
            let place = tiling.place(index);
            let expected = whole.window(&place).unwrap();
            let pairs = seen(&place).pixels.into_iter().zip(expected.pixels);
            pairs.fold(most, |most: f32, (a, b)| most.max((a - b).norm() / rms))
        })
    }

    /// Windows of any size equal the image in one piece, though the mean frequency changes along the image (SICD) and the cross-range direction does (from a
    /// radar 60 degrees off the grid's axes). Transforms of 24 waves err by some 1e-6; the impulse response beyond the margin is below 1e-7 of its peak.
    #[test]
    fn windows_equal_the_image_in_one_piece() {
        let drifting = noise(300, 700, |column| 2e-4 * column as f64);
        let grid: ImageGrid = "x=0:700:1,y=0:300:1".parse().unwrap();
        let aperture = Aperture::columns(0.7, &drifting).unwrap().unwrap();
        for side in [100, 256] {
            let off = largest_difference(&drifting, &grid, &aperture, side);
            assert!(off < 2e-5, "{side}: {off}");
        }
        // With a mean frequency of each patch, the bounds differ by 256 x 2 x 2e-4 = 0.1 cycles per pixel from tile to tile.
        let near = Geometry {
            slant_range_m: 400.0,
            azimuth_deg: -30.0,
            aperture_angle_deg: 3.0,
            ..seen()
        };
        let grid: ImageGrid = "x=-70:70:0.2,y=-30:30:0.2".parse().unwrap();
        let aperture = Aperture::seen(&near, &grid).unwrap();
        let antenna_m = Carrier::of(&near).antenna_m;
        let mut image = noise(300, 700, |_| 0.0);
        for (i, z) in image.pixels.iter_mut().enumerate() {
            let range_m = grid.position_m(i / 700, i % 700).distance(antenna_m);
            let phase = Complex64::cis(TAU * (2.0 * range_m / near.wavelength_m).fract());
            *z *= Complex32::new(phase.re as f32, phase.im as f32);
        }
        for side in [100, 256] {
            let off = largest_difference(&image, &grid, &aperture, side);
            assert!(off < 2e-5, "{side}: {off}");
        }
    }
}
