//! Cost of the factorisation: each patch on the path down to the centre pixel, times the number of such patches.
//!
//! ```text
//! a patch's history, of N pulses and K samples before and N', K' after, with W taps:
//!     phase rotation of a sample before: 18
//!     if decimated by M over pulses: (4 (M - 1) W + 4) N' K;   over samples: (4 (M - 1) W + 4) N' K'
//! a leaf: a pulse a transform of its profile of L bins, of each piece 72, and as in backprojection 35 a pixel
//! ```
//!
//! Each first patch reads all pulses once. The cost of a tile is that of its first patches; tiles share no work.
//!
//! **Times** are single-core times by the timing model.

use super::history::Axes;
use super::leaf::{LEAVES, SUMMED_PULSES, points_layout, tile_layout};
use super::maps::{MAPS, MapKernels, MapPatch, MapScratch, MapSize};
use super::patch_view::{Patch, path_m};
use super::refine::{HISTORIES, Refiner};
use super::shares::DEGREE;
use super::thinned::Stretch;
use super::tree::Tree;
use crate::cost::{Copies, Cost, StageCost, transform};
use crate::path_tile::raster;
use crate::{ImageSpec, TimeModel};
use subaperture_kernels::lanes::GROUP;
use subaperture_kernels::patch_map::{DOPPLER_TAPS, TAPS};
use subaperture_kernels::rank_two::POINTS;
use subaperture_kernels::tile::Pieces;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::range_profile::RangeProfiler;

/// Operations of the phase rotation of a sample.
const TURN: f64 = 18.0;
/// Operations per interval of a profile.
const PIECE: f64 = 72.0;
/// Operations per pixel and pulse of a leaf.
const PIXEL_AND_PULSE: f64 = 35.0;

/// Computation of one patch history.
struct Step {
    level: usize,
    before: Axes,
    after: Axes,
}

/// Sequence of patch histories from the recording down to one leaf.
pub(super) struct DecimationChain<'a> {
    spec: &'a ImageSpec<'a>,
    refiner: &'a Refiner<'a>,
    stretch: &'a Stretch,
    tree: &'a Tree,
    steps: Vec<Step>,
    /// Axes of the leaf's history.
    last: Axes,
    /// Whether the leaf has its own history.
    own: bool,
    /// Lowest level of the descent, and the pixel to which it leads.
    lowest: usize,
    pixel: [usize; 2],
    /// Maps of the patch of the lowest level.
    maps: Option<Vec<MapSize>>,
}

impl<'a> DecimationChain<'a> {
    /// Descent to the middle of the grid, to maps of patches of the given level if there are `maps`.
    pub(super) fn new(
        spec: &'a ImageSpec<'a>,
        refiner: &'a Refiner<'a>,
        stretch: &'a Stretch,
        tree: &'a Tree,
        maps: Option<(usize, &MapKernels)>,
    ) -> Self {
        let middle = [spec.grid.rows.count / 2, spec.grid.columns.count / 2];
        let lowest = maps.map_or(0, |(level, _)| level);
        let mut descent = Self::at(spec, refiner, stretch, tree, lowest, middle);
        if let Some((_, kernels)) = maps {
            descent.plan_maps(kernels);
        }
        descent
    }

    /// Descent to the patch of the `lowest` level that contains `pixel`.
    pub(super) fn at(
        spec: &'a ImageSpec<'a>,
        refiner: &'a Refiner<'a>,
        stretch: &'a Stretch,
        tree: &'a Tree,
        lowest: usize,
        pixel: [usize; 2],
    ) -> Self {
        let taps = refiner.taps();
        let mut axes = refiner.recorded();
        let mut steps = Vec::new();
        let mut own = false;
        for level in (lowest..=tree.levels).rev() {
            let node = tree.around(level, pixel);
            let Some(rectangle) = tree.rectangle(spec.grid, node) else {
                continue;
            };
            let patch = Patch::new(spec.grid, rectangle);
            own = false;
            loop {
                let decimates = refiner.decimates(stretch, &axes, &patch);
                let first = steps.is_empty();
                if decimates == [false; 2] && !first {
                    break;
                }
                let before = axes;
                axes = axes.after(decimates, taps);
                steps.push(Step {
                    level,
                    before,
                    after: axes,
                });
                own = true;
                // First patches are refined as long as possible.
                if level < tree.levels {
                    break;
                }
            }
        }
        Self {
            spec,
            refiner,
            stretch,
            tree,
            steps,
            last: axes,
            own,
            lowest,
            pixel,
            maps: None,
        }
    }

