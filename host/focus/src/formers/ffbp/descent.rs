//! The way from a first patch to the small ones of which an image is made.

use super::LEAF_PIXELS;
use super::leaf::Leaf;
use super::patch_history::{PatchHistory, Refiner};
use super::target::Target;
use super::track::Track;
use crate::patch::{PatchSize, Rectangle};
use subaperture_model::monitor::Monitor;

/// Pixels a side at which a patch of few pulses is not: it takes half a megabyte.
pub(super) const LARGEST_LEAF_PIXELS: usize = 128;

/// One thread's buffers: a history a level, and a leaf's.
#[derive(Default)]
pub(super) struct Scratch {
    levels: Vec<PatchHistory>,
    leaf: Leaf,
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
            let (grid, shares) = (self.refiner.grid(), self.refiner.shares());
            let leaf = &mut self.scratch.leaf;
            leaf.image(grid, shares, history, rectangle, &mut self.target);
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
