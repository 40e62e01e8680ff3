//! Choice of spline degree, upsampling and tile size for backprojection.
//!
//! Interpolation may use 70 % of the allowed error power, the path polynomials of tiles 10 %, float32 and phasors 20 %. Splines of higher degree
//! need less upsampling: transforms are shorter and the bins of a tile closer together, at more operations per pixel. The
//! fastest combination is selected from a few pulses and tiles. Tiles are as large as is profitable: in larger tiles fewer pulses and tiles keep to
//! the polynomials, and the others take many times as long.

use std::ops::Range;

use super::{Choices, GridPoints, MAX_OVERSAMPLING, PixelPaths, SUMMED_PULSES, cost, pulse_bytes};
use crate::patch::{PatchSize, Patches, Rectangle, spread};
use crate::path_tile::{self, pulse_antennas, raster};
use crate::{ImageSpec, MARGIN_DB, rounding};
use subaperture_kernels::tile::{self, Pieces, TilePulse, TileScratch};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::Pulse;
use subaperture_signal::range_profile::RangeProfiler;

/// Share of the error power for interpolation.
const INTERPOLATION: f64 = 0.7;
const TILES: f64 = 0.1;
/// Share of the error power for float32 and tile phasors; tiles are not used where they exceed it.
const ARITHMETIC: f64 = 0.2;

/// Candidate spline degrees.
const DEGREES: [usize; 3] = [2, 3, 4];
/// Candidate tile sides, pixels.
const SIDES: [usize; 3] = [64, 32, 16];
/// Number of tiles per side and of pulses that are sampled.
const TILES_SEEN: usize = 4;
const PULSES_SEEN: usize = 16;
/// Largest useful extent of a tile beyond the ends of a profile, intervals.
const LONGEST_MARGIN: usize = 65_536;

/// Relative RMS errors allowed for interpolation, tiles and their arithmetic within an error of `error_db`.
pub(super) struct Shares {
    pub(super) interpolation_db: f64,
    tiles: f64,
    arithmetic: f64,
}

impl Shares {
    pub(super) fn of(error_db: f64) -> Self {
        let target_db = error_db - MARGIN_DB;
        let target = libm::pow(10.0, target_db / 20.0);
        Self {
            interpolation_db: target_db + 10.0 * libm::log10(INTERPOLATION),
            tiles: target * TILES.sqrt(),
            arithmetic: target * ARITHMETIC.sqrt(),
        }
    }

    /// Relative RMS error of the chosen method without interpolation.
    pub(super) fn of_paths(&self, spec: &ImageSpec, choices: &Choices) -> f64 {
        match choices.paths {
            PixelPaths::Tiles { phase_rad, .. } => {
                let length =
                    RangeProfiler::length_for(spec.collection.num_samples, choices.oversampling);
                libm::hypot(phase_rad, arithmetic(spec, length))
            }
            _ => 0.0,
        }
    }
}

/// Relative RMS error allowed for arithmetic where path polynomials are allowed one of `phase_rad`.
pub(super) fn arithmetic_share(phase_rad: f64) -> f64 {
    phase_rad * (ARITHMETIC / TILES).sqrt()
}

/// Margin needed by tiles of `side` x `side` pixels on profiles of `length` bins.
pub(super) fn margin(spec: &ImageSpec, side: usize, length: usize) -> usize {
    let patches = Patches::new(spec.grid, PatchSize::square(side));
    // The first tile is as large as any.
    let first = patches.spread(2).next().expect("a grid has pixels");
    let finest = bins_m(spec, length).fold(0.0, f64::max);
    Pieces::margin_for(&raster(spec.grid, &first), finest)
}

/// Interval that contains all paths to the grid, in turns of profiles; `None` if unknown.
pub(super) fn swath(spec: &ImageSpec, grid_points: GridPoints) -> Option<Range<f64>> {
    if !spec.grid.is_raster() || !matches!(grid_points, GridPoints::Positions) {
        return None;
    }
    let size = [spec.grid.rows.count, spec.grid.columns.count];
    let whole = raster(spec.grid, &Rectangle::of(&size.map(|count| 0..count)));
    let [mut least, mut largest] = [f64::INFINITY, f64::NEG_INFINITY];
    for pulse in &spec.collection.pulses {
        let turns_m = pulse.step_hz / SPEED_OF_LIGHT_M_S;
        for path_m in whole.paths_m(&pulse_antennas(pulse)) {
            least = least.min(path_m * turns_m);
            largest = largest.max(path_m * turns_m);
        }
    }
    Some(least..largest)
}

/// Bins per metre of path, for each pulse.
fn bins_m(spec: &ImageSpec, length: usize) -> impl Iterator<Item = f64> {
    let pulses = spec.collection.pulses.iter();
    pulses.map(move |pulse| (pulse.step_hz / SPEED_OF_LIGHT_M_S * length as f64).abs())
}

/// Relative RMS error of float32 in tiles with profiles of `length` bins.
fn arithmetic(spec: &ImageSpec, length: usize) -> f64 {
    let coarsest = bins_m(spec, length).fold(f64::INFINITY, f64::min);
    path_tile::arithmetic(rounding::highest_hz(spec), coarsest)
}

/// Tile parameters of a pulse for profiles of `length` bins.
pub(super) fn tile_pulse(spec: &ImageSpec, pulse: &Pulse, length: usize) -> TilePulse {
    let centre_hz = pulse.frequency_hz(spec.collection.num_samples / 2);
    TilePulse {
        antennas: pulse_antennas(pulse),
        turns_m: pulse.step_hz / SPEED_OF_LIGHT_M_S,
        cycles_a_bin: centre_hz / (pulse.step_hz * length as f64),
    }
}

