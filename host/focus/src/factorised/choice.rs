//! Choice of the decimation kernel, pulse blocks and patch sizes for a factorisation.
//!
//! A plan is fast where patches are about as large as their decimated histories permit. Decimation is by two, so this depends on leaf sides, on
//! the factor of the first decimation and on the kernel's band together. The factor of each axis is the one that leaves fewer pulses or
//! samples in the middle of the grid. Kernels that keep the bound are tried with equal leaf sides ([`SIDES`], [`MAP_LEAF_SIDES`]); then the sides of
//! the fastest plan are varied by turns. The search ends at a twentieth of the image's time, so that small images are planned briefly.
//!
//! The time is that of the descent along the path to the centre pixel by the cost model of [`super::cost`]. A descent whose histories alone take
//! longer than the best plan is not evaluated further. First patches are as large as the image, or as scratch memory allows. Shorter blocks of pulses,
//! whose histories are smaller, are used where they are faster. Blocks also end at gaps in the track.

use std::cell::Cell;
use std::ops::{Range, RangeInclusive};

use super::cost::DecimationChain;
use super::decimations::Decimations;
use super::history::Axes;
use super::maps::MapKernels;
use super::patch_view::Patch;
use super::refine::Refiner;
use super::shares::{KernelChoice, map_kernels};
use super::thinned::Stretch;
use super::tree::Tree;
use crate::ImageSpec;
use crate::sub_cpi;

/// Candidate leaf sides, pixels.
const SIDES: [usize; 7] = [16, 20, 24, 32, 40, 48, 64];
/// Candidate leaf sides below patches with maps, pixels; with the levels between they give the sides of these patches.
const MAP_LEAF_SIDES: [usize; 6] = [16, 18, 20, 22, 25, 28];
/// Largest side of a first patch, pixels, so that a tile of a large image does not need the work of a larger patch.
const LARGEST_FIRST: usize = 1024;
/// Minimum pulses of a block shortened for lack of scratch memory.
const SHORTEST: usize = 64;

/// Largest number of turns in which one of the leaf sides is varied.
const MAX_TURNS: usize = 4;
/// Sides of the patch whose history decides the number of decimations, pixels: about those of the smallest leaves and patches with maps of fast plans.
const SAMPLE_SIDE: usize = 32;
const SAMPLE_MAP_SIDE: usize = 64;

/// Largest side of a patch with maps, pixels.
const LARGEST_MAP: usize = 256;
/// Largest side of a first patch above maps, pixels, if the image is twice as large or larger: fewer first patches read the recorded samples.
const LARGEST_MAP_FIRST: usize = 2048;

/// Largest number of levels accepted in a plan.
const MAX_LEVELS: usize = 32;

/// Formation of the image of the smallest patches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Leaves {
    /// Backprojection of each pulse.
    Pulses,
    /// Range-Doppler maps, and backprojection where these do not keep the bound.
    Maps,
}

/// Parameters fixed by a plan; everything else follows from them.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Choices {
    pub(super) error_db: f64,
    /// Kernel of decimations; none if histories are not decimated.
    pub(super) kernel: Option<KernelChoice>,
    /// Number of pulses of each block, in order.
    pub(super) stretches: Vec<usize>,
    pub(super) tree: Tree,
    /// Level of the largest patches imaged by range-Doppler maps.
    #[serde(default)]
    pub(super) map_level: Option<usize>,
}

impl Choices {
    /// Whether a plan for `spec` can contain these parameters.
    pub(super) fn are_of(&self, spec: &ImageSpec) -> bool {
        let sides = [spec.grid.rows.count, spec.grid.columns.count].map(leaf_sides);
        let mut lengths = self.stretches.iter();
        let total = lengths.try_fold(0usize, |sum, count| sum.checked_add(*count));
        let kernel_fits = match self.kernel {
            None => KernelChoice::widest(self.error_db, counts(spec)).is_none(),
            Some(kernel) => kernel.is_within(self.error_db),
        };
        [0, 1].map(|i| sides[i].contains(&self.tree.leaf[i])) == [true; 2]
            && self.tree.levels <= MAX_LEVELS
            && self.map_level.is_none_or(|level| level <= self.tree.levels)
            && !self.stretches.contains(&0)
            && total == Some(spec.collection.pulses.len())
            && kernel_fits
            && (-300.0..=0.0).contains(&self.error_db)
    }

