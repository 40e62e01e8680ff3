//! Division of a grid into blocks with nearly constant aperture.

use std::ops::Range;

use glam::DVec3;

use super::track::Track;
use super::{Beam, BeamSource};
use crate::FormError;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{BlockIllumination, Collection};
use subaperture_signal::window::Window;

/// Largest shift of the aperture centre across one block, as a fraction of the aperture length.
const MAX_SHIFT: f64 = 0.125;
/// Minimum rows or columns of a block; smaller blocks cost more than the shorter aperture saves.
pub(super) const MIN_SIDE: usize = 8;
/// Blocks sampled along each axis when the block size is chosen.
const LOOKED_AT: usize = 9;

/// Division of a grid, and the pulses of each block.
pub(super) struct Division {
    pub(super) side: [usize; 2],
    /// Pulses of each block in row-major order.
    pub(super) pulses: Vec<Range<usize>>,
}

/// Compute the pulses that illuminate each block of a grid.
///
/// # Errors
/// [`FormError::Unsuited`] if the beam passes a point more than once, if pulses belong to several channels, or if no pulse illuminates the grid.
pub(super) fn illumination(
    beam: &Beam,
    collection: &Collection,
    grid: &ImageGrid,
    slow: Window,
) -> Result<BlockIllumination, FormError> {
    let track = Track::of(collection, beam)?;
    let division = divide(beam, &track, grid, side(beam, &track, grid)?)?;
    if division.pulses.iter().all(Range::is_empty) {
        return Err(unseen(beam, &collection.name));
    }
    let counts = [grid.rows.count, grid.columns.count];
    let Division { side, pulses } = division;
    Ok(BlockIllumination::new(counts, side, pulses, slow))
}

/// Pulses in the beam for each block of `side` pixels.
pub(super) fn divide(
    beam: &Beam,
    track: &Track,
    grid: &ImageGrid,
    side: [usize; 2],
) -> Result<Division, FormError> {
    let centres = centres(grid, side);
    let pulses = centres.map(|centre_m| track.seeing(beam, centre_m));
    let pulses = pulses.collect::<Result<_, _>>()?;
    Ok(Division { side, pulses })
}

/// Middles of the blocks of a grid, in row-major order.
pub(super) fn centres(grid: &ImageGrid, side: [usize; 2]) -> impl Iterator<Item = DVec3> + '_ {
    let counts = [grid.rows.count, grid.columns.count];
    let blocks = [0, 1].map(|axis| counts[axis].div_ceil(side[axis]));
    (0..blocks[0] * blocks[1]).map(move |block| {
        let block = [block / blocks[1], block % blocks[1]];
        let [row, column] = [0, 1].map(|axis| {
            let start = block[axis] * side[axis];
            let end = (start + side[axis]).min(counts[axis]);
            start + (end - start) / 2
        });
        grid.position_m(row, column)
    })
}

/// Error for a grid that no pulse illuminates.
pub(super) fn unseen(beam: &Beam, name: &str) -> FormError {
    let of = match beam.source {
        BeamSource::Given => "",
        source => source.name(),
    };
    FormError::unsuited(format!(
        "{name}: no pulse sees the grid within {:.3} deg of {:.3} deg forward of broadside, the beam {of}",
        0.5 * beam.width_rad.to_degrees(),
        beam.squint_rad.to_degrees()
    ))
}

/// Rows and columns of a block. The whole grid is halved along the axis with the larger aperture shift until the shift is small.
pub(super) fn side(beam: &Beam, track: &Track, grid: &ImageGrid) -> Result<[usize; 2], FormError> {
    let counts = [grid.rows.count, grid.columns.count];
    let mut shifting = Shifting {
        beam,
        track,
        grid,
        longest: 1,
    };
    for row in starts(counts[0], 1) {
        for column in starts(counts[1], 1) {
            let seeing = track.seeing(beam, grid.position_m(row, column))?;
            shifting.longest = shifting.longest.max(seeing.len());
        }
    }
    let mut side = counts;
    loop {
        let mut most = [0.0f64; 2];
        let firsts = [0, 1].map(|axis| starts(counts[axis], side[axis]));
        for &row in &firsts[0] {
            for &column in &firsts[1] {
                let ends = [
                    (row + side[0]).min(counts[0]) - 1,
                    (column + side[1]).min(counts[1]) - 1,
                ];
                let own = shifting.over([row, column], ends)?;
                most = [0, 1].map(|axis| most[axis].max(own[axis]));
            }
        }
        let splits = [0, 1].map(|axis| side[axis] > MIN_SIDE);
        match splits {
            _ if most[0] + most[1] <= MAX_SHIFT => return Ok(side),
            [false, false] => return Ok(side),
            [true, columns] if most[0] >= most[1] || !columns => side[0] = side[0].div_ceil(2),
            _ => side[1] = side[1].div_ceil(2),
        }
    }
}

/// First rows or columns of sampled blocks, including the first and the last block.
pub(super) fn starts(count: usize, side: usize) -> Vec<usize> {
    let last = count.div_ceil(side) - 1;
    let blocks = (0..LOOKED_AT).map(|i| i * last / (LOOKED_AT - 1));
    let mut starts: Vec<usize> = blocks.map(|block| block * side).collect();
    starts.dedup();
    starts
}

/// Measure of the aperture shift across a block.
struct Shifting<'a> {
    beam: &'a Beam,
    track: &'a Track<'a>,
    grid: &'a ImageGrid,
    /// Length of the longest aperture, pulses.
    longest: usize,
}

impl Shifting<'_> {
    /// Shift of the aperture centre from first to last row and from first to last column, as fractions of the aperture length.
    fn over(&self, first: [usize; 2], last: [usize; 2]) -> Result<[f64; 2], FormError> {
        let at = |row: usize, column: usize| {
            let place_m = self.grid.position_m(row, column);
            let seeing = self.track.seeing(self.beam, place_m)?;
            Ok::<_, FormError>(match seeing.is_empty() {
                // No pulse illuminates the point: it lies ahead of or behind the beam along the whole track.
                true => match self.track.is_ahead(self.beam, 0, place_m) {
                    true => self.track.len()..self.track.len(),
                    false => 0..0,
                },
                false => seeing,
            })
        };
        let [corner, right] = [at(first[0], first[1])?, at(first[0], last[1])?];
        let [above, both] = [at(last[0], first[1])?, at(last[0], last[1])?];
        Ok([
            self.shift(&corner, &above).max(self.shift(&right, &both)),
            self.shift(&corner, &right).max(self.shift(&above, &both)),
        ])
    }

    fn shift(&self, a: &Range<usize>, b: &Range<usize>) -> f64 {
        let centre = |r: &Range<usize>| 0.5 * (r.start + r.end) as f64;
        // An aperture truncated by the end of the track does not measure the aperture length.
        let cut = |r: &&Range<usize>| r.start == 0 || r.end == self.track.len();
        let length = match [a, b].iter().any(cut) {
            true => self.longest,
            false => a.len().max(b.len()),
        };
        (centre(a) - centre(b)).abs() / length as f64
    }
}
