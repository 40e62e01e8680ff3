//! Writing of calibrated values into the description.

use std::path::{Path, PathBuf};

use anyhow::Context;
use subaperture::io::recording::RecordingFile;
use subaperture::io::together::FileSet;

use crate::args::Tune;
use crate::failure::Usage;

/// Refuses, before long work, a file that could not be written then.
pub(super) fn check(typed: &Tune) -> anyhow::Result<()> {
    let Some(file) = &typed.write_to else {
        return Ok(());
    };
    let folder = |path: &Path| path.parent().map(Path::to_owned).unwrap_or_default();
    if folder(file) != folder(&typed.recording) {
        return Err(Usage(format!(
            "--write-to {}: paths in a description start at its folder: give a name beside {}",
            file.display(),
            typed.recording.display()
        ))
        .into());
    }
    if file.symlink_metadata().is_ok() {
        return Err(Usage(format!(
            "--write-to {}: there is such a file: give another name, or --write to change {} itself",
            file.display(),
            typed.recording.display()
        ))
        .into());
    }
    Ok(())
}

/// Adds the description with `values` to a set of files; its path, or `None` if it is not to be written.
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
        .map_err(|what| anyhow::anyhow!("{}: {what}: {}", typed.recording.display(), lines()))?;
    let file = match &typed.write_to {
        Some(file) => file.clone(),
        None => {
            // The search may have taken long, and an editor may be open.
            let now = std::fs::read_to_string(&typed.recording)
                .with_context(|| format!("cannot read {} again", typed.recording.display()))?;
            anyhow::ensure!(
                now == recording.text(),
                "{} was changed meanwhile and is left alone; what was found is {}",
                typed.recording.display(),
                lines()
            );
            // Through a link to the file itself.
            std::fs::canonicalize(&typed.recording).unwrap_or_else(|_| typed.recording.clone())
        }
    };
    files.write_bytes(&file, text.as_bytes())?;
    Ok(Some(
        typed
            .write_to
            .clone()
            .unwrap_or_else(|| typed.recording.clone()),
    ))
}
