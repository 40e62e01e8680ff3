//! Common parts of items: recording of scenes, and image formation.

use glam::{DVec2, DVec3};
use num_complex::{Complex32, Complex64};

use crate::{Context, ItemError, Picture, unfinished};
use subaperture_focus::bp::Backprojection;
use subaperture_focus::rdbp::{Mode, RangeDopplerBackprojection, Thesis};
use subaperture_focus::{FormError, ImageFormer, Task};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::Image;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Collection, InMemory, PhaseHistory};
use subaperture_plot::{Panel, PlotError, Scale, panels};
use subaperture_signal::window::Window;
use subaperture_simulate::experiment::{Experiment, Pair};
use subaperture_simulate::scenario::{Scenario, ScenarioError};
use subaperture_simulate::{PointTargetHistory, Preset, Scatterer, Variation};

/// Error bound for formers that have one, dB.
pub(super) const ERROR_DB: f64 = -60.0;

/// Levels of point images: upper level at a unit scatterer.
pub(super) const POINT_SCALE: Scale = Scale::Fixed {
    top_db: 0.0,
    span_db: 60.0,
};

/// Pulses per block while a scene is recorded.
const BLOCK_PULSES: usize = 64;

/// Table 4.1 with one unit scatterer.
pub(crate) fn lone_scatterer(position_m: DVec3) -> PointTargetHistory {
    let preset = Preset::Table41.simulate(&Variation::default());
    let scatterer = Scatterer {
        position_m,
        amplitude: Complex64::ONE,
    };
    PointTargetHistory::new(preset.collection().clone(), vec![scatterer], None)
}

/// Parse an experiment file of this folder.
pub(super) fn experiment(name: &str, text: &str) -> Result<Experiment, ScenarioError> {
    Scenario::new(format!("{name}.toml"), text, ".").experiment()
}

/// Record the experiment's only antenna pair in memory, so that it is simulated once.
pub(super) fn record(context: &Context, experiment: &Experiment) -> Result<InMemory, ItemError> {
    let pair = Pair {
        transmitter: 0,
        receiver: 0,
    };
    hold(context, &experiment.record(pair)?)
}

/// Copy a phase history to memory.
pub(super) fn hold(context: &Context, history: &dyn PhaseHistory) -> Result<InMemory, ItemError> {
    let collection = history.collection().clone();
    let (num_pulses, width) = (collection.pulses.len(), collection.num_samples);
    let mut samples = vec![Complex32::ZERO; num_pulses * width];
    for (block, samples) in samples.chunks_mut(BLOCK_PULSES * width).enumerate() {
        if context.monitor.cancelled() {
            return Err(FormError::Cancelled.into());
        }
        let first = block * BLOCK_PULSES;
        history.read(first..first + samples.len() / width, samples)?;
    }
    Ok(InMemory::new(collection, samples)?)
}

/// Copy a block of pulses as a recording.
pub(super) fn pulses_of(
    history: &dyn PhaseHistory,
    chosen: &[usize],
) -> Result<InMemory, ItemError> {
    let mut collection = history.collection().clone();
    let width = collection.num_samples;
    let mut samples = vec![Complex32::ZERO; chosen.len() * width];
    for (&pulse, row) in chosen.iter().zip(samples.chunks_exact_mut(width)) {
        history.read(pulse..pulse + 1, row)?;
    }
    collection.pulses = chosen.iter().map(|&n| collection.pulses[n]).collect();
    Ok(InMemory::new(collection, samples)?)
}

/// Thesis's former with its most frequent Doppler padding.
pub(crate) fn thesis(sub_cpi: usize) -> RangeDopplerBackprojection {
    thesis_with(sub_cpi, Thesis::default())
}

/// Thesis's former with a Doppler padding.
pub(super) fn thesis_with(sub_cpi: usize, options: Thesis) -> RangeDopplerBackprojection {
    RangeDopplerBackprojection {
        mode: Mode::Thesis(options),
        error_db: ERROR_DB,
        sub_cpi: Some(sub_cpi),
        patch_m: None,
    }
}

/// Traditional backprojection.
pub(crate) fn backprojection() -> Backprojection {
    Backprojection { error_db: ERROR_DB }
}

