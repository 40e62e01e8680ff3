//! `subap compare`: measure the difference of two images.

use serde_json::json;
use subaperture::images::{self, CompareError, Compared};

use super::stored;
use crate::args::Compare;
use crate::config::Session;
use crate::{messages, text};

/// Compare two images on their common pixels and print the measures.
pub(crate) fn run(session: &Session, typed: &Compare) -> anyhow::Result<()> {
    let progress = session.progress("comparing");
    let open = |path| {
        let image = stored::open(session, path)?;
        anyhow::Ok(match &typed.place {
            Some(place) if image.is_unplaced() => image.placed(place),
            _ => image,
        })
    };
    let image = open(&typed.image)?;
    let reference = open(&typed.reference)?;
    let compared = images::compare(&image, &reference).map_err(|error| match &error {
        CompareError::Pair(pair) if pair.unplaced && typed.place.is_none() => {
            anyhow::anyhow!("{error}: give --place LAT,LON[,HEIGHT]")
        }
        _ => error.into(),
    })?;
    progress.finish();
    let comparison = &compared.comparison;
    if let (Some(bound_db), Some(error_db)) = (typed.error_db, comparison.error_db)
        && error_db > bound_db
    {
        messages::bound_missed(format!(
            "relative RMS error is {error_db:.1} dB, above the bound --error-db {bound_db}"
        ));
    }
    if session.json() {
        let mut value = serde_json::to_value(comparison)?;
        value["values"] = json!(if compared.complex {
            "complex"
        } else {
            "amplitudes"
        });
        value["pixels"] = json!(compared.pixels);
        value["of_pixels"] = json!(compared.of);
        value["notes"] = json!(compared.notes);
        return text::say_json("comparison", value);
    }
    text::say(describe(&compared))?;
    Ok(())
}

/// Format the measures, followed by the compared pixels and values if these are not all of both images.
fn describe(compared: &Compared) -> String {
    let figures = compared.comparison.to_string();
    let phases = |line: &&str| compared.complex || !line.starts_with("peak phase error");
    let mut lines: Vec<String> = figures.lines().filter(phases).map(str::to_owned).collect();
    if compared.pixels != compared.of {
        lines.push(format!(
            "compared             {} of {} pixels, which both images have",
            compared.pixels, compared.of
        ));
    }
    let notes = compared.notes.iter();
    lines.extend(notes.map(|note| format!("note                 {note}")));
    lines.join("\n")
}
