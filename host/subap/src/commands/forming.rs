//! What `focus` and `velocity` have in common: a folder is claimed, a recording surveyed, what its image will take is
//! told before it is formed, and the image is written beside its record.

use std::path::Path;
use std::sync::OnceLock;

use anyhow::Context;
use serde_json::Value;
use subaperture::focus::{ImageFormer, Means, Task, TimeModel};
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::io::claim::Claims;
use subaperture::io::product::{self, Product};
use subaperture::monitor::Monitor;
use subaperture::phase_history::{Collection, PhaseHistory, Weights};
use subaperture::plot::{self, Panel};
use subaperture::resolution::survey::Survey;
use subaperture::signal::window::Window;

use crate::ahead::Ahead;
use crate::args::{Imaging, Rehearsal, Writing};
use crate::config::Session;

/// Claims the folder of an image and checks that it can be written. Held until the command's end.
pub(crate) fn claim<P: AsRef<Path>>(
    session: &Session,
    writing: &Writing,
    inputs: &[P],
    out: &Path,
    num_pixels: u64,
) -> anyhow::Result<Claims> {
    let mut claims = session.claims(writing, inputs);
    claims.folder(out, product::NAMES)?;
    Product::prepare(out, num_pixels)?;
    Ok(claims)
}

const NO_PULSES: &str = "the input holds no pulses";

/// What the recording can show.
pub(crate) fn survey(history: &dyn PhaseHistory) -> anyhow::Result<Survey> {
    Survey::of(history.collection()).context(NO_PULSES)
}

/// What a recording can show, found once, by whoever needs it first.
pub(crate) struct Surveying<'a> {
    collection: &'a Collection,
    found: OnceLock<Survey>,
}

impl<'a> Surveying<'a> {
    /// Of a recording that has pulses.
    pub(crate) fn of(history: &'a dyn PhaseHistory) -> anyhow::Result<Self> {
        let collection = history.collection();
        anyhow::ensure!(!collection.pulses.is_empty(), NO_PULSES);
        Ok(Self {
            collection,
            found: OnceLock::new(),
        })
    }

    /// It, waiting for whoever is finding it.
    pub(crate) fn get(&self) -> &Survey {
        self.found.get_or_init(|| {
            Survey::of(self.collection).expect("a collection with pulses has a survey")
        })
    }
}

/// The recording in an image's record: what it can show, and which of its channels its pulses are of.
pub(crate) fn about(survey: &Survey, history: &dyn PhaseHistory) -> anyhow::Result<Value> {
    let mut about = serde_json::to_value(survey)?;
    let channels = history.channels();
    if !channels.is_empty() {
        about["channels"] = serde_json::to_value(channels)?;
    }
    Ok(about)
}

/// The grid that is given, or else the one that suits, if its image can be written.
pub(crate) fn grid_or(
    session: &Session,
    given: Option<ImageGrid>,
    out: &Path,
    suited: impl FnOnce() -> anyhow::Result<ImageGrid>,
) -> anyhow::Result<ImageGrid> {
    if let Some(grid) = given {
        return Ok(grid);
    }
    let grid = suited()?;
    session.check_grid(&grid, 1)?;
    Product::prepare(out, grid.num_pixels())?;
    Ok(grid)
}

/// The time model in a file, if one is asked for.
pub(crate) fn time_model(typed: &Imaging) -> anyhow::Result<Option<TimeModel>> {
    let Some(path) = &typed.model else {
        return Ok(None);
    };
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the time model {}", path.display()))?;
    let model = TimeModel::from_text(&text).with_context(|| path.display().to_string())?;
    Ok(Some(model))
}

/// An image to be formed.
pub(crate) struct Forming<'f> {
    history: &'f dyn PhaseHistory,
    grid: &'f ImageGrid,
    weights: Weights,
    memory_bytes: u64,
    means: Means<'f>,
}

impl<'f> Forming<'f> {
    /// Of a recording on a grid, under windows in fast and slow time, by these means.
    pub(crate) fn new(
        session: &Session,
        history: &'f dyn PhaseHistory,
        grid: &'f ImageGrid,
        [fast, slow]: [Window; 2],
        means: Means<'f>,
    ) -> Self {
        Self {
            history,
            grid,
            weights: Weights::new(history.collection(), fast, slow),
            memory_bytes: session.memory_bytes,
            means,
        }
    }

    /// The work, watched by `monitor`.
    pub(crate) fn task<'t>(&'t self, monitor: &'t dyn Monitor) -> Task<'t> {
        Task {
            history: self.history,
            grid: self.grid,
            weights: &self.weights,
            memory_bytes: self.memory_bytes,
            monitor,
            means: self.means,
        }
    }
}

/// Says what an image by `former` will take: whether that is all that was asked for.
pub(crate) fn announce(
    session: &Session,
    rehearsal: &Rehearsal,
    former: &dyn ImageFormer,
    task: &Task,
    out: &Path,
) -> anyhow::Result<bool> {
    Ahead::of_image(session, rehearsal, former, task, out)?.announce(session, rehearsal)
}

/// Writes an image, which `panel` shows, its record and its picture, complete or not at all.
pub(crate) fn write(
    session: &Session,
    out: &Path,
    image: &Image,
    panel: &Panel,
    metadata: &Value,
) -> anyhow::Result<()> {
    let draw = || Ok(plot::quicklook_within(panel, session.memory.picture_bytes)?);
    product::write_drawing::<anyhow::Error>(out, image, || metadata.clone(), draw)?;
    Ok(())
}
