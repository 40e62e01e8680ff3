//! What several items do alike: the thesis's scenes, formed by one former or another.

use glam::DVec3;
use num_complex::Complex64;

use crate::focus::bp::Backprojection;
use crate::focus::rdbp::{Mode, RangeDoppler};
use crate::focus::{FormError, ImageFormer, Task, Weights};
use crate::geometry::{Axis, ImageGrid};
use crate::image::Image;
use crate::phase_history::PhaseHistory;
use crate::plot::{Panel, PlotError, Scale, panels};
use crate::reproduce::{Context, Picture};
use crate::signal::window::Window;
use crate::simulate::{Preset, Scatterer, Simulated, Variation};

/// Error bound of formers that have one, dB.
pub(super) const ERROR_DB: f64 = -60.0;

/// All images of points alike: a unit scatterer at the top.
pub(super) const POINT_SCALE: Scale = Scale::Fixed {
    top_db: 0.0,
    span_db: 60.0,
};

/// Table 4.1 with one unit scatterer.
pub(super) fn lone_scatterer(position_m: DVec3) -> Simulated {
    let preset = Preset::Table41.simulate(&Variation::default());
    let scatterer = Scatterer {
        position_m,
        amplitude: Complex64::ONE,
    };
    Simulated::new(preset.collection().clone(), vec![scatterer], None)
}

/// The thesis's former.
pub(super) fn thesis(sub_cpi: usize) -> RangeDoppler {
    RangeDoppler {
        mode: Mode::Thesis,
        error_db: ERROR_DB,
        sub_cpi: Some(sub_cpi),
        patch_m: None,
    }
}

/// Traditional backprojection.
pub(super) fn backprojection() -> Backprojection {
    Backprojection { error_db: ERROR_DB }
}

/// Pixels from `-half_m` to `half_m` about a point.
pub(super) fn grid_about(centre: DVec3, half_x_m: f64, half_y_m: f64, step_m: f64) -> ImageGrid {
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

/// The image, unweighted.
pub(super) fn form(
    context: &Context,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    former: &dyn ImageFormer,
) -> Result<Image, FormError> {
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    let task = Task {
        history,
        grid,
        weights: &weights,
        memory_bytes: context.memory_bytes,
        monitor: context.monitor,
    };
    Ok(former.form(&task)?.image)
}

/// Images side by side.
pub(super) fn side_by_side(
    name: &str,
    caption: &str,
    images: &[(&str, &Image, &ImageGrid)],
) -> Result<Picture, PlotError> {
    let shown: Vec<Panel> = images
        .iter()
        .map(|&(title, image, grid)| Panel {
            scale: POINT_SCALE,
            ..Panel::new(image, grid, title)
        })
        .collect();
    Ok(Picture {
        name: name.to_owned(),
        caption: caption.to_owned(),
        png: panels(&shown, 2)?,
    })
}
