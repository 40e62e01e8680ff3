//! Descent from the first patches to the leaves that form the image.
//!
//! ```text
//! recorded pulses -> first patch -> ... -> tasks' patches -> ... -> leaves -> pixels
//!                   one after another,      one a thread,
//!                   all threads on each     its own buffers
//! ```
//!
//! The history of each patch is computed from that of its parent patch, independent of thread and time; a pixel depends only on its own descent.
//! Large histories are computed one at a time, depth first, by all threads together. Histories below [`Descent::breadth_bytes`] are computed
//! in parallel per level, until [`TASK_LEVEL`](super::tree::TASK_LEVEL) levels remain for a single thread.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;
use subaperture_fft::Transforms;

use super::history::{Axes, PatchHistory};
use super::leaf::{LEAVES, Leaf};
use super::maps::{MAPS, MapKernels, MapPatch, MapScratch};
use super::patch_view::Patch;
use super::refine::{Recorded, RefineScratch, Refiner};
use super::thinned::Stretch;
use super::tree::{Node, Tree};
use crate::FormError;
use crate::device::{Device, DeviceError};
use crate::patch::{Rectangle, Segment};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::{Monitor, during};

/// Kernels and largest patches of range-Doppler maps.
#[derive(Clone, Copy)]
pub(super) struct MapLeaves<'a> {
    pub(super) kernels: &'a MapKernels,
    /// Level of the largest patches with maps.
    pub(super) level: usize,
    /// Device that interpolates maps, and its first error.
    pub(super) device: Option<&'a dyn Device>,
    pub(super) fault: &'a Mutex<Option<DeviceError>>,
}

/// Requested pixels of the task patches, by patch row and column.
pub(super) type Wanted<'a> = BTreeMap<[usize; 2], Mutex<Vec<Segment<'a>>>>;

/// Pool of free buffers.
#[derive(Default)]
pub(super) struct Pool(Mutex<Vec<PatchHistory>>);

/// History that returns its buffers to the pool.
struct Held<'a> {
    history: PatchHistory,
    pool: &'a Pool,
}