/// Profile intervals read for paths within a swath, in turns; all of them if the swath is unknown.
pub(super) fn pieces(
    degree: usize,
    length: usize,
    margin: usize,
    swath: Option<&Range<f64>>,
) -> Pieces {
    let bins = length as f64;
    match swath {
        Some(swath) => Pieces::over(
            degree,
            length,
            &(swath.start * bins..swath.end * bins),
            margin,
        ),
        None => Pieces::new(degree, length, margin),
    }
}

/// Interpolation method and its cost per pixel and pulse.
#[derive(Clone, Copy)]
struct Candidate {
    degree: usize,
    oversampling: f64,
    length: usize,
    margin: usize,
    pieces: Pieces,
    paths: PixelPaths,
    /// Estimated time per pixel and pulse on one core, ns.
    pixel_ns: f64,
}

/// Choose the method for paths within an optional swath and antennas at rest during a pulse. Return it with the estimated time per pixel
/// and pulse on one core, ns.
pub(super) fn choose(
    spec: &ImageSpec,
    shares: &Shares,
    swath: Option<&Range<f64>>,
) -> (Choices, f64) {
    let candidates = DEGREES.map(|degree| Candidate::new(spec, shares, swath, degree));
    let best = candidates
        .into_iter()
        .min_by(|a, b| a.time_ns(spec).total_cmp(&b.time_ns(spec)))
        .expect("there are degrees");
    let bytes = pulse_bytes(spec.collection.num_samples, best.pieces.values());
    let choices = Choices {
        degree: best.degree,
        oversampling: best.oversampling,
        margin: best.margin,
        summed_pulses: (spec.scratch_bytes / bytes).clamp(1, SUMMED_PULSES as u64) as usize,
        paths: best.paths,
    };
    (choices, best.pixel_ns)
}

impl Candidate {
    /// Make a candidate of the given spline degree for paths within an optional swath.
    fn new(spec: &ImageSpec, shares: &Shares, swath: Option<&Range<f64>>, degree: usize) -> Self {
        let count = spec.collection.num_samples;
        let oversampling = RangeProfiler::oversampling_for(degree, shares.interpolation_db);
        let oversampling = oversampling.min(MAX_OVERSAMPLING);
        let length = RangeProfiler::length_for(count, oversampling);
        let points = Self {
            degree,
            oversampling,
            length,
            margin: 1,
            pieces: pieces(degree, length, 1, swath),
            paths: PixelPaths::Points,
            pixel_ns: spec.numerics.model.point_ns,
        };
        let tiles = SIDES.map(|side| match swath {
            Some(swath) if tile::DEGREES.contains(&degree) => {
                points.in_tiles(spec, shares, swath, side)
            }
            _ => None,
        });
        let tiles = tiles.into_iter().flatten();
        tiles.fold(points, |best, own| {
            match own.time_ns(spec) < best.time_ns(spec) {
                true => own,
                false => best,
            }
        })
    }

    /// Estimated time for the whole image on one core, ns.
    fn time_ns(&self, spec: &ImageSpec) -> f64 {
        let row = self.pieces.row();
        let profile = cost::profile_ns(spec.numerics.model, self.degree, self.length, row);
        let pixels = self.pixel_ns * spec.grid.num_pixels() as f64;
        spec.collection.pulses.len() as f64 * (pixels + profile)
    }

    /// Make the candidate with tiles of this side; `None` if float32 arithmetic is too inexact for tiles.
    fn in_tiles(
        &self,
        spec: &ImageSpec,
        shares: &Shares,
        swath: &Range<f64>,
        side: usize,
    ) -> Option<Self> {
        let patches = Patches::new(spec.grid, PatchSize::square(side));
        let highest_hz = rounding::highest_hz(spec);
        let pulses = spread(spec.collection.pulses.len(), PULSES_SEEN);
        let pulses: Vec<&Pulse> = pulses.map(|n| &spec.collection.pulses[n]).collect();
        if arithmetic(spec, self.length) > shares.arithmetic {
            return None;
        }
        let margin = margin(spec, side, self.length);
        if margin > LONGEST_MARGIN {
            return None;
        }
        let rectangles: Vec<Rectangle> = patches.spread(TILES_SEEN).collect();
        let model = spec.numerics.model;
        let (mut sum, mut look) = (0.0, TileScratch::default());
        for rectangle in &rectangles {
            let raster = raster(spec.grid, rectangle);
            for pulse in &pulses {
                let own = tile_pulse(spec, pulse, self.length);
                let (length, allowed) = (self.length, shares.tiles);
                sum += match path_tile::fits(
                    &mut look,
                    length,
                    &[own],
                    &raster,
                    highest_hz,
                    allowed,
                ) {
                    true => {
                        let (window, groups) = look.grouping();
                        let pixels = (raster.rows * raster.columns) as f64;
                        cost::tile_ns(model, self.degree, window, groups) / pixels
                    }
                    false => self.pixel_ns,
                };
            }
        }
        Some(Self {
            margin,
            pieces: pieces(self.degree, self.length, margin, Some(swath)),
            paths: PixelPaths::Tiles {
                side,
                phase_rad: shares.tiles,
            },
            pixel_ns: sum / (rectangles.len() * pulses.len()) as f64,
            ..*self
        })
    }
}
