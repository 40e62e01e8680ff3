//! Blocks of pixels, each formed from the pulses whose beam illuminates it.
//!
//! With matched weights (Chim 2018, 3.2.1) pulse `n` has the weight `w_n W_n(c)` in the block of centre `c`, with the slow-time window `w` and the two-way
//! pattern of [`CombinedPattern`], and a pixel `p` is divided by
//!
//! ```text
//! D(p) = sum_n w_n W_n(c) A_n(p)
//! ```
//!
//! so that a point scatterer on it reads its amplitude. Weights are computed when they are asked for. Pixels whose `D` is less than a tenth of that of
//! the block's centre are zero.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use subaperture_signal::window::Window;

use crate::antenna::CombinedPattern;
use crate::geometry::ImageGrid;

/// Smallest divisor of a pixel relative to that of its block's centre.
const LEAST_DIVISOR: f64 = 0.1;

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
    matched: Option<Matched>,
}

/// Weights matched to antenna patterns.
#[derive(Clone, Debug)]
struct Matched {
    pattern: Arc<CombinedPattern>,
    grid: ImageGrid,
    blocks: Vec<MatchedBlock>,
}

/// Sums over the pulses of a block.
#[derive(Clone, Copy, Debug, Default)]
struct MatchedBlock {
    /// Amplitude of largest magnitude at the centre, with its sign.
    peak: f64,
    /// Sum of the weights `w_n W_n(c)`.
    weights: f64,
    /// Divisor `D(c)` of the centre.
    divisor: f64,
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
            matched: None,
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

    /// Multiply the weights of each block by the two-way pattern at its centre, and divide pixels by `D(p)`.
    ///
    /// # Panics
    /// Panics if the grid has other numbers of rows and columns, or the pattern fewer pulses.
    #[must_use]
    pub fn matched(mut self, pattern: Arc<CombinedPattern>, grid: &ImageGrid) -> Self {
        assert_eq!(self.counts, [grid.rows.count, grid.columns.count]);
        let block = |block: usize| {
            let centre_m = self.centre_m(grid, block);
            let range = self.pulses(block);
            let (_, peak) = pattern.seeing(range.clone(), centre_m);
            let window = &self.windows[&range.len()].0;
            let mut sums = MatchedBlock {
                peak,
                ..MatchedBlock::default()
            };
            for (n, w) in range.zip(window.iter()) {
                let weight = w * pattern.weight(n, centre_m, peak);
                sums.weights += weight;
                sums.divisor += weight * pattern.amplitude(n, centre_m);
            }
            sums
        };
        let blocks = (0..self.num_blocks()).map(block).collect();
        self.matched = Some(Matched {
            pattern,
            grid: grid.clone(),
            blocks,
        });
        self
    }

    /// Whether weights are matched to antenna patterns.
    pub fn is_matched(&self) -> bool {
        self.matched.is_some()
    }

    /// Position of the pixel in the middle of a block.
    pub fn centre_m(&self, grid: &ImageGrid, block: usize) -> DVec3 {
        let [row, column] = self.place(block).map(|side| side.start + side.len() / 2);
        grid.position_m(row, column)
    }

    /// Slow-time weights of the pulses of a block, and their sum.
    pub fn slow(&self, block: usize) -> (Cow<'_, [f64]>, f64) {
        let range = &self.pulses[block];
        let (window, sum) = &self.windows[&range.len()];
        let Some(matched) = &self.matched else {
            return (Cow::Borrowed(window), *sum);
        };
        let centre_m = self.centre_m(&matched.grid, block);
        let MatchedBlock { peak, weights, .. } = matched.blocks[block];
        let weight = |(n, w): (usize, &f64)| w * matched.pattern.weight(n, centre_m, peak);
        let slow = range.clone().zip(window.iter()).map(weight);
        (Cow::Owned(slow.collect()), weights)
    }

    /// Slow-time weight of a pulse in a block; 0 for a pulse that does not illuminate it.
    pub fn weight(&self, block: usize, pulse: usize) -> f64 {
        let range = &self.pulses[block];
        if !range.contains(&pulse) {
            return 0.0;
        }
        let w = self.windows[&range.len()].0[pulse - range.start];
        self.matched.as_ref().map_or(w, |matched| {
            let centre_m = self.centre_m(&matched.grid, block);
            w * matched
                .pattern
                .weight(pulse, centre_m, matched.blocks[block].peak)
        })
    }

    /// Gain of the centre of a block: its sum of weights over its divisor. 1 without matched weights, 0 for a block that no pulse illuminates.
    pub fn centre_gain(&self, block: usize) -> f64 {
        let Some(matched) = &self.matched else {
            return 1.0;
        };
        let sums = matched.blocks[block];
        match sums.divisor == 0.0 {
            true => 0.0,
            false => sums.weights / sums.divisor,
        }
    }

    /// Factor of a pixel formed with the weights `slow` of its block, divided by their sum: `sum_n slow_n / D(p)`. 1 without matched weights, 0 where
    /// the divisor is too small.
    pub fn gain(&self, slow: &[f64], row: usize, column: usize) -> f64 {
        let Some(matched) = &self.matched else {
            return 1.0;
        };
        let block = self.block_of(row, column);
        let point_m = matched.grid.position_m(row, column);
        let range = self.pulses[block].clone();
        let terms = range.zip(slow).map(|(n, &w)| match w == 0.0 {
            true => 0.0,
            false => w * matched.pattern.amplitude(n, point_m),
        });
        self.gain_of(block, terms.sum())
    }

    /// Factor of a pixel with the divisor `D(p)`.
    fn gain_of(&self, block: usize, divisor: f64) -> f64 {
        let sums = self
            .matched
            .as_ref()
            .map_or_else(MatchedBlock::default, |matched| matched.blocks[block]);
        match divisor * sums.divisor.signum() <= LEAST_DIVISOR * sums.divisor.abs() {
            true => 0.0,
            false => sums.weights / divisor,
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
