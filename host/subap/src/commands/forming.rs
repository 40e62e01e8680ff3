//! Steps shared by `focus` and `velocity`: claiming the output folder, surveying the recording, predicting time and memory,
//! and writing the image with its record.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use anyhow::Context;
use serde_json::Value;
use subaperture::corrections::{CorrectedRecording, Corrections, CorrectionsError};
use subaperture::focus::TimeModel;
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::io::claim::OutputClaims;
use subaperture::io::input::open_file;
use subaperture::io::json::{self, JsonError, Limits};
use subaperture::io::product::{self, Product};
use subaperture::io::written::WrittenFile;
use subaperture::phase_history::{Collection, PhaseHistory};
use subaperture::plot::{self, Panel};
use subaperture::resolution::survey::Survey;

use crate::args::{Imaging, Writing};
use crate::config::Session;

/// Claim the folder of an image and check that it can be written. The claim lasts until the command ends.
pub(crate) fn claim<P: AsRef<Path>>(
    session: &Session,
    writing: &Writing,
    inputs: &[P],
    out: &Path,
    num_pixels: u64,
) -> anyhow::Result<OutputClaims> {
    let mut claims = session.claims(writing, inputs);
    claims.folder(out, product::NAMES)?;
    Product::prepare(out, num_pixels)?;
    Ok(claims)
}

/// Size limits of a timing model, which has about a hundred numbers.
const MODEL_LIMITS: Limits = Limits {
    bytes: 64 << 10,
    string_bytes: 4 << 10,
    value_bytes: 1 << 20,
};

const NO_PULSES: &str = "the input holds no pulses";

/// Survey of a recording: band, aperture and resolution.
pub(crate) fn survey(history: &dyn PhaseHistory) -> anyhow::Result<Survey> {
    Survey::of(history.collection()).context(NO_PULSES)
}

/// Survey of a recording, computed once when first needed.
pub(crate) struct Surveying<'a> {
    collection: &'a Collection,
    found: OnceLock<Survey>,
}

impl<'a> Surveying<'a> {
    /// Prepare the survey of a recording, which must contain pulses.
    pub(crate) fn of(history: &'a dyn PhaseHistory) -> anyhow::Result<Self> {
        let collection = history.collection();
        anyhow::ensure!(!collection.pulses.is_empty(), NO_PULSES);
        Ok(Self {
            collection,
            found: OnceLock::new(),
        })
    }

    /// The survey; waits if another thread computes it.
    pub(crate) fn get(&self) -> &Survey {
        self.found.get_or_init(|| {
            Survey::of(self.collection).expect("a collection with pulses has a survey")
        })
    }
}

/// Collection entry of an image's record: the survey and the channels used.
pub(crate) fn about(survey: &Survey, history: &dyn PhaseHistory) -> anyhow::Result<Value> {
    let mut about = serde_json::to_value(survey)?;
    let channels = history.channels();
    if !channels.is_empty() {
        about["channels"] = serde_json::to_value(channels)?;
    }
    let conventions = history.phase_conventions();
    if !conventions.is_empty() {
        about["phase"] = serde_json::to_value(conventions)?;
    }
    Ok(about)
}

/// The given grid or the default one, checked for writability.
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

/// The recording without the tropospheric delay, if that is to be removed.
pub(crate) fn without_delay<'a>(
    typed: &Imaging,
    recorded: impl PhaseHistory + 'a,
) -> Result<CorrectedRecording<'a>, CorrectionsError> {
    let corrections = Corrections {
        troposphere: typed.grid.troposphere.0,
        ..Corrections::default()
    };
    corrections.apply(Arc::new(recorded))
}

/// Read the timing model of `--model`, if given.
pub(crate) fn time_model(typed: &Imaging) -> anyhow::Result<Option<TimeModel>> {
    let Some(path) = &typed.model else {
        return Ok(None);
    };
    let value = open_file(path)
        .map_err(JsonError::Io)
        .and_then(|file| json::value(file, MODEL_LIMITS))
        .map_err(|error| match error {
            JsonError::Io(error) => anyhow::Error::from(error)
                .context(format!("cannot read the timing model {}", path.display())),
            error => anyhow::anyhow!("{}: expected a timing model: {error}", path.display()),
        })?;
    let model = TimeModel::from_value(value).with_context(|| path.display().to_string())?;
    Ok(Some(model))
}

/// Write an image, its record and its picture drawn from `panel`, complete or not at all.
pub(crate) fn write(
    session: &Session,
    out: &Path,
    image: &Image,
    panel: &Panel,
    metadata: &Value,
) -> anyhow::Result<Vec<WrittenFile>> {
    let draw = || Ok(plot::quicklook_within(panel, session.memory.picture_bytes)?);
    product::write_drawing::<anyhow::Error>(out, image, || metadata.clone(), draw)
}
