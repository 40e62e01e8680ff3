//! Registration of channel images: errors of the array's geometry from the interferometric phase of clutter.
//!
//! A receiver at the position `r + e` in place of `r` leaves the phase
//!
//! ```text
//! phi(p) = (2 pi / lambda) u(p) . e
//! ```
//!
//! at a stationary pixel `p`, `u` the unit vector from the antenna to it. The part of `e` along the mean line of sight is a constant phase. The part
//! along the track is a slope over azimuth, the part `e_n` across track and line of sight a slope over range and height. Both are
//! estimated from the interferogram of each channel with the first, in blocks of pixels: first the slopes from the phase
//! differences of neighbouring blocks, which need no unwrapping below half a cycle per block, then all three terms by iteratively reweighted
//! least squares, so that blocks with moving targets or low coherence have little weight.
//!
//! An array at a crab angle `psi` to the track, with the baseline `b` along it, has `e = psi b` across the track.

use std::f64::consts::TAU;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_signal::dense::Factor;

use crate::adaptive::widen;
use crate::turns::Turns;

/// Edge of a block in pixels, or a multiple of it where an image has more than [`MOST_BLOCKS`].
const BLOCK: usize = 16;
const MOST_BLOCKS: usize = 4096;

/// Iterations of the reweighted least squares.
const ITERATIONS: usize = 12;

/// Residual from which weights fall, in standard deviations (Huber 1964).
const HUBER: f64 = 1.345;

/// Smallest fraction of a diagonal element that elimination may leave: below it, a slope is not observed.
const LEAST: f64 = 1e-9;

/// Interferometric phase model of a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct PhaseModel {
    /// Amplitude relative to channel 0.
    pub gain: f64,
    /// Phase at the grid's centre, radians.
    pub phase_rad: f64,
    /// Displacement of the receiver along the track, metres.
    pub along_m: f64,
    /// Displacement across the track and the line of sight, metres, upwards positive.
    pub across_m: f64,
    /// Standard deviation of the phase of blocks about the model, radians.
    pub residual_rad: f64,
    /// Coherence after the model is removed, mean over blocks.
    pub coherence: f64,
}

/// Geometry of the phase model: antenna position and directions in the middle of the aperture.
#[derive(Clone, Copy, Debug)]
pub struct View {
    antenna_m: DVec3,
    along: DVec3,
    across: DVec3,
    sight: DVec3,
    wavenumber: f64,
}

impl View {
    /// Make the view of `centre_m` from `antenna_m` moving along `velocity`, at a wavelength in metres.
    pub fn new(antenna_m: DVec3, velocity: DVec3, centre_m: DVec3, wavelength_m: f64) -> Self {
        let along = velocity.normalize_or_zero();
        let sight = (centre_m - antenna_m).normalize_or_zero();
        let across = along.cross(sight).normalize_or_zero();
        Self {
            antenna_m,
            along,
            across: if across.z < 0.0 { -across } else { across },
            sight,
            wavenumber: TAU / wavelength_m,
        }
    }

    /// Direction of the track, a unit vector.
    pub fn along(&self) -> DVec3 {
        self.along
    }

    /// Position of the antenna, metres.
    pub fn antenna_m(&self) -> DVec3 {
        self.antenna_m
    }

    /// Phase per metre of displacement along and across at a point, relative to the centre.
    fn slopes(&self, point_m: DVec3) -> [f64; 2] {
        let sight = (point_m - self.antenna_m).normalize_or_zero() - self.sight;
        [self.along, self.across].map(|axis| self.wavenumber * sight.dot(axis))
    }

    /// Phase of a model at a point, radians.
    pub fn phase_rad(&self, model: &PhaseModel, point_m: DVec3) -> f64 {
        let [along, across] = self.slopes(point_m);
        model.phase_rad + along * model.along_m + across * model.across_m
    }

    /// Crab angle, radians, right-handed about z, that displaces a receiver at `along_m` by `across_m`. `None` where the line of sight is
    /// horizontal, so that a horizontal displacement across the track is along the line of sight.
    pub fn crab_rad(&self, along_m: f64, across_m: f64) -> Option<f64> {
        let part = DVec3::Z.cross(self.along).dot(self.across);
        (part.abs() > 0.05 && along_m != 0.0).then(|| across_m / (along_m * part))
    }
}

/// Block of an interferogram.
struct Block {
    cross: Complex64,
    powers: [f64; 2],
    slopes: [f64; 2],
}

