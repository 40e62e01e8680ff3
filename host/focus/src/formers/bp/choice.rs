//! How profiles are read: the spline's degree, the upsampling and the tiles.
//!
//! Of the error's power interpolation may have 7 tenths, the polynomials of tiles' paths one, float32 and phasors two. Splines of higher degree
//! take less upsampling, so that transforms are shorter and a tile's pixels lie fewer bins apart, and more operations a pixel; the
//! cheapest is taken, as a few pulses see a few tiles. Tiles are as large as pays: in larger ones fewer pulses and tiles keep to
//! the polynomials, and the rest takes many times as long.

use std::ops::Range;

use super::{Choices, MOST_OVERSAMPLING, Meaning, SUMMED_PULSES, Way, cost, pulse_bytes};
use crate::patch::{PatchSize, Patches, Rectangle, spread};
use crate::path_tile::{self, pulse_antennas, raster};
use crate::{Aim, MARGIN_DB, rounding};
use subaperture_kernels::tile::{self, Pieces, TilePulse, TileScratch};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::Pulse;
use subaperture_signal::range_profile::RangeProfiler;

/// Shares of the error's power.
const INTERPOLATION: f64 = 0.7;
const TILES: f64 = 0.1;
/// What float32 and the phasors of tiles may have of it, or there are none.
const ARITHMETIC: f64 = 0.2;

/// Degrees of splines that are looked at.
const DEGREES: [usize; 3] = [2, 3, 4];
/// Sides of tiles, pixels.
const SIDES: [usize; 3] = [64, 32, 16];
/// Tiles a side and pulses that are looked at.
const TILES_SEEN: usize = 4;
const PULSES_SEEN: usize = 16;
/// Pieces that a tile may reach beyond a profile's ends before its margin is too long to be worth while.
const LONGEST_MARGIN: usize = 65_536;

/// The relative RMS error that interpolation, tiles and their arithmetic may each have, for an error of `error_db`.
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

    /// Relative RMS error of the way that was chosen, beside interpolation.
    pub(super) fn of_way(&self, aim: &Aim, choices: &Choices) -> f64 {
        match choices.way {
            Way::Tiles { phase_rad, .. } => {
                let length =
                    RangeProfiler::length_for(aim.collection.num_samples, choices.oversampling);
                libm::hypot(phase_rad, arithmetic(aim, length))
            }
            _ => 0.0,
        }
    }
}

/// The margin that tiles of `side` pixels a side take on profiles of `length` bins.
pub(super) fn margin(aim: &Aim, side: usize, length: usize) -> usize {
    let patches = Patches::new(aim.grid, PatchSize::square(side));
    // The first is as large as any.
    let first = patches.spread(2).next().expect("a grid has pixels");
    let finest = bins_m(aim, length).fold(0.0, f64::max);
    Pieces::margin_for(&raster(aim.grid, &first), finest)
}

/// Between which all paths to the grid lie, in turns of profiles; none where that is not known.
pub(super) fn swath(aim: &Aim, meaning: Meaning) -> Option<Range<f64>> {
    if !aim.grid.is_raster() || !matches!(meaning, Meaning::Places) {
        return None;
    }
    let size = [aim.grid.rows.count, aim.grid.columns.count];
    let whole = raster(aim.grid, &Rectangle::of(&size.map(|count| 0..count)));
    let [mut least, mut largest] = [f64::INFINITY, f64::NEG_INFINITY];
    for pulse in &aim.collection.pulses {
        let turns_m = pulse.step_hz / SPEED_OF_LIGHT_M_S;
        for path_m in whole.paths_m(&pulse_antennas(pulse)) {
            least = least.min(path_m * turns_m);
            largest = largest.max(path_m * turns_m);
        }
    }
    Some(least..largest)
}

/// Bins a metre of path, of each pulse.
fn bins_m(aim: &Aim, length: usize) -> impl Iterator<Item = f64> {
    let pulses = aim.collection.pulses.iter();
    pulses.map(move |pulse| (pulse.step_hz / SPEED_OF_LIGHT_M_S * length as f64).abs())
}

/// What float32 costs in tiles, with profiles of `length` bins.
fn arithmetic(aim: &Aim, length: usize) -> f64 {
    let coarsest = bins_m(aim, length).fold(f64::INFINITY, f64::min);
    path_tile::arithmetic(rounding::highest_hz(aim), coarsest)
}

