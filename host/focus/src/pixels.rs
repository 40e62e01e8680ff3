//! The loop over pixels that formers share.

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;

use super::Task;

/// Pixels that a thread takes at a time.
const PIXELS_A_TASK: usize = 256;

/// Adds `value` of its scene point to every pixel of the task's grid, row-major, on all threads. Returns
/// early, leaving pixels out, when the monitor asks to stop.
pub(super) fn add_to_each(
    task: &Task,
    pixels: &mut [Complex32],
    value: impl Fn(DVec3) -> Complex32 + Sync,
) {
    let columns = task.grid.columns.count;
    pixels
        .par_chunks_mut(PIXELS_A_TASK)
        .enumerate()
        .for_each(|(chunk, pixels)| {
            if task.monitor.cancelled() {
                return;
            }
            for (i, pixel) in (chunk * PIXELS_A_TASK..).zip(pixels) {
                *pixel += value(task.grid.position_m(i / columns, i % columns));
            }
        });
}
