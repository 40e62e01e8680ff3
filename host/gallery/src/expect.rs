//! How long items will take: a small image, timed, times what each takes of it.

use std::path::Path;
use std::time::Instant;

use glam::DVec3;

use super::items::{grid_about, lone_scatterer, thesis};
use super::{Context, Item, store};
use subaperture_focus::forecast::Forecast;
use subaperture_focus::{FormError, ImageFormer, Task};
use subaperture_model::phase_history::{PhaseHistory, Weights};
use subaperture_signal::window::Window;

/// Half a side of the image that is timed, and its pixels', metres.
const HALF_M: f64 = 15.0;
const STEP_M: f64 = 0.3;
/// Pulses a sub-CPI of it.
const SUB_CPI: usize = 40;

/// What a run would do.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Items to be made.
    pub to_make: usize,
    /// Items that are there.
    pub there: usize,
    /// The time of those to be made.
    pub time: Forecast,
}

/// What [`run`](super::run) with the same arguments would do. An image of 101 x 101 pixels is timed, of the thesis's mode, which most items take most of
/// their time with; items on recordings of
/// their own ([`Context::gotcha`]) take longer than they are told to.
///
/// # Errors
/// [`FormError::Cancelled`].
pub fn expect(items: &[Item], folder: &Path, context: &Context) -> Result<Expected, FormError> {
    let scene = lone_scatterer(DVec3::ZERO);
    let weights = Weights::new(scene.collection(), Window::None, Window::None);
    let start = Instant::now();
    thesis(SUB_CPI).form_best(&Task {
        history: &scene,
        grid: &grid_about(DVec3::ZERO, HALF_M, HALF_M, STEP_M),
        weights: &weights,
        memory_bytes: context.memory_bytes,
        monitor: context.monitor,
        means: Default::default(),
    })?;
    let measured_s = start.elapsed().as_secs_f64();
    let missing = |item: &&Item| store::load(folder, item, &store::key(item, context)).is_none();
    let to_make: Vec<f64> = items.iter().filter(missing).map(|item| item.work).collect();
    Ok(Expected {
        to_make: to_make.len(),
        there: items.len() - to_make.len(),
        time: Forecast {
            seconds: measured_s * to_make.iter().sum::<f64>(),
            measured_s,
        },
    })
}
