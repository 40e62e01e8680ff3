//! Forecast of the time of a run: a small timed image, scaled by each item's work.

use std::path::Path;
use std::time::Instant;

use glam::DVec3;

use super::items::{grid_about, lone_scatterer, thesis};
use super::{Context, Item, store};
use subaperture_focus::forecast::Forecast;
use subaperture_focus::{FormError, ImageFormer, Task};
use subaperture_model::phase_history::{PhaseHistory, Weights};
use subaperture_signal::window::Window;

/// Half side and pixel spacing of the timed image, metres.
const HALF_M: f64 = 15.0;
const STEP_M: f64 = 0.3;
/// Pulses per sub-CPI of the timed image.
const SUB_CPI: usize = 40;

/// Expected work of a run.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Number of items to compute.
    pub to_make: usize,
    /// Number of items already present.
    pub there: usize,
    /// Expected time.
    pub time: Forecast,
}

/// Forecast of [`run`](super::run) with the same arguments. An image of 101 x 101 pixels is timed in the thesis's mode, which dominates most
/// items. Recordings in [`Context::gotcha`] are not included and take longer.
///
/// # Errors
/// [`FormError::Cancelled`] if the monitor cancels.
pub fn expect(items: &[Item], folder: &Path, context: &Context) -> Result<Expected, FormError> {
    let scene = lone_scatterer(DVec3::ZERO);
    let weights = Weights::new(scene.collection(), Window::None, Window::None);
    let start = Instant::now();
    thesis(SUB_CPI).form_best(&Task {
        memory_bytes: context.memory_bytes,
        monitor: context.monitor,
        ..Task::new(
            &scene,
            &grid_about(DVec3::ZERO, HALF_M, HALF_M, STEP_M),
            &weights,
        )
    })?;
    let measured_s = start.elapsed().as_secs_f64();
    let missing = |item: &&Item| store::load(folder, item, &store::key(item, context)).is_none();
    let work = |item: &Item| match (context.full, item.full_work()) {
        (true, Some(work)) => work,
        _ => item.work,
    };
    let to_make: Vec<f64> = items.iter().filter(missing).map(work).collect();
    Ok(Expected {
        to_make: to_make.len(),
        there: items.len() - to_make.len(),
        time: Forecast {
            seconds: measured_s * to_make.iter().sum::<f64>(),
            measured_s,
        },
    })
}
