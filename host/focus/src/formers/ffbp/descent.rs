//! The way from the first patches to the leaves of which an image is made.
//!
//! ```text
//! recorded pulses -> first patch -> ... -> tasks' patches -> ... -> leaves -> pixels
//!                   one after another,      one a thread,
//!                   all threads on each     its own buffers
//! ```
//!
//! Each patch's history is made from that of the patch around it, whoever makes it and when: a pixel's bits are those of its way down.
//! Large histories are made one at a time, depth first, by all threads together; from [`Descent::breadth_bytes`] on those of a
//! level side by side, until there are [`TASK_LEVEL`] levels left for a thread alone.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;
use subaperture_fft::Transforms;

use super::history::{Axes, PatchHistory};
use super::leaf::{LEAVES, Leaf};
use super::patch_view::Patch;
use super::refine::{Recorded, RefineScratch, Refiner};
use super::thinned::Stretch;
use super::tree::{Node, Tree};
use crate::FormError;
use crate::patch::{Rectangle, Segment};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::{Monitor, during};

/// Levels above the leaves that a thread takes by itself.
const TASK_LEVEL: usize = 2;

/// The level of a tree whose patches threads take by themselves.
pub(super) fn task_level(tree: &Tree) -> usize {
    tree.levels.min(TASK_LEVEL)
}

/// Tasks' patches by row and column, with what is wanted of them.
pub(super) type Wanted<'a> = BTreeMap<[usize; 2], Mutex<Vec<Segment<'a>>>>;

/// Buffers that are free.
#[derive(Default)]
pub(super) struct Pool(Mutex<Vec<PatchHistory>>);

/// A history whose buffers go back to the pool.
struct Held<'a> {
    history: PatchHistory,
    pool: &'a Pool,
}

impl Pool {
    /// Buffers with room for `count` numbers if there are such, the smallest of them.
    fn take(&self, count: usize) -> Held<'_> {
        let mut free = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let room = |history: &PatchHistory| history.values.capacity();
        let large = free.iter().enumerate().filter(|(_, h)| room(h) >= count);
        let best = large.min_by_key(|(_, h)| room(h)).map(|(i, _)| i);
        let history = best.map(|i| free.swap_remove(i));
        Held {
            history: history.unwrap_or_else(PatchHistory::empty),
            pool: self,
        }
    }
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        let history = std::mem::replace(&mut self.history, PatchHistory::empty());
        let mut free = self.pool.0.lock().unwrap_or_else(PoisonError::into_inner);
        free.push(history);
    }
}

/// One thread's buffers: a history a level, and a leaf's.
#[derive(Default)]
struct Scratch {
    levels: Vec<PatchHistory>,
    refine: RefineScratch,
    leaf: Leaf,
}

/// The way down for a stretch of pulses.
pub(super) struct Descent<'a, 'b> {
    pub(super) monitor: &'a dyn Monitor,
    pub(super) grid: &'a ImageGrid,
    pub(super) tree: &'a Tree,
    pub(super) refiner: &'a Refiner<'a>,
    pub(super) transforms: Transforms,
    pub(super) stretch: &'a Stretch,
    pub(super) wanted: &'a Wanted<'b>,
    pub(super) pool: &'a Pool,
    /// A history up to this is halved together with others of its level.
    pub(super) breadth_bytes: u64,
    /// Tasks done, and how many there will be.
    pub(super) done: &'a AtomicUsize,
    pub(super) tasks: usize,
}

impl Descent<'_, '_> {
    /// Adds what recorded pulses say of first patches, one after another; `ahead`, the next one's history is made while patches within
    /// the one before are worked on.
    ///
    /// # Errors
    /// Those of reading.
    pub(super) fn all(
        &self,
        recorded: &Recorded,
        firsts: &[Node],
        ahead: bool,
    ) -> Result<(), FormError> {
        let mut nodes = firsts
            .iter()
            .filter_map(|&node| Some((node, self.patch(node)?)));
        let mut next = nodes.next();
        let mut made = None;
        while let Some((node, patch)) = next {
            let history = match made.take() {
                Some(history) => history,
                None => self.first(recorded, &patch)?,
            };
            next = nodes.next();
            let down = || self.down(node, Arc::new(history));
            match &next {
                Some((_, patch)) if ahead => {
                    made = Some(rayon::join(down, || self.first(recorded, patch)).1?);
                }
                _ => down(),
            }
        }
        Ok(())
    }

