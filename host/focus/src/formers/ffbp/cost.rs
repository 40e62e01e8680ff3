//! What factorisation takes: of each patch on the way down to the pixel in the middle, as often as there are such patches.
//!
//! ```text
//! a patch's history, of N pulses and K samples before and N', K' after, with W taps:
//!     a sample before: turned 18
//!     if halved over pulses: (4 W + 2) N' K;   over samples: (4 W + 2) N' K'
//! a leaf: a pulse a transform of its profile of L bins, of each piece 72, and as in backprojection 35 a pixel
//! ```
//!
//! First patches read all pulses once each. A tile takes what its first patches take: nothing is shared.
//!
//! **Times** are of one core, by the time model.

use super::descent::task_level;
use super::history::Axes;
use super::leaf::{LEAVES, SUMMED_PULSES, points_layout, tile_layout};
use super::patch_view::Patch;
use super::refine::{HISTORIES, Refiner};
use super::shares::DEGREE;
use super::thinned::Stretch;
use super::tree::Tree;
use crate::Aim;
use crate::cost::{Cost, Each, StageCost, transform};
use crate::path_tile::raster;
use subaperture_kernels::lanes::GROUP;
use subaperture_kernels::tile::Pieces;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::range_profile::RangeProfiler;

/// Operations to turn a sample.
const TURN: f64 = 18.0;
/// Operations a piece of a profile.
const PIECE: f64 = 72.0;
/// Operations a pixel and pulse of a leaf.
const PIXEL_AND_PULSE: f64 = 35.0;

/// A history made.
struct Step {
    level: usize,
    before: Axes,
    after: Axes,
}

/// The way down to a leaf.
pub(super) struct Way<'a> {
    aim: &'a Aim<'a>,
    refiner: &'a Refiner<'a>,
    stretch: &'a Stretch,
    tree: &'a Tree,
    steps: Vec<Step>,
    /// The leaf's.
    last: Axes,
    /// Whether that is its own.
    own: bool,
}

impl<'a> Way<'a> {
    pub(super) fn new(
        aim: &'a Aim<'a>,
        refiner: &'a Refiner<'a>,
        stretch: &'a Stretch,
        tree: &'a Tree,
    ) -> Self {
        let taps = refiner.taps().len();
        let middle = [aim.grid.rows.count / 2, aim.grid.columns.count / 2];
        let mut axes = refiner.recorded();
        let mut steps = Vec::new();
        let mut own = false;
        for level in (0..=tree.levels).rev() {
            let node = tree.around(level, middle);
            let Some(rectangle) = tree.rectangle(aim.grid, node) else {
                continue;
            };
            let patch = Patch::new(aim.grid, rectangle);
            own = false;
            loop {
                let halves = refiner.halves(stretch, &axes, &patch);
                let first = steps.is_empty();
                if halves == [false; 2] && !first {
                    break;
                }
                let before = axes;
                axes = axes.after(halves, taps);
                steps.push(Step {
                    level,
                    before,
                    after: axes,
                });
                own = true;
                // First patches go on as long as they can.
                if level < tree.levels {
                    break;
                }
            }
        }
        Self {
            aim,
            refiner,
            stretch,
            tree,
            steps,
            last: axes,
            own,
        }
    }

    /// Bytes of all histories of the way down that are held at once, of the first patch for which they are most.
    pub(super) fn held_bytes(&self) -> u64 {
        let (grid, taps) = (self.aim.grid, self.refiner.taps().len());
        let recorded = self.refiner.recorded();
        let firsts = self.tree.roots(grid).into_iter().map(|node| {
            let rectangle = self
                .tree
                .rectangle(grid, node)
                .expect("a first patch has pixels");
            let patch = Patch::new(grid, rectangle);
            let halves = self.refiner.halves(self.stretch, &recorded, &patch);
            recorded.after(halves, taps).bytes(self.stretch)
        });
        let rest = self
            .steps
            .iter()
            .skip(1)
            .map(|step| step.after.bytes(self.stretch));
        firsts.max().unwrap_or(0) + rest.sum::<u64>()
    }

    fn pulses(&self, axes: &Axes) -> f64 {
        self.stretch.thinned[axes.thinning].antennas.len() as f64
    }

    /// How many patches there are of a level.
    fn patches(&self, level: usize) -> f64 {
        let grid = self.aim.grid;
        let [rows, columns] = self.tree.size(level);
        (grid.rows.count.div_ceil(rows) * grid.columns.count.div_ceil(columns)) as f64
    }

    /// Of all patches: what `of` says of a step, by samples before, those between (half the pulses), those after, pulses before.
    fn over_steps(&self, of: impl Fn([f64; 4]) -> f64) -> f64 {
        let each = self.steps.iter().map(|step| {
            let Step {
                level,
                before,
                after,
            } = step;
            let [old, new] = [before, after].map(|axes| self.pulses(axes));
            let [k, k_new] = [before, after].map(|axes| axes.num_samples as f64);
            let over_pulses = if after.thinning > before.thinning {
                new * k
            } else {
                0.0
            };
            let over_samples = if after.num_samples != before.num_samples {
                new * k_new
            } else {
                0.0
            };
            self.patches(*level) * of([old * k, over_pulses, over_samples, old])
        });
        each.sum()
    }

