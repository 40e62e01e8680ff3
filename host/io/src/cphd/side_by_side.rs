//! Several channels of one file, which share its memory.

use subaperture_model::phase_history::{ChannelError, ReadError, which_channel};

/// The places of the channels that are `wanted`, each by its identifier or its number from 1, or of all of `ids`.
pub(crate) fn chosen<S: AsRef<str>>(
    ids: &[&str],
    wanted: Option<&[S]>,
) -> Result<Vec<usize>, ChannelError> {
    match wanted {
        None => Ok((0..ids.len()).collect()),
        Some(wanted) => {
            let places = wanted.iter().map(|id| which_channel(ids, id.as_ref()));
            places.collect()
        }
    }
}

/// Opens these channels one after another; `open` is given a channel's place and the memory that is left, and `held_bytes` says what it holds of that.
pub(crate) fn opened<T>(
    chosen: Vec<usize>,
    memory_bytes: u64,
    open: impl Fn(usize, u64) -> Result<T, ReadError>,
    held_bytes: impl Fn(&T) -> u64,
) -> Result<Vec<T>, ReadError> {
    let mut left_bytes = memory_bytes;
    let mut opened = Vec::new();
    for channel in chosen {
        let next = open(channel, left_bytes)?;
        left_bytes -= held_bytes(&next);
        opened.push(next);
    }
    Ok(opened)
}
