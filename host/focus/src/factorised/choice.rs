//! Choice of pulse blocks and patch sizes for a factorisation.
//!
//! All leaf sides in [`SIDES`] are tried in both directions; the fastest descent by the cost model of [`super::cost`] along the
//! path to the centre pixel is selected. First patches are as large as the image, or as scratch memory allows. Shorter blocks of pulses, whose
//! histories are smaller, are used where they are faster. Blocks also end at gaps in the track.

use std::ops::{Range, RangeInclusive};

use super::cost::DecimationChain;
use super::maps::MapKernels;
use super::refine::Refiner;
use super::thinned::Stretch;
use super::tree::Tree;
use crate::ImageSpec;
use crate::sub_cpi;

/// Candidate leaf sides, pixels.
const SIDES: [usize; 5] = [16, 24, 32, 48, 64];
/// Largest side of a first patch, pixels, so that a tile of a large image does not need the work of a larger patch.
const LARGEST_FIRST: usize = 1024;
/// Minimum pulses of a block shortened for lack of scratch memory.
const SHORTEST: usize = 64;

/// Largest number of levels accepted in a plan.
const MAX_LEVELS: usize = 32;

/// Parameters fixed by a plan; everything else follows from them.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Choices {
    pub(super) error_db: f64,
    /// Number of pulses of each block, in order.
    pub(super) stretches: Vec<usize>,
    pub(super) tree: Tree,
    /// Level of the largest patches imaged by range-Doppler maps.
    #[serde(default)]
    pub(super) map_level: Option<usize>,
}

impl Choices {
    /// Choose the fastest parameters by the cost model, with the bound shared out by `refiner`.
    /// With `kernels`, patches are imaged by range-Doppler maps; `None` if they do not suit the patch in the middle.
    pub(super) fn of(
        error_db: f64,
        spec: &ImageSpec,
        refiner: &Refiner,
        kernels: Option<&MapKernels>,
    ) -> Option<Self> {
        let num_pulses = spec.collection.pulses.len();
        let breaks = sub_cpi::breaks(spec.collection);
        let choices = |stretches: &[Range<usize>], (tree, map_level)| Self {
            error_db,
            stretches: stretches.iter().map(|range| range.len()).collect(),
            tree,
            map_level,
        };
        let mut best: Option<(f64, Self)> = None;
        let mut longest = num_pulses;
        loop {
            let stretches = sub_cpi::cut(num_pulses, &breaks, longest);
            // The longest block represents all.
            let range = stretches.iter().max_by_key(|range| range.len());
            let range = range.cloned().unwrap_or(0..0);
            let share = num_pulses as f64 / range.len().max(1) as f64;
            let stretch = Stretch::new(&spec.collection.pulses, range, refiner.taps());
            let found = match kernels {
                None => fastest(spec, refiner, &stretch).map(|(ns, tree)| (ns, (tree, None))),
                Some(kernels) => fastest_maps(spec, refiner, &stretch, kernels),
            };
            let found = found.map(|(time_ns, own)| (share * time_ns, own));
            match (found, &best) {
                (Some((time_ns, own)), None) => best = Some((time_ns, choices(&stretches, own))),
                (Some((time_ns, own)), Some((least_ns, _))) if time_ns < *least_ns => {
                    best = Some((time_ns, choices(&stretches, own)));
                }
                // Shorter blocks first make room for larger patches; beyond that they only add edges.
                (_, Some(_)) => break,
                (None, None) => {}
            }
            if longest <= SHORTEST {
                break;
            }
            longest = longest.div_ceil(2);
        }
        match (best, kernels) {
            (Some((_, choices)), _) => Some(choices),
            (None, Some(_)) => None,
            (None, None) => {
                let stretches = sub_cpi::cut(num_pulses, &breaks, longest);
                Some(choices(&stretches, (smallest(spec), None)))
            }
        }
    }

    /// Whether a plan for `spec` can contain these parameters.
    pub(super) fn are_of(&self, spec: &ImageSpec) -> bool {
        let sides = [spec.grid.rows.count, spec.grid.columns.count].map(leaf_sides);
        let mut counts = self.stretches.iter();
        let total = counts.try_fold(0usize, |sum, count| sum.checked_add(*count));
        [0, 1].map(|i| sides[i].contains(&self.tree.leaf[i])) == [true; 2]
            && self.tree.levels <= MAX_LEVELS
            && self.map_level.is_none_or(|level| level <= self.tree.levels)
            && !self.stretches.contains(&0)
            && total == Some(spec.collection.pulses.len())
            && (-300.0..=0.0).contains(&self.error_db)
    }