    /// Bins of a leaf's profile, pieces of it, and groups and pixels of a leaf.
    fn leaf(&self) -> [f64; 4] {
        let [rows, columns] = self.tree.leaf;
        let axes = &self.last;
        let length =
            RangeProfiler::length_for(axes.num_samples, self.refiner.shares().oversampling());
        let node = self.tree.around(0, [0, 0]);
        let rectangle = self
            .tree
            .rectangle(self.aim.grid, node)
            .expect("a leaf has pixels");
        let bins_m = axes.step_hz.abs() / SPEED_OF_LIGHT_M_S * length as f64;
        let margin = Pieces::margin_for(&raster(self.aim.grid, &rectangle), bins_m);
        let layout = match self.aim.grid.relief {
            None => tile_layout(length, self.own, margin),
            Some(_) => None,
        };
        let layout = layout.unwrap_or_else(|| points_layout(length));
        // Along whichever side fits better.
        let along = |a: usize, b: usize| (a.div_ceil(GROUP) * b) as f64;
        let groups = along(rows, columns).min(along(columns, rows));
        [
            length as f64,
            layout.row() as f64,
            groups,
            (rows * columns) as f64,
        ]
    }

    /// Nanoseconds of one core for the stretch.
    pub(super) fn time_ns(&self) -> f64 {
        self.histories_ns() + self.leaves_ns()
    }

    fn histories_ns(&self) -> f64 {
        let model = self.aim.means.model;
        let taps = self.refiner.taps().len() as f64 + 1.0;
        self.over_steps(|[before, over_pulses, over_samples, pulses]| {
            let sums_ns = over_pulses * model.pulse_tap_ns + over_samples * model.sample_tap_ns;
            model.patch_ns
                + pulses * model.history_pulse_ns
                + before * model.turn_ns
                + taps * sums_ns
        })
    }

    fn leaves_ns(&self) -> f64 {
        let model = self.aim.means.model;
        let [length, pieces, groups, pixels] = self.leaf();
        let imaged_ns = match self.aim.grid.relief {
            None => model.leaf_group_ns * groups,
            Some(_) => model.point_ns * pixels,
        };
        let pulse = model.leaf_pulse_ns
            + model.transform(length)
            + model.leaf_piece_ns * pieces
            + imaged_ns;
        self.patches(0) * self.pulses(&self.last) * pulse
    }

    /// Operations for the stretch, of histories and of leaves.
    fn operations(&self) -> [f64; 2] {
        let taps = 4.0 * self.refiner.taps().len() as f64 + 2.0;
        let steps = self.over_steps(|[before, over_pulses, over_samples, _]| {
            before * TURN + taps * (over_pulses + over_samples)
        });
        let [length, pieces, _, pixels] = self.leaf();
        let pulse = transform(length) + PIECE * pieces + PIXEL_AND_PULSE * pixels;
        [steps, self.patches(0) * self.pulses(&self.last) * pulse]
    }

    /// Bytes of a thread that takes a patch of this level by itself.
    pub(super) fn thread_bytes(&self, level: usize) -> u64 {
        2 * self.bytes_at(level) + self.leaf_bytes()
    }

    /// Bytes of the history of a patch of this level.
    fn bytes_at(&self, level: usize) -> u64 {
        let step = self.steps.iter().rev().find(|step| step.level >= level);
        step.map_or(0, |step| step.after.bytes(self.stretch))
    }

    /// Bytes of a thread's leaf.
    fn leaf_bytes(&self) -> u64 {
        let [length, pieces, _, pixels] = self.leaf();
        let pieces = SUMMED_PULSES as f64 * pieces * 8.0 * (DEGREE as f64 + 1.0);
        (pieces + 24.0 * length + 40.0 * pixels) as u64
    }
}

/// The ways through all stretches.
pub(super) fn ways<'a>(
    aim: &'a Aim<'a>,
    refiner: &'a Refiner<'a>,
    stretches: &'a [Stretch],
    tree: &'a Tree,
) -> Vec<Way<'a>> {
    let each = stretches.iter();
    each.map(|stretch| Way::new(aim, refiner, stretch, tree))
        .collect()
}

/// Bytes that forming takes.
pub(super) struct Demand {
    /// Histories on the way to where threads go on by themselves.
    pub(super) held_bytes: u64,
    /// Of each thread.
    pub(super) thread_bytes: u64,
}

/// What the most demanding of these ways takes.
pub(super) fn demand(ways: &[Way]) -> Demand {
    let most = |of: fn(&Way) -> u64| ways.iter().map(of).max().unwrap_or(0);
    Demand {
        held_bytes: most(|way| way.held_bytes()),
        thread_bytes: most(|way| way.thread_bytes(task_level(way.tree))),
    }
}

/// Of all of these ways.
pub(super) fn cost(ways: &[Way], refiner: &Refiner) -> Cost {
    let (mut operations, mut times_ns) = ([0.0; 2], [0.0; 2]);
    for way in ways {
        let own = (way.operations(), [way.histories_ns(), way.leaves_ns()]);
        for stage in [0, 1] {
            operations[stage] += own.0[stage];
            times_ns[stage] += own.1[stage];
        }
    }
    let demand = demand(ways);
    let pulses = demand.held_bytes + refiner.read_bytes(1);
    let stages = [HISTORIES, LEAVES]
        .into_iter()
        .zip(operations)
        .zip(times_ns);
    Cost::of(stages.map(|((name, operations), ns)| StageCost::new(name, operations, ns)))
        .holding("pulses", Each::Pass, pulses as f64)
        .holding("patches' pulses", Each::Thread, demand.thread_bytes as f64)
}
