//! Large scene in place of the thesis's real data: Schone 2020, Figs 4.7 to 4.11.
//!
//! The thesis shows 30,000 pulses of GOTCHA. Here a simulated scene replaces them, with sub-CPIs that span
//! the same fraction of `sqrt(lambda R)`; at full scale ([`Context::full`]) with its pulses, band, distance and sub-CPIs, on 1 km x 1 km. GOTCHA recordings are
//! shown too, if given.

use crate::{Context, Finding, ItemError};
use subaperture_focus::FormError;
use subaperture_io::open::{Options, open_all};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Image, power};
use subaperture_model::phase_history::PhaseHistory;
use subaperture_plot::Scale;

use super::forming::{experiment, record};

/// Scene to image.
pub(super) struct Scene {
    /// Name in file names.
    pub(super) name: &'static str,
    /// Title in texts.
    pub(super) title: &'static str,
    /// Phase history.
    pub(super) history: Box<dyn PhaseHistory>,
    /// Image grid.
    pub(super) grid: ImageGrid,
    /// Grid about the brightest scatterer, as wide as grating lobes are searched.
    pub(super) close: ImageGrid,
}

/// Simulated scene, and the recordings given.
pub(super) fn scenes(context: &Context) -> Result<Vec<Scene>, ItemError> {
    let (text, whole, close) = match context.full {
        false => (
            include_str!("scenes/large.toml"),
            "x=-60:60.1:0.3,y=-45:45.1:0.3",
            "x=-34:26.1:0.15,y=-32:8.1:0.15",
        ),
        true => (
            include_str!("scenes/large-full.toml"),
            "x=-500:500:0.25,y=-500:500:0.25",
            "x=-44:36.1:0.1,y=-32:8.1:0.1",
        ),
    };
    let grid = |text: &str| text.parse().expect("the grid is well-formed");
    let mut scenes = vec![Scene {
        name: "simulated",
        title: "simulated scene",
        history: Box::new(record(context, &experiment("large", text)?)?),
        grid: grid(whole),
        close: grid(close),
    }];
    if !context.gotcha.is_empty() {
        let options = Options {
            memory_bytes: context.memory_bytes / 2,
            ..Options::default()
        };
        scenes.push(Scene {
            name: "gotcha",
            title: "GOTCHA",
            history: Box::new(open_all(context.gotcha, &options)?),
            grid: grid("x=-50:50.1:0.25,y=-50:50.1:0.25"),
            close: grid("x=-50:50.1:0.25,y=-50:50.1:0.25"),
        });
    }
    Ok(scenes)
}

/// Levels from the brightest pixel of `image`, for all images compared with it.
pub(super) fn scale_of(image: &Image, span_db: f64) -> Scale {
    let peak = image.peak().map_or(1.0, |peak| power(peak.value));
    Scale::Fixed {
        top_db: (10.0 * peak.log10()).ceil(),
        span_db,
    }
}

/// Finding without checks, whose method states the scale of the scenes.
pub(super) fn begun(context: &Context, thesis: &str, method: &str, scenes: &[Scene]) -> Finding {
    let size = |scene: &Scene| {
        let collection = scene.history.collection();
        format!(
            "the {} of {} pulses of {} frequencies and {} x {} pixels",
            scene.title,
            collection.pulses.len(),
            collection.num_samples,
            scene.grid.rows.count,
            scene.grid.columns.count
        )
    };
    let sizes: Vec<String> = scenes.iter().map(size).collect();
    let scale = match context.full {
        false => "Scaled down",
        true => "Scale",
    };
    Finding {
        thesis: thesis.to_owned(),
        method: format!(
            "{method} {scale}: {} for the thesis's 30,000 pulses of 21,232 frequencies over a swath of 5 km, and 400 million pixels (5.2).",
            sizes.join(", ")
        ),
        ..Finding::default()
    }
}

/// Sub-CPI length equivalent to the thesis's, pulses.
pub(super) fn sub_cpi(scene: &Scene, thesis_pulses: usize) -> Result<usize, FormError> {
    super::forming::like_the_thesis(scene.history.collection(), thesis_pulses)
        .ok_or_else(|| FormError::unsuited(format!("{}: pulses do not share a band", scene.title)))
}