    /// Pulse blocks with their decimations.
    pub(super) fn stretches(&self, spec: &ImageSpec, decimations: &Decimations) -> Vec<Stretch> {
        let mut first = 0;
        let each = self.stretches.iter().map(|count| {
            let pulses = first..first + count;
            first = pulses.end;
            Stretch::new(&spec.collection.pulses, pulses, decimations)
        });
        each.collect()
    }
}

/// Numbers of pulses and samples.
fn counts(spec: &ImageSpec) -> [usize; 2] {
    [spec.collection.pulses.len(), spec.collection.num_samples]
}

/// Valid leaf sides for `count` pixels.
fn leaf_sides(count: usize) -> RangeInclusive<usize> {
    SIDES[0].min(count)..=SIDES[SIDES.len() - 1]
}

/// Fastest parameters for an image, with the computation that they select.
pub(super) struct Chosen<'a> {
    pub(super) choices: Choices,
    pub(super) refiner: Refiner<'a>,
    /// Kernels of range-Doppler maps, where there are maps.
    pub(super) kernels: Option<MapKernels>,
}

impl<'a> Chosen<'a> {
    /// Choose by the cost model. `None` if maps are asked for and do not keep the bound or do not suit the patch in the middle of the grid.
    pub(super) fn of(error_db: f64, leaves: Leaves, spec: &ImageSpec<'a>) -> Option<Self> {
        let maps = match leaves {
            Leaves::Pulses => None,
            Leaves::Maps => Some(map_kernels(error_db)?),
        };
        let mut planning = Planning {
            spec,
            error_db,
            breaks: sub_cpi::breaks(spec.collection),
            maps: maps.as_ref(),
            best: Best::default(),
        };
        let sample = planning.sample(match leaves {
            Leaves::Pulses => SAMPLE_SIDE,
            Leaves::Maps => SAMPLE_MAP_SIDE,
        });
        let kernels = planning.kernels(&sample);
        planning.try_kernels(&kernels, &sample);
        planning.share_by_decimations_made();
        planning.vary_sides();
        let found = match (planning.best.found, leaves) {
            (Some(found), _) => found,
            (None, Leaves::Maps) => return None,
            (None, Leaves::Pulses) => Found {
                time_ns: f64::INFINITY,
                kernel: kernels.first().copied(),
                longest: SHORTEST,
                tree: smallest(spec),
                map_level: None,
            },
        };
        let stretches = planning.blocks(found.longest);
        Some(Self {
            choices: Choices {
                error_db,
                kernel: found.kernel,
                stretches: stretches.iter().map(|range| range.len()).collect(),
                tree: found.tree,
                map_level: found.map_level,
            },
            refiner: planning.refiner(found.kernel),
            kernels: maps,
        })
    }
}

/// Steps of a search for the fastest parameters.
struct Planning<'s, 'a> {
    spec: &'s ImageSpec<'a>,
    error_db: f64,
    /// First pulses after gaps in the track.
    breaks: Vec<usize>,
    maps: Option<&'s MapKernels>,
    best: Best,
}

