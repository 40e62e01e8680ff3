//! Blocks with weights matched to antenna patterns.
//!
//! With the weights `W(c)` of the centre of a block (`model::antenna::CombinedPattern`) instead of the matched ones `A(p)` of a pixel, the signal-to-noise ratio of
//! the pixel in white noise is lower by
//!
//! ```text
//! L = (sum_n W_n(c) A_n(p))^2 / (sum_n W_n(c)^2 sum_n A_n(p)^2)
//! ```
//!
//! The blocks are halved until `L >= -0.1 dB` ([`MAX_LOSS_DB`]) at the corners of sampled blocks, and the gain `sum_n W_n(c) A_n(p)` differs from that of the
//! centre by at most 1 dB ([`MAX_GAIN_DB`]): the error of the formed pixels, relative to their block, then grows by at most as much. Blocks of 8 pixels are not divided
//! further.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::blocks::{self, Division, MIN_SIDE, starts};
use super::track::Track;
use super::{Beam, FormError};
use subaperture_model::antenna::{AntennaPatterns, CombinedPattern};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{BlockIllumination, Collection};
use subaperture_signal::window::Window;

/// Largest loss of the signal-to-noise ratio by weights of the block's centre, dB.
const MAX_LOSS_DB: f64 = 0.1;

/// Largest difference between the gains of a pixel and of the centre of its block, dB.
const MAX_GAIN_DB: f64 = 1.0;

/// Largest number of pulses in the search for the size of blocks.
const FEW_PULSES: usize = 256;

/// Compute pulses and weights of each block: those of the patterns, within the beam if there is one.
///
/// # Errors
/// [`FormError::Unsuited`] as [`blocks::illumination`] for a beam, and if no pulse sees the grid.
pub(super) fn illumination(
    patterns: &AntennaPatterns,
    beam: Option<&Beam>,
    collection: &Collection,
    grid: &ImageGrid,
    slow: Window,
) -> Result<BlockIllumination, FormError> {
    let name = &collection.name;
    if collection.num_turns() != collection.pulses.len() {
        return Err(FormError::unsuited(format!(
            "{name}: expected pulses of one channel for antenna weights, found several channels: select one"
        )));
    }
    let looks = || {
        let pulses = collection.pulses.iter();
        pulses.map(|pulse| (pulse.time_s, [pulse.transmitter_m, pulse.receiver_m]))
    };
    let step = collection.pulses.len().div_ceil(FEW_PULSES);
    let few = patterns.over(looks().step_by(step));
    let counts = [grid.rows.count, grid.columns.count];
    let division = match beam {
        Some(beam) => {
            let track = Track::of(collection, beam)?;
            let side = side(&few, grid, blocks::side(beam, &track, grid)?);
            blocks::divide(beam, &track, grid, side)?
        }
        None => {
            let side = side(&few, grid, counts);
            let blocks = counts[0].div_ceil(side[0]) * counts[1].div_ceil(side[1]);
            let all = (0..blocks).map(|_| 0..collection.pulses.len());
            Division {
                side,
                pulses: all.collect(),
            }
        }
    };
    let pattern = patterns.over(looks());
    let centres: Vec<DVec3> = blocks::centres(grid, division.side).collect();
    let seen = division.pulses.into_par_iter().zip(centres);
    let seen = seen.map(|(pulses, centre_m)| pattern.seeing(pulses, centre_m).0);
    let seen: Vec<Range<usize>> = seen.collect();
    if seen.iter().all(Range::is_empty) {
        return Err(FormError::unsuited(format!(
            "{name}: the two-way antenna pattern is below -40 dB at the whole grid in all pulses: check the directions of the antennas, or form the image \
             without antenna weights"
        )));
    }
    let blocks = BlockIllumination::new(counts, division.side, seen, slow);
    Ok(blocks.matched(Arc::new(pattern), grid))
}

/// Rows and columns of a block: `largest`, halved along the axis with the larger mismatch until it is small.
fn side(pattern: &CombinedPattern, grid: &ImageGrid, largest: [usize; 2]) -> [usize; 2] {
    let counts = [grid.rows.count, grid.columns.count];
    let mut side = largest;
    loop {
        let firsts = [0, 1].map(|axis| starts(counts[axis], side[axis]));
        let columns = &firsts[1];
        let blocks: Vec<[usize; 2]> = firsts[0]
            .iter()
            .flat_map(|&row| columns.iter().map(move |&column| [row, column]))
            .collect();
        let worst = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|i| f64::max(a[i], b[i]));
        let [along_rows, along_columns, corners] = blocks
            .par_iter()
            .map(|first| mismatch(pattern, grid, *first, side))
            .reduce(|| [0.0; 3], worst);
        let splits = [0, 1].map(|axis| side[axis] > MIN_SIDE);
        match splits {
            _ if corners <= 1.0 => return side,
            [false, false] => return side,
            [true, columns] if along_rows >= along_columns || !columns => {
                side[0] = side[0].div_ceil(2);
            }
            _ => side[1] = side[1].div_ceil(2),
        }
    }
}

/// Largest mismatch between the centre of a block and the pixels at the middles of its first and last row, of its first and last column, and its corners:
/// loss and gain relative to their limits.
fn mismatch(
    pattern: &CombinedPattern,
    grid: &ImageGrid,
    first: [usize; 2],
    side: [usize; 2],
) -> [f64; 3] {
    let counts = [grid.rows.count, grid.columns.count];
    let ends = [0, 1].map(|axis| (first[axis] + side[axis]).min(counts[axis]));
    let middle = [0, 1].map(|axis| first[axis] + (ends[axis] - first[axis]) / 2);
    let all = 0..pattern.num_pulses();
    let centre_m = grid.position_m(middle[0], middle[1]);
    let (_, peak) = pattern.seeing(all.clone(), centre_m);
    let weights: Vec<f64> = all
        .clone()
        .map(|n| pattern.weight(n, centre_m, peak))
        .collect();
    let own: f64 = weights.iter().map(|w| w * w).sum();
    let at = |row: usize, column: usize| {
        let point_m = grid.position_m(row, column);
        let (seen, other) = pattern.seeing(all.clone(), point_m);
        let (mut gain, mut power) = (0.0, 0.0);
        for n in seen.clone() {
            let amplitude = pattern.amplitude(n, point_m);
            gain += weights[n] * amplitude;
            power += amplitude * amplitude;
        }
        match (own > 0.0, !seen.is_empty()) {
            (false, false) => 0.0,
            (true, true) if gain * other.signum() > 0.0 => {
                let loss_db = -10.0 * libm::log10(gain * gain / (own * power));
                let gain_db = 20.0 * libm::log10(gain.abs() / own);
                (loss_db / MAX_LOSS_DB).max(gain_db.abs() / MAX_GAIN_DB)
            }
            _ => f64::INFINITY,
        }
    };
    let [rows, columns] = [0, 1].map(|axis| [first[axis], ends[axis] - 1]);
    let along_rows = rows.map(|row| at(row, middle[1]));
    let along_columns = columns.map(|column| at(middle[0], column));
    let corners = rows.map(|row| columns.map(|column| at(row, column)));
    let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    [
        most(&along_rows),
        most(&along_columns),
        most(corners.as_flattened()),
    ]
}