impl Block {
    fn coherence(&self) -> f64 {
        self.cross.norm() / (self.powers[0] * self.powers[1]).sqrt()
    }

    fn is_sound(&self) -> bool {
        self.powers.iter().all(|&p| p.is_finite() && p > 0.0)
    }
}

/// Estimate the phase model of `channel` against `reference`, images on `grid`. `None` if no block of pixels has power in both.
pub fn estimate(
    reference: &Image,
    channel: &Image,
    grid: &ImageGrid,
    view: &View,
) -> Option<PhaseModel> {
    let (rows, columns) = (reference.rows, reference.columns);
    let times = (rows * columns).div_ceil(BLOCK * BLOCK * MOST_BLOCKS);
    let edge = BLOCK * (times as f64).sqrt().ceil() as usize;
    let tiles = [rows.div_ceil(edge), columns.div_ceil(edge)];
    let block = |i: usize| {
        let (first_row, first_column) = (i / tiles[1] * edge, i % tiles[1] * edge);
        let last = [
            (first_row + edge).min(rows),
            (first_column + edge).min(columns),
        ];
        let mut sums = Block {
            cross: Complex64::ZERO,
            powers: [0.0; 2],
            slopes: view.slopes(grid.position_m(
                (first_row + last[0] - 1) / 2,
                (first_column + last[1] - 1) / 2,
            )),
        };
        for row in first_row..last[0] {
            for at in row * columns + first_column..row * columns + last[1] {
                let [a, b] = [reference, channel].map(|image| widen(image.pixels[at]));
                sums.cross += b * a.conj();
                sums.powers[0] += a.norm_sqr();
                sums.powers[1] += b.norm_sqr();
            }
        }
        sums
    };
    let blocks = (0..tiles[0] * tiles[1]).into_par_iter();
    let blocks: Vec<Block> = blocks.map(block).collect();
    let sound = || blocks.iter().filter(|block| block.is_sound());
    let count = sound().count();
    if count == 0 {
        return None;
    }
    let gain = median(sound().map(|block| (block.powers[1] / block.powers[0]).sqrt()));
    let [along_m, across_m] = from_neighbours(&blocks, tiles);
    let remove = |[along_m, across_m]: [f64; 2], block: &Block| {
        let phase_rad = block.slopes[0] * along_m + block.slopes[1] * across_m;
        block.cross * Complex64::cis(-phase_rad) / (block.powers[0] * block.powers[1]).sqrt()
    };
    let mean: Complex64 = sound()
        .map(|block| remove([along_m, across_m], block))
        .sum();
    let mut terms = [mean.arg(), along_m, across_m];
    let mut spread_rad = f64::INFINITY;
    let phases: Vec<(&Block, f64)> = sound().map(|block| (block, block.cross.arg())).collect();
    for _ in 0..ITERATIONS {
        let residuals = phases.iter().map(|&(block, phase_rad)| {
            let model_rad = terms[0] + block.slopes[0] * terms[1] + block.slopes[1] * terms[2];
            let cycles = (phase_rad - model_rad) / TAU;
            (block, TAU * (cycles - cycles.round()))
        });
        let residuals: Vec<(&Block, f64)> = residuals.collect();
        spread_rad = 1.4826 * median(residuals.iter().map(|(_, left)| left.abs()));
        let limit = HUBER * spread_rad.max(1e-12);
        let weighted = residuals.iter().map(|&(block, left)| {
            // Variance of the phase of an interferogram, up to its number of samples.
            let coherence = block.coherence().clamp(1e-6, 1.0 - 1e-6);
            let precision = coherence * coherence / (1.0 - coherence * coherence);
            let weight = precision.min(1e3) * (limit / left.abs().max(1e-300)).min(1.0);
            (weight, [1.0, block.slopes[0], block.slopes[1]], left)
        });
        let Some(step) = least_squares(&weighted.collect::<Vec<_>>()) else {
            break;
        };
        for (term, step) in terms.iter_mut().zip(step) {
            *term += step;
        }
    }
    let left: Complex64 = sound()
        .map(|block| remove([terms[1], terms[2]], block))
        .sum();
    Some(PhaseModel {
        gain,
        phase_rad: terms[0],
        along_m: terms[1],
        across_m: terms[2],
        residual_rad: spread_rad,
        coherence: left.norm() / count as f64,
    })
}

