//! Common parallel loop over pixels.

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;

use super::Tile;
use subaperture_kernels::paths::Points;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::{Monitor, during};

/// Pixels processed by a thread at a time.
pub(super) const PIXELS_A_TASK: usize = 256;

/// Call `add` for every pixel of the tiles with its scene point, on all threads. Return
/// early, omitting pixels, when the monitor cancels. Progress is reported as `stage`.
pub(super) fn for_each(
    grid: &ImageGrid,
    tiles: &mut [Tile],
    monitor: &dyn Monitor,
    stage: &'static str,
    add: impl Fn(DVec3, &mut Complex32) + Sync,
) {
    tiles.par_iter_mut().for_each(|tile| {
        let (place, columns) = (tile.place, tile.place.size.columns);
        let parts = tile.pixels.par_chunks_mut(PIXELS_A_TASK).enumerate();
        parts.for_each(|(part, pixels)| {
            if monitor.cancelled() {
                return;
            }
            let _forming = during(monitor, stage);
            for (i, pixel) in (part * PIXELS_A_TASK..).zip(pixels) {
                let (row, column) = (place.row + i / columns, place.column + i % columns);
                add(grid.position_m(row, column), pixel);
            }
        });
    });
}

/// Call `add` for blocks of at most [`PIXELS_A_TASK`] pixels of a row, with their scene points and the scratch of the thread.
pub(super) fn for_each_run<S>(
    grid: &ImageGrid,
    tiles: &mut [Tile],
    monitor: &dyn Monitor,
    stage: &'static str,
    scratch: impl Fn() -> S + Sync,
    add: impl Fn(&mut S, &Points, &mut [Complex32]) + Sync,
) {
    tiles.par_iter_mut().for_each(|tile| {
        let (place, columns) = (tile.place, tile.place.size.columns);
        let parts = tile.pixels.par_chunks_mut(PIXELS_A_TASK).enumerate();
        let own = || (Points::default(), scratch());
        parts.for_each_init(own, |(points, scratch), (part, pixels)| {
            if monitor.cancelled() {
                return;
            }
            let _forming = during(monitor, stage);
            points.clear();
            for i in (part * PIXELS_A_TASK..).take(pixels.len()) {
                let (row, column) = (place.row + i / columns, place.column + i % columns);
                points.push(grid.position_m(row, column).to_array());
            }
            add(scratch, points, pixels);
        });
    });
}
