//! Split of an image's range cells into two halves, for estimation and for validation.
//!
//! Phases chosen to sharpen an image always sharpen it, right or wrong, because they also fit noise and speckle.
//! Phases estimated on some range cells are therefore validated on others, with independent speckle and
//! noise. The halves are stripes of range cells. Cells next to the other half are excluded from validation, because neighbours are
//! correlated. Stripes are chosen so that both halves contain bright points, and that no bright point
//! lies on a border, where its range main lobe would be in both.

use std::collections::BTreeMap;

use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Image, power};
use subaperture_model::phase_history::Collection;

use glam::DVec3;

use super::echoes::cell_path_m;

/// Range cells of a stripe, in order of preference.
const STRIPES: [usize; 5] = [4, 6, 8, 3, 2];

/// Score from which a split is accepted, and smallest share of the power in a half.
const GOOD: f64 = 0.35;
const MIN_PART: f64 = 0.02;

/// One of two disjoint halves of the range cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Half {
    /// Stripes 0, 2, 4 and so on.
    Even,
    /// Stripes 1, 3, 5 and so on.
    Odd,
}

/// Half of each range cell.
#[derive(Clone, Debug)]
pub(crate) struct Split {
    halves: BTreeMap<i64, (Half, bool)>,
}

/// Range cell of a position at the centre of the aperture.
pub(crate) fn bin_of(collection: &Collection, place_m: DVec3) -> i64 {
    let middle = &collection.pulses[collection.num_turns() / 2];
    (middle.path_m(place_m) / cell_path_m(collection)).floor() as i64
}

/// Largest power of `image` in each range cell that has any, in ascending order of range cells.
pub(crate) fn peaks(collection: &Collection, grid: &ImageGrid, image: &Image) -> Vec<(i64, f64)> {
    let mut peaks = BTreeMap::<i64, f64>::new();
    for (index, &pixel) in image.pixels.iter().enumerate() {
        let power = power(pixel);
        if power > 0.0 && power.is_finite() {
            let place_m = grid.position_m(index / image.columns, index % image.columns);
            let peak = peaks.entry(bin_of(collection, place_m)).or_insert(0.0);
            *peak = peak.max(power);
        }
    }
    peaks.into_iter().collect()
}

impl Split {
    /// Best split of the range cells with power in `image`; `None` if one half would have too little power.
    pub(crate) fn of(collection: &Collection, grid: &ImageGrid, image: &Image) -> Option<Self> {
        let bins = peaks(collection, grid, image);
        let total: f64 = bins.iter().map(|bin| bin.1).sum();
        let is_odd = |rank: usize, stripe: usize, offset: usize| (rank + offset) / stripe % 2 == 1;
        // Power of the weaker half, and power on borders.
        let parts = |stripe: usize, offset: usize| {
            let odd = bins.iter().enumerate();
            let odd: f64 = odd
                .filter(|(rank, _)| is_odd(*rank, stripe, offset))
                .map(|(_, bin)| bin.1)
                .sum();
            let border: f64 = (1..bins.len())
                .filter(|&rank| {
                    is_odd(rank, stripe, offset) != is_odd(rank - 1, stripe, offset)
                        && bins[rank].0 == bins[rank - 1].0 + 1
                })
                .map(|rank| bins[rank].1.min(bins[rank - 1].1))
                .sum();
            let least = odd.min(total - odd) / total;
            (least, least - border / total)
        };
        let mut best: Option<(f64, usize, usize)> = None;
        for stripe in STRIPES {
            for offset in 0..2 * stripe {
                let (least, score) = parts(stripe, offset);
                if least >= MIN_PART && best.is_none_or(|best| score > best.0) {
                    best = Some((score, stripe, offset));
                }
            }
            if best.is_some_and(|best| best.0 >= GOOD) {
                break;
            }
        }
        let (_, stripe, offset) = best?;
        let halves = bins.iter().enumerate().map(|(rank, bin)| {
            let half = match is_odd(rank, stripe, offset) {
                true => Half::Odd,
                false => Half::Even,
            };
            let neighbours = [rank.wrapping_sub(1), rank + 1];
            let on_border = neighbours.iter().any(|&other| {
                other < bins.len()
                    && bins[other].0.abs_diff(bin.0) == 1
                    && is_odd(other, stripe, offset) != is_odd(rank, stripe, offset)
            });
            (bin.0, (half, stripe > 2 && on_border))
        });
        Some(Self {
            halves: halves.collect(),
        })
    }

    /// Half of a range cell; `None` for cells without power.
    pub(crate) fn half(&self, bin: i64) -> Option<Half> {
        self.halves.get(&bin).map(|cell| cell.0)
    }

    /// Whether a range cell adjoins the other half: it shares noise and speckle with that and is excluded from validation.
    pub(crate) fn on_border(&self, bin: i64) -> bool {
        self.halves.get(&bin).is_some_and(|cell| cell.1)
    }

    /// Half of each range cell, ascending, and whether it is on a border.
    pub(crate) fn cells(&self) -> impl Iterator<Item = (i64, Half, bool)> {
        self.halves
            .iter()
            .map(|(&bin, &(half, on_border))| (bin, half, on_border))
    }
}