/// A pulse for profiles of `length` bins.
pub(super) fn tile_pulse(aim: &Aim, pulse: &Pulse, length: usize) -> TilePulse {
    let centre_hz = pulse.frequency_hz(aim.collection.num_samples / 2);
    TilePulse {
        antennas: pulse_antennas(pulse),
        turns_m: pulse.step_hz / SPEED_OF_LIGHT_M_S,
        cycles_a_bin: centre_hz / (pulse.step_hz * length as f64),
    }
}

/// The pieces of profiles that are read for paths within a swath, in turns; all if that is not known.
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

/// A way to read profiles, and what it costs a pixel and pulse.
#[derive(Clone, Copy)]
struct Candidate {
    degree: usize,
    oversampling: f64,
    length: usize,
    margin: usize,
    pieces: Pieces,
    way: Way,
    /// About, of one core.
    pixel_ns: f64,
}

/// Chooses, for paths within a swath, if it is known, and antennas that rest while a pulse lasts; and about how many nanoseconds of one core
/// a pixel and pulse then take.
pub(super) fn choose(aim: &Aim, shares: &Shares, swath: Option<&Range<f64>>) -> (Choices, f64) {
    let candidates = DEGREES.map(|degree| Candidate::new(aim, shares, swath, degree));
    let best = candidates
        .into_iter()
        .min_by(|a, b| a.time_ns(aim).total_cmp(&b.time_ns(aim)))
        .expect("there are degrees");
    let bytes = pulse_bytes(aim.collection.num_samples, best.pieces.values());
    let choices = Choices {
        degree: best.degree,
        oversampling: best.oversampling,
        margin: best.margin,
        summed_pulses: (aim.scratch_bytes / bytes).clamp(1, SUMMED_PULSES as u64) as usize,
        way: best.way,
    };
    (choices, best.pixel_ns)
}

impl Candidate {
    /// For paths within a swath, if it is known.
    fn new(aim: &Aim, shares: &Shares, swath: Option<&Range<f64>>, degree: usize) -> Self {
        let count = aim.collection.num_samples;
        let oversampling = RangeProfiler::oversampling_for(degree, shares.interpolation_db);
        let oversampling = oversampling.min(MOST_OVERSAMPLING);
        let length = RangeProfiler::length_for(count, oversampling);
        let points = Self {
            degree,
            oversampling,
            length,
            margin: 1,
            pieces: pieces(degree, length, 1, swath),
            way: Way::Points,
            pixel_ns: aim.means.model.point_ns,
        };
        let tiles = SIDES.map(|side| match swath {
            Some(swath) if tile::DEGREES.contains(&degree) => {
                points.in_tiles(aim, shares, swath, side)
            }
            _ => None,
        });
        let tiles = tiles.into_iter().flatten();
        tiles.fold(points, |best, own| {
            match own.time_ns(aim) < best.time_ns(aim) {
                true => own,
                false => best,
            }
        })
    }

    /// Of the image, about, of one core.
    fn time_ns(&self, aim: &Aim) -> f64 {
        let row = self.pieces.row();
        let profile = cost::profile_ns(aim.means.model, self.degree, self.length, row);
        let pixels = self.pixel_ns * aim.grid.num_pixels() as f64;
        aim.collection.pulses.len() as f64 * (pixels + profile)
    }

    /// The same in tiles of this side; `None` if arithmetic is not good enough for any.
    fn in_tiles(
        &self,
        aim: &Aim,
        shares: &Shares,
        swath: &Range<f64>,
        side: usize,
    ) -> Option<Self> {
        let patches = Patches::new(aim.grid, PatchSize::square(side));
        let highest_hz = rounding::highest_hz(aim);
        let pulses = spread(aim.collection.pulses.len(), PULSES_SEEN);
        let pulses: Vec<&Pulse> = pulses.map(|n| &aim.collection.pulses[n]).collect();
        if arithmetic(aim, self.length) > shares.arithmetic {
            return None;
        }
        let margin = margin(aim, side, self.length);
        if margin > LONGEST_MARGIN {
            return None;
        }
        let rectangles: Vec<Rectangle> = patches.spread(TILES_SEEN).collect();
        let model = aim.means.model;
        let (mut sum, mut look) = (0.0, TileScratch::default());
        for rectangle in &rectangles {
            let raster = raster(aim.grid, rectangle);
            for pulse in &pulses {
                let own = tile_pulse(aim, pulse, self.length);
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
            way: Way::Tiles {
                side,
                phase_rad: shares.tiles,
            },
            pixel_ns: sum / (rectangles.len() * pulses.len()) as f64,
            ..*self
        })
    }
}