/// Pulses that span the same fraction of `sqrt(lambda R)` as `pulses` of the thesis's 30,000 of GOTCHA.
///
/// Phase errors within a sub-CPI of length `D`, and the resulting grating lobes, depend on
/// `D / sqrt(lambda R)` only. The thesis resolves 0.25 m at about 10 km and 9.6 GHz (S 5.2), which needs an
/// aperture of `lambda R / (2 * 0.25 m)`, 625 m.
pub(super) fn like_the_thesis(collection: &Collection, pulses: usize) -> Option<usize> {
    let thesis_reach_m = (SPEED_OF_LIGHT_M_S / 9.6e9 * 10e3).sqrt();
    let thesis_aperture_m = thesis_reach_m.powi(2) / (2.0 * 0.25);
    let part = pulses as f64 / 30_000.0 * thesis_aperture_m / thesis_reach_m;

    let all = &collection.pulses;
    let middle = all.get(all.len() / 2)?;
    let range_m = middle.transmitter_m.distance(middle.reference_m);
    let reach_m = (SPEED_OF_LIGHT_M_S / collection.band()?.centre_hz() * range_m).sqrt();
    let steps = all
        .windows(2)
        .map(|pair| pair[0].transmitter_m.distance(pair[1].transmitter_m));
    let spacing_m = steps.sum::<f64>() / (all.len() - 1) as f64;
    // One pulse would be plain backprojection.
    Some(((part * reach_m / spacing_m).round() as usize).max(2))
}

/// Grid from `-half_m` to `half_m` about a point.
pub(crate) fn grid_about(centre: DVec3, half_x_m: f64, half_y_m: f64, step_m: f64) -> ImageGrid {
    let axis = |middle: f64, half_m: f64| {
        let reach = (half_m / step_m).round();
        Axis {
            start: middle - reach * step_m,
            step: step_m,
            count: 2 * reach as usize + 1,
        }
    };
    ImageGrid::horizontal(axis(centre.x, half_x_m), axis(centre.y, half_y_m), centre.z)
}

/// Pixel nearest to a point; `None` outside the grid.
pub(super) fn pixel_at(grid: &ImageGrid, point: DVec2) -> Option<usize> {
    let nearest = |axis: &Axis, value: f64| {
        let index = ((value - axis.start) / axis.step).round();
        (0.0..axis.count as f64)
            .contains(&index)
            .then_some(index as usize)
    };
    let (row, column) = (
        nearest(&grid.rows, point.y)?,
        nearest(&grid.columns, point.x)?,
    );
    Some(row * grid.columns.count + column)
}

/// Progress monitor of one part of an item.
pub(super) struct Share<'a> {
    pub(super) whole: &'a dyn Monitor,
    /// Index of the part, and number of parts.
    pub(super) place: [usize; 2],
}

impl Monitor for Share<'_> {
    fn progress(&self, fraction: f64) {
        let [index, count] = self.place.map(|n| n as f64);
        self.whole.progress((index + fraction) / count);
    }

    fn cancelled(&self) -> bool {
        self.whole.cancelled()
    }
}

/// Form an unweighted image; `place` is its index and the number of images, for progress.
pub(super) fn form(
    context: &Context,
    place: [usize; 2],
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    former: &dyn ImageFormer,
) -> Result<Image, FormError> {
    form_weighted(context, place, history, grid, former, Window::None)
}

/// [`form`] with a window over frequencies and pulses.
pub(super) fn form_weighted(
    context: &Context,
    place: [usize; 2],
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    former: &dyn ImageFormer,
    window: Window,
) -> Result<Image, FormError> {
    let weights = former.weights(history.collection(), grid, window, window)?;
    let task = Task {
        history,
        grid,
        weights: &weights,
        memory_bytes: context.memory_bytes,
        monitor: &Share {
            whole: context.monitor,
            place,
        },
        numerics: Default::default(),
    };
    // The theses' methods are shown with their errors.
    Ok(former.form_best(&task)?.image)
}

/// [`form_weighted`] of a large image, reused from and kept in [`Context::unfinished`].
pub(crate) fn form_large(
    context: &Context,
    place: [usize; 2],
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    former: &dyn ImageFormer,
    window: Window,
) -> Result<Image, ItemError> {
    let kept = context
        .unfinished
        .map(|folder| unfinished::path(folder, history.collection(), grid, former, window));
    if let Some(image) = kept.as_ref().and_then(|path| unfinished::load(path, grid)) {
        return Ok(image);
    }
    let image = form_weighted(context, place, history, grid, former, window)?;
    if let Some(path) = &kept {
        unfinished::save(path, &image)?;
    }
    Ok(image)
}

/// Images side by side, upper level at a unit scatterer.
pub(super) fn side_by_side(
    name: &str,
    caption: &str,
    images: &[(&str, &Image, &ImageGrid)],
) -> Result<Picture, PlotError> {
    side_by_side_at(name, caption, POINT_SCALE, images)
}

/// Images side by side with common levels.
pub(super) fn side_by_side_at(
    name: &str,
    caption: &str,
    scale: Scale,
    images: &[(&str, &Image, &ImageGrid)],
) -> Result<Picture, PlotError> {
    let shown: Vec<Panel> = images
        .iter()
        .map(|&(title, image, grid)| Panel {
            scale,
            ..Panel::new(image, grid, title)
        })
        .collect();
    Ok(Picture {
        name: name.to_owned(),
        caption: caption.to_owned(),
        png: panels(&shown, 2)?,
    })
}
