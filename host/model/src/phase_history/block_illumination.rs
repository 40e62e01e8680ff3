//! Blocks of pixels, each formed from the pulses whose beam illuminates it.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use subaperture_signal::window::Window;

/// Pulses and slow-time weights for each block of pixels of a grid.
///
/// The grid is divided into blocks of [`Self::side`] rows and columns; the last blocks may be smaller. The slow-time window of a block
/// extends from its first to its last pulse.
#[derive(Clone, Debug)]
pub struct BlockIllumination {
    counts: [usize; 2],
    side: [usize; 2],
    /// Pulses of each block, in row-major order of the blocks; empty for a block that no pulse illuminates.
    pulses: Vec<Range<usize>>,
    /// Slow-time weights and their sum, by number of pulses.
    windows: BTreeMap<usize, (Arc<[f64]>, f64)>,
}

impl BlockIllumination {
    /// Divide a grid of `counts` rows and columns into blocks of `side`, with the `pulses` of each block in row-major order.
    ///
    /// # Panics
    /// Panics if the number of ranges differs from the number of blocks, or a side is 0.
    pub fn new(
        counts: [usize; 2],
        side: [usize; 2],
        pulses: Vec<Range<usize>>,
        slow: Window,
    ) -> Self {
        let mut windows = BTreeMap::new();
        for range in &pulses {
            windows.entry(range.len()).or_insert_with(|| {
                let weights = slow.weights(range.len());
                let sum = weights.iter().sum();
                (weights.into(), sum)
            });
        }
        let blocks = Self {
            counts,
            side,
            pulses,
            windows,
        };
        assert_eq!(
            blocks.pulses.len(),
            blocks.across() * counts[0].div_ceil(side[0])
        );
        blocks
    }

    /// Rows and columns of a block.
    pub fn side(&self) -> [usize; 2] {
        self.side
    }

    fn across(&self) -> usize {
        self.counts[1].div_ceil(self.side[1])
    }

    /// Number of blocks.
    pub fn num_blocks(&self) -> usize {
        self.pulses.len()
    }

    /// Index of the block that contains a pixel.
    pub fn block_of(&self, row: usize, column: usize) -> usize {
        row / self.side[0] * self.across() + column / self.side[1]
    }

    /// Rows and columns of a block.
    pub fn place(&self, block: usize) -> [Range<usize>; 2] {
        let at = [block / self.across(), block % self.across()];
        [0, 1].map(|axis| {
            let start = at[axis] * self.side[axis];
            start..(start + self.side[axis]).min(self.counts[axis])
        })
    }

    /// Pulses that illuminate a block; possibly empty.
    pub fn pulses(&self, block: usize) -> Range<usize> {
        self.pulses[block].clone()
    }

    /// Slow-time weights of the pulses of a block, and their sum.
    pub fn slow(&self, block: usize) -> (&[f64], f64) {
        let (weights, sum) = &self.windows[&self.pulses[block].len()];
        (weights, *sum)
    }

    /// Slow-time weight of a pulse in a block; 0 for a pulse that does not illuminate it.
    pub fn weight(&self, block: usize, pulse: usize) -> f64 {
        let range = &self.pulses[block];
        match range.contains(&pulse) {
            true => self.slow(block).0[pulse - range.start],
            false => 0.0,
        }
    }

    /// Number of pixels that no pulse illuminates.
    pub fn num_unseen(&self) -> u64 {
        let unseen = (0..self.num_blocks()).filter(|&block| self.pulses[block].is_empty());
        let pixels = unseen.map(|block| {
            self.place(block)
                .iter()
                .map(|r| r.len() as u64)
                .product::<u64>()
        });
        pixels.sum()
    }
}
