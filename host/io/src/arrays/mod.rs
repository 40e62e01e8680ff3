#![doc = include_str!("schema.md")]
//!
//! # Reading
//! File types are recognised by their first bytes. The whole file is read at once. Memory: the samples as complex64, twice that for several channels,
//! 264 bytes per pulse and channel, and one chunk of an HDF5 data set. `tests/recordings/arrays.rs` reads what NumPy and h5py write.

mod convention;
mod fault;
mod fields;
#[cfg(feature = "hdf5")]
mod hdf5;
mod source;

use std::cell::RefCell;
use std::fs::File;
use std::path::Path;

use subaperture_model::phase_history::{
    Channel, Channels, InMemory, Inference, InputFile, PhaseHistory, PhaseSign, ReadError,
    check_finite,
};

use crate::input::{Stamp, checksum};
use crate::npy::Array;
use crate::remote::{self, Remote};
use fields::{Fields, Parsed};
use source::Source;

use fault::Fault;

/// Description of the files that [`open_channels`] reads.
pub const SCHEMA: &str = include_str!("schema.md");

/// Read all channels of a file, named by their numbers from 1, with at most `memory_bytes` of memory.
///
/// Phase sign and reference are those stated by the arrays. An unstated one is inferred by `inference` from the
/// samples of the first channel, if one candidate is clearly the sharpest; [`PhaseHistory::phase_conventions`]
/// returns the result. Without `inference` an unstated one is an error.
///
/// # Errors
/// [`ReadError::Malformed`] names the array, also where the phase convention is neither stated nor inferable;
/// [`ReadError::Io`]; [`ReadError::NotFinite`]; [`ReadError::Memory`]; [`ReadError::Changed`].
pub fn open_channels(
    path: &Path,
    memory_bytes: u64,
    inference: Option<&Inference>,
) -> Result<Channels<'static>, ReadError> {
    let io = |source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let malformed = |what: String| ReadError::Malformed {
        path: path.to_owned(),
        what,
    };
    if let Some(url) = remote::url(path) {
        let is_archive = remote::start(url, 4).map_err(io)? == source::ARCHIVE_MAGIC;
        if is_archive && let Some(bytes) = remote::content(path, memory_bytes)? {
            return from_bytes(path, bytes, memory_bytes, inference);
        }
        let file = Remote::open(url).map_err(io)?;
        let source = Source::open(path).map_err(malformed)?;
        let left_bytes = memory_bytes.saturating_sub(file.held_bytes());
        let parsed = parse(path, source, left_bytes)?;
        let input = file.input(path)?;
        return channels(path, parsed, Some(&input), memory_bytes, inference);
    }
    let mut file = File::open(path).map_err(io)?;
    let stamp = Stamp::of(&file).map_err(io)?;
    let (bytes, crc32) = checksum(&mut file).map_err(io)?;
    let input = InputFile::with_crc32(path, bytes, crc32);
    let source = Source::open(path).map_err(malformed)?;
    let parsed = parse(path, source, memory_bytes)?;
    stamp.check(&file, path)?;
    channels(path, parsed, Some(&input), memory_bytes, inference)
}

/// As [`open_channels`], from an archive (`.npz`) in memory; `name` stands for its path. Its bytes count as memory.
///
/// # Errors
/// As [`open_channels`], without [`ReadError::Io`] and [`ReadError::Changed`].
pub fn from_bytes(
    name: &Path,
    bytes: Vec<u8>,
    memory_bytes: u64,
    inference: Option<&Inference>,
) -> Result<Channels<'static>, ReadError> {
    let input = InputFile::with_crc32(
        name,
        bytes.len() as u64,
        format!("{:08x}", crc32fast::hash(&bytes)),
    );
    let left_bytes = memory_bytes.saturating_sub(input.bytes);
    let parsed = parse(name, Source::Bytes(bytes), left_bytes)?;
    channels(name, parsed, Some(&input), memory_bytes, inference)
}

/// As [`open_channels`], from arrays in memory, each with its name; `name` is that of the recording. Samples are not copied.
///
/// # Errors
/// As [`open_channels`], without [`ReadError::Io`] and [`ReadError::Changed`].
pub fn from_arrays(
    name: &str,
    arrays: impl IntoIterator<Item = (String, Array)>,
    memory_bytes: u64,
    inference: Option<&Inference>,
) -> Result<Channels<'static>, ReadError> {
    let name = Path::new(name);
    let arrays = RefCell::new(arrays.into_iter().collect());
    let parsed = parse(name, Source::Arrays(arrays), memory_bytes)?;
    channels(name, parsed, None, memory_bytes, inference)
}

/// Read the arrays of an open file.
fn parse(path: &Path, source: Source, memory_bytes: u64) -> Result<Parsed, ReadError> {
    let parsed = Fields::new(source, memory_bytes).and_then(Parsed::read);
    parsed.map_err(|fault| match fault {
        Fault::Malformed(what) => ReadError::Malformed {
            path: path.to_owned(),
            what,
        },
        Fault::Memory(needed_bytes) => ReadError::Memory {
            path: path.to_owned(),
            needed_bytes,
            allowed_bytes: memory_bytes,
        },
    })
}

/// Phase history of each channel, in the convention stated or inferred.
fn channels(
    path: &Path,
    parsed: Parsed,
    input: Option<&InputFile>,
    memory_bytes: u64,
    inference: Option<&Inference>,
) -> Result<Channels<'static>, ReadError> {
    let malformed = |what: String| ReadError::Malformed {
        path: path.to_owned(),
        what,
    };
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    let name = stem.to_string_lossy().into_owned();
    let mut channels = Vec::new();
    let [first, ..] = parsed.channels.as_slice() else {
        return Err(malformed("no channels".to_owned()));
    };
    check_finite(
        &path.display().to_string(),
        0,
        first.0.num_samples,
        &first.1,
    )?;
    let held: u64 = (parsed.channels.iter())
        .map(|(collection, samples)| {
            (size_of_val(samples.as_slice()) + size_of_val(collection.pulses.as_slice())) as u64
        })
        .sum();
    let left_bytes = memory_bytes.saturating_sub(held);
    let seen = (&first.0, first.1.as_slice());
    let settled = convention::settle(path, seen, parsed.stated, inference, left_bytes);
    let settled = settled.map_err(malformed)?;
    let convention = settled.convention;
    for (c, (mut collection, mut samples)) in parsed.channels.into_iter().enumerate() {
        // Checked here in addition to `InMemory`, so that the error names the path.
        check_finite(
            &path.display().to_string(),
            0,
            collection.num_samples,
            &samples,
        )?;
        collection.name.clone_from(&name);
        if convention.sign == PhaseSign::Plus {
            samples.iter_mut().for_each(|z| *z = z.conj());
        }
        for (n, pulse) in collection.pulses.iter_mut().enumerate() {
            convention.reference.set(pulse);
            if let Some(what) = pulse.fault(collection.num_samples) {
                return Err(malformed(format!("pulse {n}: {what}")));
            }
        }
        let about = Channel::new((c + 1).to_string());
        let history = InMemory::new(collection, samples)?
            .with_inputs(input.into_iter().cloned().collect())
            .with_channels(vec![about.clone()])
            .with_convention(convention)
            .with_warnings(settled.warning.clone().into_iter().collect())
            .with_pulse_defects();
        channels.push((about, Box::new(history) as Box<dyn PhaseHistory>));
    }
    Ok(Channels::new(channels)?)
}
