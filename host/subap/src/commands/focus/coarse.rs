//! Note about a grid whose steps exceed the resolution.

use subaperture::geometry::ImageGrid;

use super::job::Job;
use crate::messages;
use crate::text::metres;

/// Note the axes of the given grid whose steps exceed the half-power resolution.
pub(super) fn note(job: &Job, grid: &ImageGrid) {
    if job.typed.image.grid.pixels.is_none() {
        return;
    }
    let windows = job.typed.image.forming.windows;
    let windows = [windows.window, windows.slow_window];
    let survey = job.survey.get();
    let coarse = survey.coarse_axes(job.history.collection(), grid, windows);
    let parts: Vec<String> = coarse
        .iter()
        .map(|axis| {
            let lengths = [axis.step_m, axis.resolution_m].map(|length_m| metres(Some(length_m)));
            format!(
                "{} in {}, where the half-power resolution is {}",
                lengths[0], axis.name, lengths[1]
            )
        })
        .collect();
    if !parts.is_empty() {
        messages::note(&format!(
            "--grid is coarser than the resolution: steps of {}. Scatterers between pixels are missed: give steps of at most half of the resolution",
            parts.join("; ")
        ));
    }
}