impl Pool {
    /// Take the smallest free buffers with room for `count` values, or new ones.
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

/// Buffers of one thread: one history per level, and a leaf.
#[derive(Default)]
struct Scratch {
    levels: Vec<PatchHistory>,
    refine: RefineScratch,
    leaf: Leaf,
    maps: MapScratch,
}

/// Descent for one block of pulses.
pub(super) struct Descent<'a, 'b> {
    pub(super) monitor: &'a dyn Monitor,
    pub(super) grid: &'a ImageGrid,
    pub(super) tree: &'a Tree,
    /// Level of the patches that threads process alone.
    pub(super) task_level: usize,
    pub(super) maps: Option<MapLeaves<'a>>,
    pub(super) refiner: &'a Refiner<'a>,
    pub(super) transforms: Transforms,
    pub(super) stretch: &'a Stretch,
    pub(super) wanted: &'a Wanted<'b>,
    pub(super) pool: &'a Pool,
    /// Largest history decimated in parallel with others of its level, bytes.
    pub(super) breadth_bytes: u64,
    /// Number of finished tasks, and total number.
    pub(super) done: &'a AtomicUsize,
    pub(super) tasks: usize,
}

impl Descent<'_, '_> {
    /// Add recorded pulses to the images of first patches, one after another. With `ahead`, the history of the next first patch is computed while
    /// the current one is processed.
    ///
    /// # Errors
    /// Errors of reading and of the device.
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
            if let Some(error) = self.fault() {
                return Err(error.into());
            }
        }
        Ok(())
    }

    /// Error of the device.
    fn fault(&self) -> Option<DeviceError> {
        let fault = self.maps.as_ref()?.fault;
        let fault = fault.lock().unwrap_or_else(PoisonError::into_inner);
        fault.clone()
    }

    /// Compute the history of a first patch.
    fn first(&self, recorded: &Recorded, patch: &Patch) -> Result<Held<'_>, FormError> {
        let (refiner, stretch) = (self.refiner, self.stretch);
        let axes = refiner.recorded();
        let mut decimates = refiner.decimates(stretch, &axes, patch);
        let mut held = self.pool.take(self.room(&axes, decimates));
        refiner.read(stretch, recorded, patch, decimates, &mut held.history)?;
        // Repeat while the patch size permits decimation.
        loop {
            decimates = refiner.decimates(stretch, &held.history.axes, patch);
            if decimates == [false; 2] {
                return Ok(held);
            }
            let mut next = self.pool.take(self.room(&held.history.axes, decimates));
            let own = &mut next.history;
            let before = &held.history;
            refiner.refine(stretch, before, (patch, decimates), own, None, self.monitor);
            held = next;
        }
    }

    /// Number of values of a history with the given decimations.
    fn room(&self, before: &Axes, decimates: [bool; 2]) -> usize {
        let axes = before.after(decimates, self.refiner.taps());
        self.stretch.thinned[axes.thinning].antennas.len() * axes.layout().values()
    }

    fn patch(&self, node: Node) -> Option<Patch> {
        let rectangle = self.tree.rectangle(self.grid, node)?;
        self.wants(node).then(|| Patch::new(self.grid, rectangle))
    }

    /// Whether any pixel of the patch is requested.
    fn wants(&self, node: Node) -> bool {
        let above = node.level.saturating_sub(self.task_level);
        let [rows, columns] = node.at.map(|i| i << above..(i + 1) << above);
        rows.into_iter().any(|row| {
            let range = [row, columns.start]..[row, columns.end];
            self.wanted.range(range).next().is_some()
        })
    }

    /// Process all patches within one, given its history.
    fn down(&self, node: Node, history: Arc<Held>) {
        let tasks = self.task_level;
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

    /// History of a patch, or of its parent patch if the own one would not be smaller. It is computed in the buffers of this thread, if given,
    /// or by all threads.
    fn own<'c>(
        &'c self,
        parent: &Arc<Held<'c>>,
        patch: &Patch,
        alone: Option<&mut RefineScratch>,
    ) -> Arc<Held<'c>> {
        let (refiner, stretch) = (self.refiner, self.stretch);
        let decimates = refiner.decimates(stretch, &parent.history.axes, patch);
        if decimates == [false; 2] {
            return parent.clone();
        }
        let mut held = self.pool.take(self.room(&parent.history.axes, decimates));
        let (parent, own) = (&parent.history, &mut held.history);
        refiner.refine(
            stretch,
            parent,
            (patch, decimates),
            own,
            alone,
            self.monitor,
        );
        Arc::new(held)
    }

    /// Work of one thread: a patch with a given history, and all patches within it. `segments` are its requested pixels.
    fn task(
        &self,
        node: Node,
        rectangle: Rectangle,
        history: &PatchHistory,
        segments: &mut [Segment],
        scratch: &mut Scratch,
    ) {
        if self.monitor.cancelled() || self.by_maps(node, rectangle, history, segments, scratch) {
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
            let decimates = self.refiner.decimates(self.stretch, &history.axes, &patch);
            if decimates == [false; 2] {
                self.task(quarter, rectangle, history, &mut part, scratch);
                continue;
            }
            let own = self.refined(history, (&patch, decimates), scratch);
            self.task(quarter, rectangle, &own, &mut part, scratch);
            scratch.levels.push(own);
        }
    }

    /// History of a patch from that of a larger one, in free buffers of this thread, to which the caller returns it.
    fn refined(
        &self,
        history: &PatchHistory,
        (patch, decimates): (&Patch, [bool; 2]),
        scratch: &mut Scratch,
    ) -> PatchHistory {
        let mut own = scratch.levels.pop().unwrap_or_else(PatchHistory::empty);
        self.refiner.refine(
            self.stretch,
            history,
            (patch, decimates),
            &mut own,
            Some(&mut scratch.refine),
            self.monitor,
        );
        own
    }

    /// Image a patch by maps; `false` if it is too large or not suited to them.
    fn by_maps(
        &self,
        node: Node,
        rectangle: Rectangle,
        history: &PatchHistory,
        segments: &mut [Segment],
        scratch: &mut Scratch,
    ) -> bool {
        let Some(MapLeaves {
            kernels,
            level,
            device,
            fault,
        }) = self.maps
        else {
            return false;
        };
        if node.level > level {
            return false;
        }
        let patch = Patch::new(self.grid, rectangle);
        // The history of a larger patch is referred to this one's centre.
        let own = (history.centre != patch.centre)
            .then(|| self.refined(history, (&patch, [false; 2]), scratch));
        let history = own.as_ref().unwrap_or(history);
        let of_patch = MapPatch {
            grid: self.grid,
            rectangle,
            axes: &history.axes,
            thinned: &self.stretch.thinned[history.axes.thinning],
            data_m: &history.data_m,
        };
        let imaging = during(self.monitor, MAPS);
        let maps = &mut scratch.maps;
        let imaged = maps.image(&of_patch, kernels, history, segments, device);
        drop(imaging);
        scratch.levels.extend(own);
        imaged.unwrap_or_else(|error| {
            let mut fault = fault.lock().unwrap_or_else(PoisonError::into_inner);
            fault.get_or_insert(error);
            true
        })
    }
}

/// Parts of segments inside a rectangle.
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
