//! The way from a first patch to the small ones of which an image is made.

use std::ops::Range;

use num_complex::Complex32;

use super::LEAF_PIXELS;
use super::patch_history::{PatchHistory, Refiner, Scratch};
use super::track::Track;
use crate::patch::{PatchSize, Rectangle, Segment};
use subaperture_model::monitor::Monitor;

/// Pixels a side at which a patch of few pulses is not: it takes half a megabyte.
pub(super) const LARGEST_LEAF_PIXELS: usize = 128;
/// The pixels of a first patch that are wanted.
pub(super) struct Target<'a, 'b> {
    pub(super) segments: &'a mut [Segment<'b>],
}

impl Target<'_, '_> {
    /// Whether any of them is in `part`.
    fn wants(&self, part: &Rectangle) -> bool {
        self.segments.iter().any(|segment| {
            let rows = part.row..part.row + part.size.rows;
            rows.contains(&segment.row) && !common(segment, part).is_empty()
        })
    }

    /// Those in `part`: row, column and pixel.
    pub(super) fn each(
        &mut self,
        part: Rectangle,
        mut of: impl FnMut(usize, usize, &mut Complex32),
    ) {
        let rows = part.row..part.row + part.size.rows;
        for segment in self.segments.iter_mut() {
            if !rows.contains(&segment.row) {
                continue;
            }
            for column in common(segment, &part) {
                let pixel = &mut segment.pixels[column - segment.column];
                of(segment.row, column, pixel);
            }
        }
    }
}

/// Columns that a segment and a rectangle share.
fn common(segment: &Segment, part: &Rectangle) -> Range<usize> {
    let end = segment.column + segment.pixels.len();
    segment.column.max(part.column)..end.min(part.column + part.size.columns)
}

/// The way from a first patch to its leaves.
pub(super) struct Descent<'a, 'b, 'c, const W: usize> {
    pub(super) monitor: &'a dyn Monitor,
    pub(super) refiner: &'a Refiner<'a, W>,
    pub(super) track: &'a Track,
    pub(super) target: Target<'b, 'c>,
    pub(super) scratch: &'a mut Scratch,
}

impl<const W: usize> Descent<'_, '_, '_, W> {
    /// Adds what `parent` says of `rectangle` to the image, from the patch's own, smaller history if
    /// there is one.
    pub(super) fn descend(&mut self, parent: &PatchHistory, rectangle: Rectangle) {
        if self.monitor.cancelled() || !self.target.wants(&rectangle) {
            return;
        }
        let mut own = self.scratch.levels.pop().unwrap_or_default();
        let smaller = self.refiner.refine(parent, self.track, rectangle, &mut own);
        let history = if smaller { &own } else { parent };
        let side = rectangle.size.rows.max(rectangle.size.columns);
        let few_pulses = history.num_pulses() <= 4 * W || !self.refiner.decimates();
        if side <= LEAF_PIXELS || (few_pulses && side <= LARGEST_LEAF_PIXELS) {
            let (grid, error) = (self.refiner.grid(), self.refiner.profile_error());
            let leaf = &mut self.scratch.leaf;
            leaf.image(grid, error, history, rectangle, &mut self.target);
        } else {
            for quarter in quarters(rectangle) {
                self.descend(history, quarter);
            }
        }
        self.scratch.levels.push(own);
    }
}

/// Four parts of a rectangle, or two or one where a side is a single pixel.
pub(super) fn quarters(whole: Rectangle) -> impl Iterator<Item = Rectangle> {
    let halves = |first: usize, count: usize| {
        let half = count / 2;
        [(first, half), (first + half, count - half)]
    };
    let columns = halves(whole.column, whole.size.columns);
    halves(whole.row, whole.size.rows)
        .into_iter()
        .flat_map(move |(row, rows)| {
            columns.map(|(column, columns)| Rectangle {
                row,
                column,
                size: PatchSize { rows, columns },
            })
        })
        .filter(|part| part.size.rows > 0 && part.size.columns > 0)
}