impl<'s, 'a> Planning<'s, 'a> {
    fn refiner(&self, kernel: Option<KernelChoice>) -> Refiner<'a> {
        Refiner::of(self.spec.collection, self.error_db, kernel)
    }

    /// Blocks of at most `longest` pulses.
    fn blocks(&self, longest: usize) -> Vec<Range<usize>> {
        sub_cpi::cut(self.spec.collection.pulses.len(), &self.breaks, longest)
    }

    /// Patch of this side in the middle of the grid, with the longest block of pulses.
    fn sample(&self, side: usize) -> SamplePatch<'s, 'a> {
        let blocks = self.blocks(self.spec.collection.pulses.len());
        let longest = blocks.into_iter().max_by_key(|block| block.len());
        SamplePatch::new(self.spec, longest.unwrap_or(0..0), side)
    }

    /// Kernels for as many decimations as the patch `sample` has with the widest band.
    fn kernels(&self, sample: &SamplePatch) -> Vec<KernelChoice> {
        let Some(widest) = KernelChoice::widest(self.error_db, counts(self.spec)) else {
            return Vec::new();
        };
        let (_, axes) = sample.history(&self.refiner(Some(widest)));
        KernelChoice::within(self.error_db, axes.made().map(|count| count.max(1)))
    }

    /// The same kernel with the factors of the first decimation that leave the shortest history of the patch `sample`.
    fn with_factors(&self, kernel: KernelChoice, sample: &SamplePatch) -> KernelChoice {
        kernel.beginning_with(sample.factors(&self.refiner(Some(kernel))))
    }

    /// Search with a kernel and blocks of at most `longest` pulses.
    fn search<T>(
        &mut self,
        kernel: Option<KernelChoice>,
        longest: usize,
        search: impl FnOnce(&Search, &mut Best) -> T,
    ) -> T {
        let refiner = self.refiner(kernel);
        let lengths = (longest, &self.blocks(longest)[..]);
        let own = Search::new(self.spec, self.maps, (kernel, &refiner), lengths);
        search(&own, &mut self.best)
    }

    /// Try equal leaf sides with each kernel: with the first one all lengths of blocks, with others the best length so far.
    fn try_kernels(&mut self, kernels: &[KernelChoice], sample: &SamplePatch) {
        // Without a kernel that keeps the bound, histories are not decimated.
        for i in 0..kernels.len().max(1) {
            // Whether maps suit a patch depends on its paths, not on the kernel.
            let unsuited = i > 0 && self.maps.is_some() && self.best.found.is_none();
            if unsuited || self.best.is_good_enough() {
                break;
            }
            let kernel = kernels
                .get(i)
                .map(|&kernel| self.with_factors(kernel, sample));
            if let Some(found) = self.best.found {
                self.search(kernel, found.longest, |search, best| {
                    search.equal_sides(best)
                });
                continue;
            }
            let (mut longest, mut slower) = (self.spec.collection.pulses.len(), 0);
            // Shorter blocks first make room for larger patches; beyond that they only add edges.
            while slower < 2 {
                slower += self.search(kernel, longest, |search, best| {
                    usize::from(!search.equal_sides(best) && search.fits.get())
                });
                if longest <= SHORTEST {
                    break;
                }
                longest = longest.div_ceil(2);
            }
        }
    }

    /// Try kernels for as many decimations as the best plan makes: fewer ones may have larger errors.
    fn share_by_decimations_made(&mut self) {
        let Some(found) = self.best.found else {
            return;
        };
        let Some(kernel) = found.kernel else {
            return;
        };
        let [rows, columns] = found.tree.size(found.map_level.unwrap_or(0));
        let sample = self.sample(rows.max(columns));
        let (_, axes) = sample.history(&self.refiner(Some(kernel)));
        let made = axes.made().map(|count| count.max(1));
        if made == kernel.decimations() {
            return;
        }
        let others = KernelChoice::within(self.error_db, made).into_iter();
        for other in others.filter(|other| other.taps() <= kernel.taps()) {
            let other = self.with_factors(other, &sample);
            self.search(Some(other), found.longest, |search, best| {
                search.improve(found.tree.leaf, best)
            });
        }
    }

    /// Vary the leaf sides of the best plan.
    fn vary_sides(&mut self) {
        if let Some(found) = self.best.found {
            self.search(found.kernel, found.longest, |search, best| {
                search.vary_sides(best);
            });
        }
    }
}

/// Patch in the middle of the grid that represents all in the choice of kernels.
struct SamplePatch<'s, 'a> {
    spec: &'s ImageSpec<'a>,
    /// Longest block of pulses.
    pulses: Range<usize>,
    tree: Tree,
    patch: Patch,
}

impl<'s, 'a> SamplePatch<'s, 'a> {
    fn new(spec: &'s ImageSpec<'a>, pulses: Range<usize>, side: usize) -> Self {
        let counts = [spec.grid.rows.count, spec.grid.columns.count];
        let tree = Tree {
            leaf: counts.map(|count| count.min(side)),
            levels: 0,
        };
        let node = tree.around(0, counts.map(|count| count / 2));
        let rectangle = tree.rectangle(spec.grid, node);
        Self {
            patch: Patch::new(spec.grid, rectangle.expect("the middle of the grid")),
            spec,
            pulses,
            tree,
        }
    }

    /// Block of pulses with its decimations, and axes of the history of the patch.
    fn history(&self, refiner: &Refiner) -> (Stretch, Axes) {
        let pulses = &self.spec.collection.pulses;
        let stretch = Stretch::new(pulses, self.pulses.clone(), refiner.decimations());
        let chain = DecimationChain::new(self.spec, refiner, &stretch, &self.tree, None);
        let axes = *chain.last();
        (stretch, axes)
    }

