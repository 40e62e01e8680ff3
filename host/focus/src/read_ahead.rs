//! Reading of pulses while the preceding ones are processed.

use std::ops::Range;

use num_complex::Complex32;

use crate::FormError;
use subaperture_model::phase_history::PhaseHistory;

/// Blocks in memory at a time.
pub(crate) const BLOCKS_HELD: usize = 2;

/// Pass each of `blocks` of pulses in order to `work`, with samples pulse by pulse that it may overwrite.
///
/// The next block is read in the meantime, by another thread if one is free: [`BLOCKS_HELD`] are held.
///
/// # Errors
/// The first error of reading or of `work`.
pub(crate) fn read_ahead(
    history: &dyn PhaseHistory,
    blocks: impl IntoIterator<Item = Range<usize>>,
    mut work: impl FnMut(Range<usize>, &mut [Complex32]) -> Result<(), FormError> + Send,
) -> Result<(), FormError> {
    let num_samples = history.collection().num_samples;
    let read = |pulses: &Range<usize>, samples: &mut Vec<Complex32>| {
        samples.resize(pulses.len() * num_samples, Complex32::ZERO);
        history.read(pulses.clone(), samples)
    };
    let mut blocks = blocks.into_iter();
    let Some(mut pulses) = blocks.next() else {
        return Ok(());
    };
    let [mut samples, mut ahead] = [const { Vec::new() }; BLOCKS_HELD];
    read(&pulses, &mut samples)?;
    for next in blocks {
        let (done, read) = rayon::join(|| work(pulses, &mut samples), || read(&next, &mut ahead));
        done?;
        read?;
        std::mem::swap(&mut samples, &mut ahead);
        pulses = next;
    }
    work(pulses, &mut samples)
}

/// Read all pulses, `block` at a time, into their final location, and process each block.
///
/// # Errors
/// The first error of reading or of `work`.
pub(crate) fn read_ahead_into(
    history: &dyn PhaseHistory,
    block: usize,
    samples: &mut [Complex32],
    mut work: impl FnMut(Range<usize>, &mut [Complex32]) -> Result<(), FormError> + Send,
) -> Result<(), FormError> {
    let collection = history.collection();
    let blocks = blocks_of(collection.pulses.len(), block);
    let mut parts = blocks.zip(samples.chunks_mut(block * collection.num_samples));
    let Some((mut pulses, mut rows)) = parts.next() else {
        return Ok(());
    };
    history.read(pulses.clone(), rows)?;
    for (next, ahead) in parts {
        let (done, read) = rayon::join(|| work(pulses, rows), || history.read(next.clone(), ahead));
        done?;
        read?;
        (pulses, rows) = (next, ahead);
    }
    work(pulses, rows)
}

/// Divide `count` pulses into blocks of `block`.
pub(crate) fn blocks_of(count: usize, block: usize) -> impl Iterator<Item = Range<usize>> {
    (0..count)
        .step_by(block)
        .map(move |first| first..(first + block).min(count))
}
