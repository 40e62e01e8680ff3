//! Writing of calibrated values to the description.

use std::path::{Path, PathBuf};

use anyhow::Context;
use subaperture::io::recording::RecordingFile;
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;

use crate::args::Tune;
use crate::failure::Usage;

/// Check before the search that the file can be written.
pub(super) fn check(typed: &Tune) -> anyhow::Result<()> {
    let Some(file) = &typed.write_to else {
        return Ok(());
    };
    let folder = |path: &Path| path.parent().map(Path::to_owned).unwrap_or_default();
    if folder(file) != folder(&typed.recording) {
        return Err(Usage(format!(
            "--write-to {}: paths in a description are relative to its folder: give a name in the folder of {}",
            file.display(),
            typed.recording.display()
        ))
        .into());
    }
    if file.symlink_metadata().is_ok() {
        return Err(Usage(format!(
            "--write-to {}: the file exists: give another name, or use --write to change {} itself",
            file.display(),
            typed.recording.display()
        ))
        .into());
    }
    Ok(())
}

/// Add the description with `values` to a set of files. Returns its path, or `None` if it is not to be written.
pub(super) fn add_to(
    files: &mut FileSet,
    typed: &Tune,
    recording: &RecordingFile,
    values: &[(&str, String)],
) -> anyhow::Result<Option<PathBuf>> {
    if !typed.write && typed.write_to.is_none() {
        return Ok(None);
    }
    let lines = || {
        let lines = values
            .iter()
            .map(|(key, value)| format!("{key} = \"{value}\""));
        lines.collect::<Vec<_>>().join(", ")
    };
    let given = values.iter().map(|(key, value)| (*key, value.as_str()));
    let text = recording
        .text_with(given)
        .map_err(|error| anyhow::anyhow!("{}: {error}: {}", typed.recording.display(), lines()))?;
    let file = match &typed.write_to {
        Some(file) => file.clone(),
        None => {
            // The file may have been edited during the search.
            let now = std::fs::read_to_string(&typed.recording)
                .with_context(|| format!("cannot read {} again", typed.recording.display()))?;
            anyhow::ensure!(
                now == recording.text(),
                "{} changed during the search and is not overwritten; the calibrated values are {}",
                typed.recording.display(),
                lines()
            );
            typed.recording.clone()
        }
    };
    files.write_bytes(&file, FileKind::Recording, text.as_bytes())?;
    Ok(Some(file))
}