    /// Factors of the first decimation that leave the shortest history.
    fn factors(&self, refiner: &Refiner) -> [usize; 2] {
        let (stretch, axes) = self.history(refiner);
        refiner.first_factors(&stretch, &axes, &self.patch)
    }
}

/// Tree of leaves only.
fn smallest(spec: &ImageSpec) -> Tree {
    let counts = [spec.grid.rows.count, spec.grid.columns.count];
    Tree {
        leaf: counts.map(|count| count.min(SIDES[3])),
        levels: 0,
    }
}

/// Parameters found by a search.
#[derive(Clone, Copy)]
struct Found {
    time_ns: f64,
    kernel: Option<KernelChoice>,
    /// Pulses of the longest block.
    longest: usize,
    tree: Tree,
    map_level: Option<usize>,
}

/// Time to evaluate a plan, ns, and largest ratio of the time of a search to that of the image.
const EVALUATION_NS: f64 = 2e5;
const EFFORT: f64 = 0.05;

/// Best plan of a search so far, and the number of plans tried.
#[derive(Default)]
struct Best {
    found: Option<Found>,
    tried: usize,
}

impl Best {
    fn time_ns(&self) -> f64 {
        self.found.map_or(f64::INFINITY, |found| found.time_ns)
    }

    /// Whether the search has taken its share of the time of the image.
    fn is_good_enough(&self) -> bool {
        self.tried as f64 * EVALUATION_NS > EFFORT * self.time_ns()
    }
}

/// Search for the fastest leaf sides with a kernel and a length of pulse blocks.
struct Search<'a> {
    spec: &'a ImageSpec<'a>,
    maps: Option<&'a MapKernels>,
    kernel: Option<KernelChoice>,
    refiner: &'a Refiner<'a>,
    longest: usize,
    /// The longest block, which represents all.
    stretch: Stretch,
    /// Number of such blocks.
    num_blocks: f64,
    /// Whether the histories of some leaf sides fit the scratch memory.
    fits: Cell<bool>,
}

impl<'a> Search<'a> {
    fn new(
        spec: &'a ImageSpec<'a>,
        maps: Option<&'a MapKernels>,
        (kernel, refiner): (Option<KernelChoice>, &'a Refiner<'a>),
        (longest, blocks): (usize, &[Range<usize>]),
    ) -> Self {
        let range = blocks.iter().max_by_key(|range| range.len());
        let range = range.cloned().unwrap_or(0..0);
        Self {
            num_blocks: spec.collection.pulses.len() as f64 / range.len().max(1) as f64,
            stretch: Stretch::new(&spec.collection.pulses, range, refiner.decimations()),
            fits: Cell::new(false),
            spec,
            maps,
            kernel,
            refiner,
            longest,
        }
    }

    fn counts(&self) -> [usize; 2] {
        [self.spec.grid.rows.count, self.spec.grid.columns.count]
    }

