//! Phase correction of a recording (`--phase`).

use anyhow::Context;
use subaperture::autofocus::{Corrected, Correction};
use subaperture::io::phase_csv;
use subaperture::phase_history::PhaseHistory;

use crate::args::Focus;

/// The recording, corrected by the phases in the file of `--phase`, if given.
pub(super) fn corrected<'a>(
    typed: &Focus,
    recorded: &'a dyn PhaseHistory,
) -> anyhow::Result<Option<Corrected<'a>>> {
    let Some(path) = &typed.phase else {
        return Ok(None);
    };
    let error_rad = phase_csv::read(path)?;
    let correction = Correction::Phase { error_rad };
    let corrected = Corrected::new(recorded, &correction)
        .with_context(|| format!("--phase {}", path.display()))?;
    Ok(Some(corrected))
}