/// Slopes from the phase differences of neighbouring blocks.
fn from_neighbours(blocks: &[Block], [rows, columns]: [usize; 2]) -> [f64; 2] {
    let mut weighted = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let at = row * columns + column;
            let right = (column + 1 < columns).then_some(at + 1);
            let below = (row + 1 < rows).then_some(at + columns);
            for next in [right, below].into_iter().flatten() {
                let (a, b) = (&blocks[at], &blocks[next]);
                if !(a.is_sound() && b.is_sound()) {
                    continue;
                }
                let weight = a.coherence() * b.coherence();
                let slopes = [0, 1].map(|i| b.slopes[i] - a.slopes[i]);
                let left = (b.cross * a.cross.conj()).arg();
                weighted.push((weight * weight, [0.0, slopes[0], slopes[1]], left));
            }
        }
    }
    least_squares(&weighted).map_or([0.0; 2], |terms| [terms[1], terms[2]])
}

/// Weighted least squares of three terms. A term that the data do not observe is 0.
fn least_squares(weighted: &[(f64, [f64; 3], f64)]) -> Option<[f64; 3]> {
    let mut squares = [0.0; 3];
    for (weight, row, _) in weighted {
        for (square, value) in squares.iter_mut().zip(row) {
            *square += weight * value * value;
        }
    }
    // Terms are scaled to unit diagonal.
    let scales = squares.map(f64::sqrt);
    for used in [
        [true, true, true],
        [true, true, false],
        [true, false, false],
    ] {
        let terms: Vec<usize> = (0..3).filter(|&i| used[i] && scales[i] > 0.0).collect();
        let size = terms.len();
        let (mut matrix, mut right) = (vec![0.0; size * size], vec![0.0; size]);
        for (weight, row, left) in weighted {
            for (i, &a) in terms.iter().enumerate() {
                right[i] += weight * row[a] / scales[a] * left;
                for (j, &b) in terms.iter().enumerate() {
                    matrix[i * size + j] += weight * row[a] * row[b] / (scales[a] * scales[b]);
                }
            }
        }
        let solved = Factor::new(size, &matrix, LEAST).and_then(|factor| factor.solved(&right));
        if let Some(solved) = solved.filter(|_| size > 0) {
            let mut found = [0.0; 3];
            for (&term, value) in terms.iter().zip(solved) {
                found[term] = value / scales[term];
            }
            return Some(found);
        }
    }
    None
}

/// Median of at least one value, the upper one of two.
pub(crate) fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Pixels of a row over which the phase of a model is interpolated.
const SEGMENT: usize = 64;

/// Largest error of the interpolated phase, radians: -120 dB of the pixel.
const MAX_ERROR_RAD: f64 = 1e-6;

/// Remove the phase model and the gain from the image of a channel.
///
/// Along a row the phase is linear but for a curvature of about `2 pi |e| / (lambda R^2)` per square metre. In segments of pixels it is interpolated
/// between the ends. The error, largest in the middle, is evaluated there; a segment in which it exceeds 1e-6 rad, and a grid with a relief, whose heights are not
/// smooth, have the phase of each pixel evaluated.
pub fn remove(image: &mut Image, grid: &ImageGrid, view: &View, model: &PhaseModel) {
    let columns = image.columns;
    let lines = image.pixels.par_chunks_mut(columns.max(1)).enumerate();
    lines.for_each(|(row, line)| {
        let phase = |column: usize| view.phase_rad(model, grid.position_m(row, column));
        let factor = |phase_rad: f64| Complex64::from_polar(1.0 / model.gain, -phase_rad);
        let mut start_rad = phase(0);
        for start in (0..columns).step_by(SEGMENT) {
            let end = (start + SEGMENT).min(columns);
            let part = &mut line[start..end];
            // The last segment ends with the row.
            let last = end.min(columns - 1);
            let end_rad = phase(last);
            let middle = (start + last) / 2;
            let step_rad = (end_rad - start_rad) / (last - start).max(1) as f64;
            let linear_rad = start_rad + step_rad * (middle - start) as f64;
            let is_linear = (phase(middle) - linear_rad).abs() <= MAX_ERROR_RAD;
            if is_linear && grid.relief.is_none() {
                Turns::new(Complex64::cis(-step_rad)).multiply(part, factor(start_rad));
            } else {
                for (z, column) in part.iter_mut().zip(start..) {
                    *z *= narrow(factor(phase(column)));
                }
            }
            start_rad = end_rad;
        }
    });
}

fn narrow(value: Complex64) -> Complex32 {
    Complex32::new(value.re as f32, value.im as f32)
}