    fn sides(&self) -> &'static [usize] {
        match self.maps {
            None => &SIDES,
            Some(_) => &MAP_LEAF_SIDES,
        }
    }

    /// Try equal leaf sides. Returns whether one of them is faster than the best so far.
    fn equal_sides(&self, best: &mut Best) -> bool {
        let mut faster = false;
        for &side in self.sides().iter().step_by(2) {
            faster |= self.improve([side; 2], best);
        }
        faster
    }

    /// Vary the leaf's rows and columns by turns while that is faster.
    fn vary_sides(&self, best: &mut Best) {
        for turn in 0..MAX_TURNS {
            let mut faster = false;
            for &side in self.sides() {
                let Some(found) = best.found.filter(|_| !best.is_good_enough()) else {
                    return;
                };
                let mut leaf = found.tree.leaf;
                leaf[turn % 2] = side;
                faster |= leaf != found.tree.leaf && self.improve(leaf, best);
            }
            if turn > 0 && !faster {
                return;
            }
        }
    }

    /// Replace the best plan by the one with this leaf if it is faster.
    fn improve(&self, leaf: [usize; 2], best: &mut Best) -> bool {
        best.tried += 1;
        let leaf = [0, 1].map(|i| leaf[i].min(self.counts()[i]));
        let least_ns = best.time_ns() / self.num_blocks;
        let found = match self.maps {
            None => self.of_pulses(leaf, least_ns),
            Some(kernels) => self.of_maps(leaf, kernels, least_ns),
        };
        let Some((time_ns, tree, map_level)) = found else {
            return false;
        };
        best.found = Some(Found {
            time_ns: self.num_blocks * time_ns,
            kernel: self.kernel,
            longest: self.longest,
            tree,
            map_level,
        });
        true
    }

    /// Largest number of levels above a leaf.
    fn most_levels(&self, leaf: [usize; 2]) -> usize {
        let counts = self.counts();
        let parts = [0, 1].map(|i| counts[i].div_ceil(leaf[i]));
        parts[0].max(parts[1]).next_power_of_two().ilog2() as usize
    }

    /// Tree with leaves of pulses whose histories fit the scratch memory, with its time. `None` if it is not faster than `least_ns`, or if
    /// first patches would have only a few leaves although larger ones would be faster.
    fn of_pulses(&self, leaf: [usize; 2], least_ns: f64) -> Option<(f64, Tree, Option<usize>)> {
        let Self {
            spec,
            refiner,
            stretch,
            ..
        } = self;
        let whole = self.most_levels(leaf);
        for levels in (0..=whole).rev() {
            let tree = Tree { leaf, levels };
            let largest = tree.size(levels).into_iter().max().unwrap_or(0);
            if levels > 0 && largest > LARGEST_FIRST {
                continue;
            }
            let few = levels < whole.min(3);
            if few && refiner.shares().decimate && stretch.pulses.len() > SHORTEST {
                return None;
            }
            let descent = DecimationChain::new(spec, refiner, stretch, &tree, None);
            if descent.held_bytes() > spec.scratch_bytes {
                continue;
            }
            self.fits.set(true);
            if descent.histories_ns() >= least_ns {
                return None;
            }
            let time_ns = descent.time_ns();
            return (time_ns < least_ns).then_some((time_ns, tree, None));
        }
        None
    }

    /// Tree with maps, with its time: the mean of the patches in the middle and in the first corner of the grid. `None` if it is not
    /// faster than `least_ns` or maps do not suit the patch in the middle.
    fn of_maps(
        &self,
        leaf: [usize; 2],
        kernels: &MapKernels,
        mut least_ns: f64,
    ) -> Option<(f64, Tree, Option<usize>)> {
        let Self {
            spec,
            refiner,
            stretch,
            ..
        } = self;
        let counts = self.counts();
        let [image, side] = [counts, leaf].map(|sides| sides[0].max(sides[1]));
        let largest = (image / 2).clamp(LARGEST_FIRST, LARGEST_MAP_FIRST);
        let most = self
            .most_levels(leaf)
            .min((largest / side).ilog2() as usize);
        let fits = |&levels: &usize| {
            let tree = Tree { leaf, levels };
            let descent = DecimationChain::new(spec, refiner, stretch, &tree, None);
            descent.held_bytes() <= spec.scratch_bytes
        };
        let levels = (1..=most).rev().find(fits)?;
        self.fits.set(true);
        let tree = Tree { leaf, levels };
        let middle = counts.map(|count| count / 2);
        let descent =
            |level, pixel| DecimationChain::at(spec, refiner, stretch, &tree, level, pixel);
        // Patches of at most a quarter of the side leave enough of them to share among threads.
        let largest = LARGEST_MAP.min(image / 4);
        let mut best = None;
        for level in (1..=levels).rev().filter(|&level| side << level <= largest) {
            let mut middle = descent(level, middle);
            // Smaller patches have more histories.
            if middle.histories_ns() >= least_ns {
                break;
            }
            if !middle.plan_maps(kernels)
                || middle.held_bytes() + middle.thread_bytes(level) > spec.scratch_bytes
            {
                continue;
            }
            let middle_ns = middle.time_ns();
            let time_ns = match middle_ns < least_ns {
                false => f64::INFINITY,
                true => {
                    let mut corner = descent(level, [0, 0]);
                    match corner.plan_maps(kernels) {
                        true => 0.5 * (middle_ns + corner.time_ns()),
                        // Smaller patches in the corner.
                        false => 1.5 * middle_ns,
                    }
                }
            };
            if time_ns < least_ns {
                least_ns = time_ns;
                best = Some((time_ns, tree, Some(level)));
            } else if best.is_some() {
                break;
            }
        }
        best
    }
}
