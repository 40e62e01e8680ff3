//! What a plan fixes: stretches of pulses, and how the grid is cut.
//!
//! Of leaves of all [`SIDES`], in both directions, that is taken which makes the way down the fastest, by the account of [`super::cost`] on the
//! way to the pixel in the middle. First patches are as large as the image, or as the scratch allows; where shorter stretches of pulses, whose
//! histories are smaller, are faster, they are taken. Stretches are cut where antennas jump, too.

use std::ops::{Range, RangeInclusive};

use super::cost::Way;
use super::refine::Refiner;
use super::thinned::Stretch;
use super::tree::Tree;
use crate::Aim;
use crate::sub_cpi;

/// Sides of leaves, pixels.
const SIDES: [usize; 5] = [16, 24, 32, 48, 64];
/// Pixels a side of first patches at most, so that tiles of a large image need no larger patch's work.
const LARGEST_FIRST: usize = 1024;
/// Pulses that a stretch has at least, if it is short for want of scratch.
const SHORTEST: usize = 64;

/// Most levels that a plan may ask for.
const MOST_LEVELS: usize = 32;

/// What a plan fixes: the rest follows from it.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Choices {
    pub(super) error_db: f64,
    /// Pulses of each stretch, one after another.
    pub(super) stretches: Vec<usize>,
    pub(super) tree: Tree,
}

impl Choices {
    /// The fastest, by the account of time, of a bound that `refiner` shares out.
    pub(super) fn of(error_db: f64, aim: &Aim, refiner: &Refiner) -> Self {
        let num_pulses = aim.collection.pulses.len();
        let breaks = sub_cpi::breaks(aim.collection);
        let choices = |stretches: &[Range<usize>], tree| Self {
            error_db,
            stretches: stretches.iter().map(|range| range.len()).collect(),
            tree,
        };
        let mut best: Option<(f64, Self)> = None;
        let mut longest = num_pulses;
        loop {
            let stretches = sub_cpi::cut(num_pulses, &breaks, longest);
            // The longest stands for all.
            let range = stretches.iter().max_by_key(|range| range.len());
            let range = range.cloned().unwrap_or(0..0);
            let share = num_pulses as f64 / range.len().max(1) as f64;
            let stretch = Stretch::new(&aim.collection.pulses, range, refiner.taps());
            let found = fastest(aim, refiner, &stretch);
            let found = found.map(|(time_ns, tree)| (share * time_ns, tree));
            match (found, &best) {
                (Some((time_ns, tree)), None) => best = Some((time_ns, choices(&stretches, tree))),
                (Some((time_ns, tree)), Some((least_ns, _))) if time_ns < *least_ns => {
                    best = Some((time_ns, choices(&stretches, tree)));
                }
                // Shorter ones first make room for larger patches, then only for more ends.
                (_, Some(_)) => break,
                (None, None) => {}
            }
            if longest <= SHORTEST {
                break;
            }
            longest = longest.div_ceil(2);
        }
        best.map_or_else(
            || choices(&sub_cpi::cut(num_pulses, &breaks, longest), smallest(aim)),
            |(_, choices)| choices,
        )
    }

    /// Whether a plan may have made them for `aim`.
    pub(super) fn are_of(&self, aim: &Aim) -> bool {
        let sides = [aim.grid.rows.count, aim.grid.columns.count].map(leaf_sides);
        let mut counts = self.stretches.iter();
        let total = counts.try_fold(0usize, |sum, count| sum.checked_add(*count));
        [0, 1].map(|i| sides[i].contains(&self.tree.leaf[i])) == [true; 2]
            && self.tree.levels <= MOST_LEVELS
            && !self.stretches.contains(&0)
            && total == Some(aim.collection.pulses.len())
            && (-300.0..=0.0).contains(&self.error_db)
    }

    /// The stretches, halved by `taps`.
    pub(super) fn stretches(&self, aim: &Aim, taps: &[f32]) -> Vec<Stretch> {
        let mut first = 0;
        let each = self.stretches.iter().map(|count| {
            let pulses = first..first + count;
            first = pulses.end;
            Stretch::new(&aim.collection.pulses, pulses, taps)
        });
        each.collect()
    }
}

/// The sides that leaves may have along `count` pixels, from the least to the largest.
fn leaf_sides(count: usize) -> RangeInclusive<usize> {
    SIDES[0].min(count)..=SIDES[SIDES.len() - 1]
}

/// Those that are tried.
fn sides(count: usize) -> Vec<usize> {
    let mut sides: Vec<usize> = SIDES.iter().map(|&side| side.min(count)).collect();
    sides.dedup();
    sides
}

/// Leaves alone.
fn smallest(aim: &Aim) -> Tree {
    let counts = [aim.grid.rows.count, aim.grid.columns.count];
    Tree {
        leaf: counts.map(|count| count.min(SIDES[2])),
        levels: 0,
    }
}

/// The fastest tree whose histories fit into the scratch, and its time; none if that leaves first patches of a few leaves, where
/// larger ones would be of use.
fn fastest(aim: &Aim, refiner: &Refiner, stretch: &Stretch) -> Option<(f64, Tree)> {
    let counts = [aim.grid.rows.count, aim.grid.columns.count];
    let mut best: Option<(f64, Tree)> = None;
    for rows in sides(counts[0]) {
        for columns in sides(counts[1]) {
            let leaf = [rows, columns];
            let parts = [0, 1].map(|i| counts[i].div_ceil(leaf[i]));
            let whole = parts[0].max(parts[1]).next_power_of_two().ilog2() as usize;
            for levels in (0..=whole).rev() {
                let tree = Tree { leaf, levels };
                let largest = tree.size(levels).into_iter().max().unwrap_or(0);
                if levels > 0 && largest > LARGEST_FIRST {
                    continue;
                }
                let way = Way::new(aim, refiner, stretch, &tree);
                let few = levels < whole.min(3);
                if few && refiner.shares().decimate && stretch.pulses.len() > SHORTEST {
                    break;
                }
                if way.held_bytes() > aim.scratch_bytes {
                    continue;
                }
                let time_ns = way.time_ns();
                if best.is_none_or(|(least, _)| time_ns < least) {
                    best = Some((time_ns, tree));
                }
                break;
            }
        }
    }
    best
}