    /// The history of a first patch.
    fn first(&self, recorded: &Recorded, patch: &Patch) -> Result<Held<'_>, FormError> {
        let (refiner, stretch) = (self.refiner, self.stretch);
        let axes = refiner.recorded();
        let mut halves = refiner.halves(stretch, &axes, patch);
        let mut held = self.pool.take(self.room(&axes, halves));
        refiner.read(stretch, recorded, patch, halves, &mut held.history)?;
        // As long as a patch of this size allows it.
        loop {
            halves = refiner.halves(stretch, &held.history.axes, patch);
            if halves == [false; 2] {
                return Ok(held);
            }
            let mut next = self.pool.take(self.room(&held.history.axes, halves));
            let own = &mut next.history;
            let before = &held.history;
            refiner.refine(stretch, before, (patch, halves), own, None, self.monitor);
            held = next;
        }
    }

    /// Numbers of a history that is made so.
    fn room(&self, before: &Axes, halves: [bool; 2]) -> usize {
        let axes = before.after(halves, self.refiner.taps().len());
        self.stretch.thinned[axes.thinning].antennas.len() * axes.layout().values()
    }

    fn patch(&self, node: Node) -> Option<Patch> {
        let rectangle = self.tree.rectangle(self.grid, node)?;
        self.wants(node).then(|| Patch::new(self.grid, rectangle))
    }

    /// Whether any of its pixels is wanted.
    fn wants(&self, node: Node) -> bool {
        let above = node.level.saturating_sub(task_level(self.tree));
        let [rows, columns] = node.at.map(|i| i << above..(i + 1) << above);
        rows.into_iter().any(|row| {
            let range = [row, columns.start]..[row, columns.end];
            self.wanted.range(range).next().is_some()
        })
    }

    /// All patches within one, with its history.
    fn down(&self, node: Node, history: Arc<Held>) {
        let tasks = task_level(self.tree);
        if self.monitor.cancelled() {
            return;
        }
        let bytes = history.history.axes.bytes(self.stretch);
        if node.level > tasks + 1 && bytes > self.breadth_bytes {
            for quarter in node.quarters() {
                if let Some(patch) = self.patch(quarter) {
                    self.down(quarter, self.own(&history, &patch, None));
                }
            }
            return;
        }
        let mut list = vec![(node, history)];
        while list[0].0.level > tasks {
            let parents = std::mem::take(&mut list);
            let quarters = parents.par_iter().flat_map_iter(|(node, history)| {
                node.quarters().map(move |quarter| (quarter, history))
            });
            let made = quarters.map_init(RefineScratch::default, |scratch, (quarter, history)| {
                let patch = self.patch(quarter)?;
                Some((quarter, self.own(history, &patch, Some(scratch))))
            });
            list = made.flatten().collect();
            if list.is_empty() {
                return;
            }
        }
        let own = || Scratch {
            leaf: Leaf::new(self.transforms),
            ..Scratch::default()
        };
        list.par_iter()
            .for_each_init(own, |scratch, (node, history)| {
                let (Some(segments), Some(rectangle)) = (
                    self.wanted.get(&node.at),
                    self.tree.rectangle(self.grid, *node),
                ) else {
                    return;
                };
                let mut segments = segments.lock().unwrap_or_else(PoisonError::into_inner);
                self.task(*node, rectangle, &history.history, &mut segments, scratch);
                let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
                self.monitor.progress(done as f64 / self.tasks as f64);
            });
    }

    /// A patch's own history, or that of the patch around it if it would not be smaller; made by this thread with its buffers,
    /// else by all.
    fn own<'c>(
        &'c self,
        parent: &Arc<Held<'c>>,
        patch: &Patch,
        alone: Option<&mut RefineScratch>,
    ) -> Arc<Held<'c>> {
        let (refiner, stretch) = (self.refiner, self.stretch);
        let halves = refiner.halves(stretch, &parent.history.axes, patch);
        if halves == [false; 2] {
            return parent.clone();
        }
        let mut held = self.pool.take(self.room(&parent.history.axes, halves));
        let (parent, own) = (&parent.history, &mut held.history);
        refiner.refine(stretch, parent, (patch, halves), own, alone, self.monitor);
        Arc::new(held)
    }

    /// What a thread does by itself: a patch, whose history is there, and all in it. `segments` are what is wanted of it.
    fn task(
        &self,
        node: Node,
        rectangle: Rectangle,
        history: &PatchHistory,
        segments: &mut [Segment],
        scratch: &mut Scratch,
    ) {
        if self.monitor.cancelled() {
            return;
        }
        if node.level == 0 {
            let _forming = during(self.monitor, LEAVES);
            let antennas = &self.stretch.thinned[history.axes.thinning].antennas;
            scratch.leaf.image(
                self.grid,
                self.refiner.shares(),
                history,
                antennas,
                rectangle,
                segments,
            );
            return;
        }
        for quarter in node.quarters() {
            let Some(rectangle) = self.tree.rectangle(self.grid, quarter) else {
                continue;
            };
            let mut part = part(segments, &rectangle);
            if part.is_empty() {
                continue;
            }
            let patch = Patch::new(self.grid, rectangle);
            let halves = self.refiner.halves(self.stretch, &history.axes, &patch);
            if halves == [false; 2] {
                self.task(quarter, rectangle, history, &mut part, scratch);
                continue;
            }
            let mut own = scratch.levels.pop().unwrap_or_else(PatchHistory::empty);
            self.refiner.refine(
                self.stretch,
                history,
                (&patch, halves),
                &mut own,
                Some(&mut scratch.refine),
                self.monitor,
            );
            self.task(quarter, rectangle, &own, &mut part, scratch);
            scratch.levels.push(own);
        }
    }
}

/// What of some segments lies in a rectangle.
fn part<'a>(segments: &'a mut [Segment], rectangle: &Rectangle) -> Vec<Segment<'a>> {
    let [rows, columns] = rectangle.place();
    let each = segments.iter_mut().filter_map(|segment| {
        let end = segment.column + segment.pixels.len();
        let (first, end) = (segment.column.max(columns.start), end.min(columns.end));
        let there = rows.contains(&segment.row) && first < end;
        there.then(|| Segment {
            row: segment.row,
            column: first,
            pixels: &mut segment.pixels[first - segment.column..end - segment.column],
        })
    });
    each.collect()
}
