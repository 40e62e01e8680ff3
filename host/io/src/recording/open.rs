//! Opening a described recording. Keys that are missing are inferred from the samples.

use std::path::Path;

use subaperture_model::phase_history::{Channels, Inference, PhaseHistory, ReadError};

use super::phase::settle;
use super::{RecordingFile, SignStated, Take};

impl RecordingFile {
    /// Values of keys that the description omits and that follow from the samples: `recording.phase` and `recording.order` of the clearly
    /// sharpest image. [`Self::history`] does not infer: it uses `minus` and `iiqq`.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] with the key, where the sign is missing and the samples do not determine it; as [`Self::history`].
    pub fn inferred(
        &self,
        inference: &Inference,
        memory_bytes: u64,
    ) -> Result<Vec<(&'static str, &'static str)>, ReadError> {
        let take = self.take(memory_bytes, None)?;
        if take.sign != SignStated::Unstated && take.order_is_stated {
            return Ok(Vec::new());
        }
        let path = self.path.clone().unwrap_or_default();
        Ok(settle(self, &path, &take, Some(inference), memory_bytes)?.inferred)
    }
}

/// Open the recording described at `path` with `settings` (keys and values) in place of its own, within `memory_bytes`. A missing sign of
/// the phase or order of I and Q is inferred by `inference`, as by [`RecordingFile::inferred`]; without `inference` it must be stated.
///
/// # Errors
/// [`ReadError`].
pub fn open(
    path: &Path,
    settings: &[(String, String)],
    memory_bytes: u64,
    inference: Option<&Inference>,
) -> Result<impl PhaseHistory + use<>, ReadError> {
    Ok(take(path, settings, memory_bytes, inference)?.history)
}

/// Parallel channels, as [`RecordingFile::channels`].
///
/// # Errors
/// [`ReadError`].
pub fn open_channels(
    path: &Path,
    settings: &[(String, String)],
    memory_bytes: u64,
    inference: Option<&Inference>,
) -> Result<Channels<'static>, ReadError> {
    take(path, settings, memory_bytes, inference)?.side_by_side()
}

fn take(
    path: &Path,
    settings: &[(String, String)],
    memory_bytes: u64,
    inference: Option<&Inference>,
) -> Result<Take, ReadError> {
    let mut file =
        RecordingFile::read_within(path, memory_bytes).map_err(|source| ReadError::Io {
            path: path.to_owned(),
            source,
        })?;
    for (key, value) in settings {
        file.set(key, value)?;
    }
    let mut take = file.take(memory_bytes, None)?;
    let left_bytes = memory_bytes.saturating_sub(take.history.held_bytes());
    let signed = settle(&file, path, &take, inference, left_bytes)?;
    if let Some(other) = signed.other {
        drop(take);
        take = other.take(memory_bytes, None)?;
    }
    take.history = (take.history.with_inputs(file.inputs()?))
        .with_channels(take.channels.clone())
        .with_convention(signed.convention)
        .with_warnings(signed.warnings);
    Ok(take)
}
