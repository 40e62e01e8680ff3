//! `subap focus --gmti`: the mean image of several channels, and the moving targets detected in them.

use std::path::Path;
use std::time::Instant;

use serde_json::{Map, Value, json};
use subaperture::focus::Numerics;
use subaperture::gmti::detection::Settings;
use subaperture::gmti::tracker::Plane;
use subaperture::gmti::{ChannelImages, Imaging, find};
use subaperture::io::ours::Kind;
use subaperture::io::product::record::Brightest;

use super::deliver::{Targets, Whole};
use super::job::{Job, products};
use super::{device, record};
use crate::args::{CROSS_SECTION_M2, Focus};
use crate::commands::forming::{self, Surveying};
use crate::commands::{gmti, track};
use crate::config::Session;
use crate::failure::Usage;
use crate::{messages, stages};

/// Settings with the predicted error, and with that measured on a sample of pixels.
const PREDICTED: &str = "predicted_error_db";
const SAMPLED: &str = "sampled_error_db";

/// Form the images of all channels, detect targets in them, and write the mean image and the targets, both complete or neither.
pub(super) fn run(session: &Session, typed: &Focus, out: &Path) -> anyhow::Result<()> {
    let start = Instant::now();
    let [input] = &typed.input.files[..] else {
        let count = typed.input.files.len();
        let fault =
            format!("--gmti needs one recording of several channels, found {count} recordings");
        return Err(Usage(fault).into());
    };
    let forming = &typed.image.forming;
    let former = forming.former.former()?;
    let model = forming::time_model(&typed.image)?;
    let device = device::open(typed.device);
    let pixels = typed.image.grid.pixels.as_ref();
    let num_pixels = pixels.map_or(0, |grid| grid.num_pixels());
    let mut claims = forming::claim(session, &typed.writing, &[input], &typed.out, num_pixels)?;
    claims.file(out, Kind::Record)?;
    let products = products(typed);
    let _products = products.claim(session, &typed.input.files)?;
    let named = typed
        .input
        .channels
        .as_ref()
        .and_then(|channels| channels.named());
    let channels = track::open(session, input, named, &typed.input.set)?;
    let collection = channels.channel(0).collection();
    let frame = collection.frame;
    products.check_place(&frame)?;
    let grid = {
        let survey = Surveying::of(channels.channel(0))?;
        forming::grid_or(session, pixels.cloned(), &typed.out, || {
            session.default_grid(survey.get())
        })?
    };
    session.check_grid(&grid, 2 + channels.len() as u64)?;
    let numerics = Numerics {
        device: device.as_deref(),
        ..forming.numerics(model.as_ref())
    };
    let settings = Settings::default();
    let progress = session.progress("focusing");
    let targets = stages::measured(session, &progress, |monitor| {
        let imaging = Imaging {
            former: &*former,
            grid: &grid,
            windows: forming.windows.both(),
            memory_bytes: session.memory_bytes,
            numerics,
            monitor,
        };
        find(&channels, &imaging, &settings, None)
    })?;
    progress.finish();
    let image = targets.images.mean();
    let predicted_db = targets.images.mean_error_db(&image);
    judge(predicted_db, former.bound_db());
    let resolved = resolved(&targets.images, predicted_db);
    device::note_unused(numerics.device, former.name(), &json!(resolved));
    record::report_settings(&resolved);
    let mut found = gmti::Found::new(Plane::of(&grid))?;
    found.sensitivity = Some(targets.sensitivity(&settings, CROSS_SECTION_M2)?);
    found.add(targets, &channels, false, &[]);
    // The record describes all channels.
    let all = channels.coherent_sum()?;
    let survey = Surveying::of(&all)?;
    let job = Job {
        session,
        typed,
        history: &all,
        survey: &survey,
        movers: Value::Null,
        numerics,
        start,
    };
    let about = record::About {
        settings: record::settings(&job, former.name(), &resolved),
        check: None,
        peak: Brightest::of(&image, &grid),
    };
    let targets = Targets {
        path: out,
        record: found.record(session, &frame, (&settings, None), start.elapsed()),
        found: &found,
    };
    let former = (former.name(), former.beam());
    job.deliver(&grid, former, about, Whole::Memory(&image), Some(&targets))
}

/// Settings of the image: those of the first channel, with the errors of the mean.
fn resolved(images: &ChannelImages, predicted_error_db: f64) -> Map<String, Value> {
    let [first, ..] = &images.settings[..] else {
        return Map::new();
    };
    let mut resolved = first.clone();
    resolved.insert(PREDICTED.to_owned(), predicted_error_db.into());
    let sampled = images.settings.iter().map(|own| own.get(SAMPLED)?.as_f64());
    // The largest of all channels, where each was compared with the exact sum.
    if let Some(sampled) = sampled.collect::<Option<Vec<f64>>>() {
        let most = sampled.into_iter().fold(f64::NEG_INFINITY, f64::max);
        resolved.insert(SAMPLED.to_owned(), most.into());
    }
    resolved
}

/// Warn if the mean exceeds the bound that the image of each channel keeps.
fn judge(predicted_db: f64, bound_db: Option<f64>) {
    if let Some(bound_db) = bound_db
        && predicted_db > bound_db
    {
        messages::bound_missed(format!(
            "the predicted error of the mean image is {predicted_db:.1} dB, above the bound of {bound_db} dB: the channels are not coherent; each channel's \
             image keeps the bound"
        ));
    }
}
