//! Image tiles formed block by block, each block from its own pulses.

use std::sync::Arc;

use super::choices::{Choices, Part};
use super::normalisation::{normalise, tolerance};
use crate::patch::Rectangle;
use crate::{FormError, Forming, ImageFormer, ImageSpec, Tile, Work};
use subaperture_model::image::copy_common;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{BlockIllumination, PulseRange};

/// Former opened for each block of a grid.
pub(super) struct InBlocks<'a> {
    former: Arc<dyn ImageFormer>,
    spec: ImageSpec<'a>,
    illumination: Arc<BlockIllumination>,
    choices: Choices,
}

impl<'a> InBlocks<'a> {
    pub(super) fn new(
        former: Arc<dyn ImageFormer>,
        spec: ImageSpec<'a>,
        illumination: Arc<BlockIllumination>,
        choices: Choices,
    ) -> Self {
        Self {
            former,
            spec,
            illumination,
            choices,
        }
    }

    /// Blocks that contain pixels of the given rectangles.
    fn blocks(&self, places: &[Rectangle]) -> Vec<usize> {
        (0..self.illumination.num_blocks())
            .filter(|&block| self.choices.get(block).is_some())
            .filter(|&block| {
                let place = self.illumination.place(block);
                places.iter().any(|own| own.meets(&place))
            })
            .collect()
    }
}

impl Forming for InBlocks<'_> {
    fn reads_all_pulses(&self) -> bool {
        false
    }

    fn pulses_read(&self, work: &Work, places: &[Rectangle]) -> Result<u64, FormError> {
        let mut count = 0;
        for block in self.blocks(places) {
            let Some(choices) = self.choices.get(block) else {
                continue;
            };
            let part = Part::of(&self.spec, &self.illumination, block);
            let history = PulseRange::new(work.history, self.illumination.pulses(block));
            let forming = self.former.open(part.spec(&self.spec), choices)?;
            let within = Work {
                history: &history,
                ..*work
            };
            count += forming.pulses_read(&within, &[Tile::place_of(&part.grid)])?;
        }
        Ok(count)
    }

    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let places: Vec<Rectangle> = tiles.iter().map(|tile| tile.place).collect();
        let blocks = self.blocks(&places);
        for (done, &block) in blocks.iter().enumerate() {
            let Some(choices) = self.choices.get(block) else {
                continue;
            };
            let part = Part::of(&self.spec, &self.illumination, block);
            let history = PulseRange::new(work.history, self.illumination.pulses(block));
            let forming = self.former.open(part.spec(&self.spec), choices)?;
            let monitor = Share {
                whole: work.monitor,
                from: done as f64 / blocks.len() as f64,
                share: 1.0 / blocks.len() as f64,
            };
            let mut own = Tile::whole(&part.grid);
            let held_bytes =
                8 * own.pixels.len() as u64 + size_of_val(part.collection.pulses.as_slice()) as u64;
            let within = Work {
                history: &history,
                memory_bytes: work.memory_bytes.saturating_sub(held_bytes),
                monitor: &monitor,
            };
            forming.form(&within, std::slice::from_mut(&mut own))?;
            if self.illumination.is_matched() {
                let tolerance = tolerance(self.former.bound_db());
                let slow = &part.weights.slow;
                normalise(&self.illumination, block, slow, tolerance, &mut own.pixels);
            }
            let place = self.illumination.place(block);
            for tile in tiles.iter_mut() {
                if !tile.place.meets(&place) {
                    continue;
                }
                let whole = tile.place.place();
                copy_common(&whole, &mut tile.pixels, &place, &own.pixels);
            }
        }
        Ok(())
    }
}

/// Progress of one block as a share of the whole image.
struct Share<'a> {
    whole: &'a dyn Monitor,
    from: f64,
    share: f64,
}

impl Monitor for Share<'_> {
    fn progress(&self, part: f64) {
        self.whole.progress(self.from + self.share * part);
    }

    fn cancelled(&self) -> bool {
        self.whole.cancelled()
    }

    fn begins(&self, stage: &'static str) {
        self.whole.begins(stage);
    }

    fn ends(&self, stage: &'static str) {
        self.whole.ends(stage);
    }
}
