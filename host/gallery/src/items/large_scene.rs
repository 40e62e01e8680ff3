//! The scene of the thesis's real data, and its stand-in: Schone 2020, Figs 4.7 to 4.11.
//!
//! The thesis shows 30,000 pulses of GOTCHA. Here a simulated scene stands for them, with sub-CPIs that span
//! as much of `sqrt(lambda R)`; recordings of GOTCHA, where given, are shown beside it.

use crate::{Context, Finding, ItemError};
use subaperture_focus::FormError;
use subaperture_io::open::{Options, open_all};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Image, power};
use subaperture_model::phase_history::PhaseHistory;
use subaperture_plot::Scale;

use super::forming::{experiment, record};

/// A scene to be imaged.
pub(super) struct Scene {
    /// For file names.
    pub(super) name: &'static str,
    /// For people.
    pub(super) title: &'static str,
    /// Its pulses.
    pub(super) history: Box<dyn PhaseHistory>,
    /// Its pixels.
    pub(super) grid: ImageGrid,
    /// Those about its brightest scatterer, as far as grating lobes are looked for.
    pub(super) close: ImageGrid,
}

/// The simulated scene, and the recordings given.
pub(super) fn scenes(context: &Context) -> Result<Vec<Scene>, ItemError> {
    let text = include_str!("scenes/large.toml");
    let grid = |text: &str| text.parse().expect("the grid is well-formed");
    let mut scenes = vec![Scene {
        name: "simulated",
        title: "simulated scene",
        history: Box::new(record(context, &experiment("large", text)?)?),
        grid: grid("x=-60:60.1:0.3,y=-45:45.1:0.3"),
        close: grid("x=-34:26.1:0.15,y=-32:8.1:0.15"),
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

/// From the brightest pixel down, the same for all images that are to be compared with `image`.
pub(super) fn scale_of(image: &Image, span_db: f64) -> Scale {
    let peak = image.peak().map_or(1.0, |peak| power(peak.value));
    Scale::Fixed {
        top_db: (10.0 * peak.log10()).ceil(),
        span_db,
    }
}

/// A finding to which scenes add what they show.
pub(super) fn begun(thesis: &str, method: &str) -> Finding {
    Finding {
        thesis: thesis.to_owned(),
        method: method.to_owned(),
        ..Finding::default()
    }
}

/// The sub-CPI that stands for the thesis's.
pub(super) fn sub_cpi(scene: &Scene, thesis_pulses: usize) -> Result<usize, FormError> {
    super::forming::like_the_thesis(scene.history.collection(), thesis_pulses)
        .ok_or_else(|| FormError::unsuited(format!("{}: pulses do not share a band", scene.title)))
}
