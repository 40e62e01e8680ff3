//! `--phase`: a recording less the phase errors that autofocus found.

use std::fs::File;

use anyhow::Context;
use subaperture::autofocus::{Corrected, Correction};
use subaperture::io::input::checksum;
use subaperture::io::phase_csv;
use subaperture::phase_history::{InputFile, PhaseHistory};

use crate::args::Focus;

/// The recording less the phases in the file, if one is given.
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

/// The file, for the record.
pub(super) fn input(typed: &Focus) -> anyhow::Result<Option<InputFile>> {
    let Some(path) = &typed.phase else {
        return Ok(None);
    };
    let named = || format!("cannot read {}", path.display());
    let mut file = File::open(path).with_context(named)?;
    let (bytes, crc32) = checksum(&mut file).with_context(named)?;
    Ok(Some(InputFile {
        path: path.clone(),
        bytes,
        crc32,
    }))
}