    /// Pulse blocks, decimated with the filter `taps`.
    pub(super) fn stretches(&self, spec: &ImageSpec, taps: &[f32]) -> Vec<Stretch> {
        let mut first = 0;
        let each = self.stretches.iter().map(|count| {
            let pulses = first..first + count;
            first = pulses.end;
            Stretch::new(&spec.collection.pulses, pulses, taps)
        });
        each.collect()
    }
}

/// Valid leaf sides for `count` pixels.
fn leaf_sides(count: usize) -> RangeInclusive<usize> {
    SIDES[0].min(count)..=SIDES[SIDES.len() - 1]
}

/// Candidate leaf sides for `count` pixels.
fn sides(count: usize) -> Vec<usize> {
    let mut sides: Vec<usize> = SIDES.iter().map(|&side| side.min(count)).collect();
    sides.dedup();
    sides
}

/// Tree of leaves only.
fn smallest(spec: &ImageSpec) -> Tree {
    let counts = [spec.grid.rows.count, spec.grid.columns.count];
    Tree {
        leaf: counts.map(|count| count.min(SIDES[2])),
        levels: 0,
    }
}

/// Fastest tree with histories that fit the scratch memory, and its time. `None` if first patches would have only a few leaves although
/// larger ones would be faster.
fn fastest(spec: &ImageSpec, refiner: &Refiner, stretch: &Stretch) -> Option<(f64, Tree)> {
    let counts = [spec.grid.rows.count, spec.grid.columns.count];
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
                let descent = DecimationChain::new(spec, refiner, stretch, &tree, None);
                let few = levels < whole.min(3);
                if few && refiner.shares().decimate && stretch.pulses.len() > SHORTEST {
                    break;
                }
                if descent.held_bytes() > spec.scratch_bytes {
                    continue;
                }
                let time_ns = descent.time_ns();
                if best.is_none_or(|(least, _)| time_ns < least) {
                    best = Some((time_ns, tree));
                }
                break;
            }
        }
    }
    best
}

/// Leaf sides below patches with maps, pixels; with the levels between they give the sides of these patches.
const MAP_LEAF_SIDES: [usize; 3] = [16, 20, 28];
/// Largest side of a patch with maps, pixels.
const LARGEST_MAP: usize = 256;
/// Largest side of a first patch above maps, pixels, if the image is twice as large or larger: fewer first patches read the recorded samples.
const LARGEST_MAP_FIRST: usize = 2048;

/// Fastest tree with maps, its largest level with maps, and its time: the mean of the patches in the middle and in the first corner of the
/// grid. `None` if maps do not suit the patch in the middle.
fn fastest_maps(
    spec: &ImageSpec,
    refiner: &Refiner,
    stretch: &Stretch,
    kernels: &MapKernels,
) -> Option<(f64, (Tree, Option<usize>))> {
    let counts = [spec.grid.rows.count, spec.grid.columns.count];
    let mut best: Option<(f64, (Tree, Option<usize>))> = None;
    for side in MAP_LEAF_SIDES {
        let leaf = counts.map(|count| side.min(count));
        let parts = [0, 1].map(|i| counts[i].div_ceil(leaf[i]));
        let whole = parts[0].max(parts[1]).next_power_of_two().ilog2() as usize;
        let largest = (counts[0].max(counts[1]) / 2).clamp(LARGEST_FIRST, LARGEST_MAP_FIRST);
        let most = whole.min((largest / side).ilog2() as usize);
        let tree = |levels| Tree { leaf, levels };
        let fits = |&levels: &usize| {
            let tree = tree(levels);
            let descent = DecimationChain::new(spec, refiner, stretch, &tree, None);
            descent.held_bytes() <= spec.scratch_bytes
        };
        let Some(levels) = (1..=most).rev().find(fits) else {
            continue;
        };
        let tree = tree(levels);
        // Patches of at most a quarter of the side leave enough of them to share among threads.
        let largest = LARGEST_MAP.min(counts[0].max(counts[1]) / 4);
        for map_level in (1..=levels).filter(|&level| side << level <= largest) {
            let maps = Some((map_level, kernels));
            let descent = DecimationChain::new(spec, refiner, stretch, &tree, maps);
            let bytes = descent.held_bytes() + descent.thread_bytes(map_level);
            if !descent.has_maps() || bytes > spec.scratch_bytes {
                continue;
            }
            let middle_ns = descent.time_ns();
            if best.is_some_and(|(least, _)| middle_ns >= 2.0 * least) {
                continue;
            }
            let corner = DecimationChain::at(spec, refiner, stretch, &tree, maps, [0, 0]);
            let corner_ns = match corner.has_maps() {
                true => corner.time_ns(),
                // Smaller patches.
                false => 2.0 * middle_ns,
            };
            let time_ns = 0.5 * (middle_ns + corner_ns);
            if best.is_none_or(|(least, _)| time_ns < least) {
                best = Some((time_ns, (tree, Some(map_level))));
            }
        }
    }
    best
}