    /// Plan maps of the patch of the lowest level. Returns whether maps suit it.
    pub(super) fn plan_maps(&mut self, kernels: &MapKernels) -> bool {
        let (spec, axes) = (self.spec, &self.last);
        let node = self.tree.around(self.lowest, self.pixel);
        self.maps = self.tree.rectangle(spec.grid, node).and_then(|rectangle| {
            let thinned = &self.stretch.thinned[axes.thinning];
            let centre = rectangle.centre_m(spec.grid);
            let each = thinned.antennas.iter();
            let patch = MapPatch {
                grid: spec.grid,
                rectangle,
                axes,
                thinned,
                data_m: &each.map(|own| path_m(own, centre)).collect::<Vec<f64>>(),
            };
            MapScratch::default().sizes(&patch, kernels)
        });
        self.has_maps()
    }

    /// Whether the patch is imaged by maps.
    pub(super) fn has_maps(&self) -> bool {
        self.maps.is_some()
    }

    /// Axes of the last history.
    pub(super) fn last(&self) -> &Axes {
        &self.last
    }

    /// Memory of all histories held at once along the descent, bytes, for the first patch with the largest demand.
    pub(super) fn held_bytes(&self) -> u64 {
        let (grid, taps) = (self.spec.grid, self.refiner.taps());
        let recorded = self.refiner.recorded();
        let roots = self.tree.roots(grid);
        let every = roots.len().div_ceil(MAX_FIRSTS).max(1);
        let firsts = roots.into_iter().step_by(every).map(|node| {
            let rectangle = self
                .tree
                .rectangle(grid, node)
                .expect("a first patch has pixels");
            let patch = Patch::new(grid, rectangle);
            let decimates = self.refiner.decimates(self.stretch, &recorded, &patch);
            recorded.after(decimates, taps).bytes(self.stretch)
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

    /// Number of patches of a level.
    fn patches(&self, level: usize) -> f64 {
        let grid = self.spec.grid;
        let [rows, columns] = self.tree.size(level);
        (grid.rows.count.div_ceil(rows) * grid.columns.count.div_ceil(columns)) as f64
    }

    /// Sum of `of` over the steps of all patches. Its arguments are samples before, taps of sums over pulses, taps of sums over samples, and
    /// pulses before.
    fn over_steps(&self, of: impl Fn([f64; 4]) -> f64) -> f64 {
        let decimations = self.refiner.decimations();
        let taps = |factor: usize| ((factor - 1) * decimations.num_taps() + 1) as f64;
        let each = self.steps.iter().map(|step| {
            let Step {
                level,
                before,
                after,
            } = step;
            let [old, new] = [before, after].map(|axes| self.pulses(axes));
            let [k, k_new] = [before, after].map(|axes| axes.num_samples as f64);
            let over_pulses = if after.thinning > before.thinning {
                taps(decimations.factor(0, before.thinning)) * new * k
            } else {
                0.0
            };
            let over_samples = if after.num_samples != before.num_samples {
                taps(before.factor) * new * k_new
            } else {
                0.0
            };
            self.patches(*level) * of([old * k, over_pulses, over_samples, old])
        });
        each.sum()
    }

    /// Profile bins, profile intervals, pixel groups and pixels of a leaf.
    fn leaf(&self) -> [f64; 4] {
        let [rows, columns] = self.tree.leaf;
        let axes = &self.last;
        let length =
            RangeProfiler::length_for(axes.num_samples, self.refiner.shares().oversampling());
        let node = self.tree.around(0, [0, 0]);
        let rectangle = self
            .tree
            .rectangle(self.spec.grid, node)
            .expect("a leaf has pixels");
        let bins_m = axes.step_hz.abs() / SPEED_OF_LIGHT_M_S * length as f64;
        let margin = Pieces::margin_for(&raster(self.spec.grid, &rectangle), bins_m);
        let layout = match self.spec.grid.relief {
            None => tile_layout(length, self.own, margin),
            Some(_) => None,
        };
        let layout = layout.unwrap_or_else(|| points_layout(length));
        // Groups are laid along the side that fits better.
        let along = |a: usize, b: usize| (a.div_ceil(GROUP) * b) as f64;
        let groups = along(rows, columns).min(along(columns, rows));
        [
            length as f64,
            layout.row() as f64,
            groups,
            (rows * columns) as f64,
        ]
    }

    /// Single-core time for the block of pulses, ns.
    pub(super) fn time_ns(&self) -> f64 {
        self.histories_ns() + self.leaves_ns()
    }

    /// Single-core time of all histories, ns.
    pub(super) fn histories_ns(&self) -> f64 {
        let model = self.spec.numerics.model;
        self.over_steps(|[before, over_pulses, over_samples, pulses]| {
            model.patch_ns
                + pulses * model.history_pulse_ns
                + before * model.turn_ns
                + over_pulses * model.pulse_tap_ns
                + over_samples * model.sample_tap_ns
        })
    }

    fn leaves_ns(&self) -> f64 {
        let model = self.spec.numerics.model;
        if let Some(maps) = &self.maps {
            let samples = self.last.num_samples as f64;
            let maps = maps.iter().map(|map| map.time_ns(model, samples));
            return self.patches(self.lowest) * maps.sum::<f64>();
        }
        let [length, pieces, groups, pixels] = self.leaf();
        let imaged_ns = match self.spec.grid.relief {
            None => model.leaf_group_ns * groups,
            Some(_) => model.point_ns * pixels,
        };
        let pulse = model.leaf_pulse_ns
            + model.transform(length)
            + model.leaf_piece_ns * pieces
            + imaged_ns;
        self.patches(0) * self.pulses(&self.last) * pulse
    }

    /// Operations for the block of pulses: histories, leaves.
    fn operations(&self) -> [f64; 2] {
        let steps = self.over_steps(|[before, over_pulses, over_samples, _]| {
            before * TURN + 4.0 * (over_pulses + over_samples)
        });
        if let Some(maps) = &self.maps {
            let maps = maps
                .iter()
                .map(|map| map.operations(self.last.num_samples as f64));
            return [steps, self.patches(self.lowest) * maps.sum::<f64>()];
        }
        let [length, pieces, _, pixels] = self.leaf();
        let pulse = transform(length) + PIECE * pieces + PIXEL_AND_PULSE * pixels;
        [steps, self.patches(0) * self.pulses(&self.last) * pulse]
    }

    /// Memory of a thread that processes a patch of this level alone, bytes.
    pub(super) fn thread_bytes(&self, level: usize) -> u64 {
        let maps = self.maps.iter().flatten();
        let on_device = self.spec.numerics.device.is_some();
        let maps = maps.map(|map| map.bytes(on_device)).max().unwrap_or(0);
        2 * self.bytes_at(level) + self.leaf_bytes() + maps
    }

    /// Size of the history of a patch of this level, bytes.
    fn bytes_at(&self, level: usize) -> u64 {
        let step = self.steps.iter().rev().find(|step| step.level >= level);
        step.map_or(0, |step| step.after.bytes(self.stretch))
    }

    /// Leaf buffers of a thread, bytes.
    fn leaf_bytes(&self) -> u64 {
        let [length, pieces, _, pixels] = self.leaf();
        let pieces = SUMMED_PULSES as f64 * pieces * 8.0 * (DEGREE as f64 + 1.0);
        (pieces + 24.0 * length + 40.0 * pixels) as u64
    }
}

impl MapSize {
    /// Single-core time of the map of a sub-aperture and its interpolation, ns.
    fn time_ns(&self, model: &TimeModel, samples: f64) -> f64 {
        let [pulses, columns, bins] = [self.pulses, self.columns, self.bins].map(|n| n as f64);
        let [stations, lines] = [self.stations, self.lines].map(|n| n as f64);
        let transform = |length: usize| length as f64 * libm::log2(length as f64);
        let transforms = columns * transform(self.over_rows) + bins * transform(self.over_columns);
        let taps = self.flat_taps as f64;
        model.map_fit_ns * pulses
            + (model.map_sample_ns + model.map_sample_tap_ns * taps) * pulses * columns.max(samples)
            + model.column_transform_ns * transforms
            + model.map_line_bin_ns * bins * lines
            + model.map_station_ns * stations * lines
    }

    /// Operations: a sample, its gridding and resampling, a Doppler bin at a line, a pixel.
    fn operations(&self, samples: f64) -> f64 {
        let [pulses, columns, bins] = [self.pulses, self.columns, self.bins].map(|n| n as f64);
        let pixels = (self.stations * self.lines) as f64;
        let [over_rows, over_columns] =
            [self.over_rows, self.over_columns].map(|n| transform(n as f64));
        let taps = self.flat_taps as f64;
        pulses * samples * 6.0 * taps
            + pulses * columns * (24.0 + 4.0 * TAPS as f64)
            + columns * over_rows
            + bins * over_columns
            + bins * self.lines as f64 * (32.0 + 4.0 * TAPS as f64)
            + pixels * (100.0 + 4.0 * DOPPLER_TAPS as f64)
    }

    /// Buffers of the map, bytes. A device has two copies of its values, one of them on the way.
    fn bytes(&self, on_device: bool) -> u64 {
        let stride = |count: usize| count + 2 * GROUP;
        let map = match on_device {
            true => 2 * self.bins * self.over_columns,
            false => 0,
        };
        let values = map
            + self.rows * stride(self.columns)
            + self.columns * stride(self.bins)
            + self.bins * stride(self.lines)
            + self.stations * (stride(self.lines) + self.lines);
        let rows = 2 * GROUP * self.over_rows.max(self.over_columns);
        let models = self.pulses * 8 * (POINTS + 20);
        (8 * (values + rows) + models) as u64 + TABLES_BYTES
    }
}

/// Tables of kernels and transforms of a thread, bytes.
const TABLES_BYTES: u64 = 1 << 20;

/// Largest number of first patches evaluated; of more patches every n-th is evaluated.
const MAX_FIRSTS: usize = 16_384;

/// Descents through all blocks of pulses.
pub(super) fn descents<'a>(
    spec: &'a ImageSpec<'a>,
    refiner: &'a Refiner<'a>,
    stretches: &'a [Stretch],
    tree: &'a Tree,
    maps: Option<(usize, &MapKernels)>,
) -> Vec<DecimationChain<'a>> {
    let each = stretches.iter();
    each.map(|stretch| DecimationChain::new(spec, refiner, stretch, tree, maps))
        .collect()
}

/// Memory demand of forming.
pub(super) struct Demand {
    /// Histories down to the level where threads continue alone, bytes.
    pub(super) held_bytes: u64,
    /// Buffers of each thread, bytes.
    pub(super) thread_bytes: u64,
}

/// Largest memory demand of the given descents.
pub(super) fn demand(descents: &[DecimationChain]) -> Demand {
    let most = |of: fn(&DecimationChain) -> u64| descents.iter().map(of).max().unwrap_or(0);
    Demand {
        held_bytes: most(|descent| descent.held_bytes()),
        thread_bytes: most(|descent| {
            let map_level = descent.has_maps().then_some(descent.lowest);
            descent.thread_bytes(descent.tree.task_level(map_level))
        }),
    }
}

/// Total cost of the given descents.
pub(super) fn cost(descents: &[DecimationChain], refiner: &Refiner) -> Cost {
    let (mut operations, mut times_ns) = ([0.0; 2], [0.0; 2]);
    for descent in descents {
        let own = (
            descent.operations(),
            [descent.histories_ns(), descent.leaves_ns()],
        );
        for stage in [0, 1] {
            operations[stage] += own.0[stage];
            times_ns[stage] += own.1[stage];
        }
    }
    let demand = demand(descents);
    let pulses = demand.held_bytes + refiner.read_bytes(1);
    let leaves = match descents.iter().any(DecimationChain::has_maps) {
        true => MAPS,
        false => LEAVES,
    };
    let stages = [HISTORIES, leaves]
        .into_iter()
        .zip(operations)
        .zip(times_ns);
    Cost::of(stages.map(|((name, operations), ns)| StageCost::new(name, operations, ns)))
        .holding("pulses", Copies::Pass, pulses as f64)
        .holding(
            "patches' pulses",
            Copies::Thread,
            demand.thread_bytes as f64,
        )
}
