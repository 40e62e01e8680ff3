#![doc = include_str!("schema.md")]
//!
//! # Reading
//! Files are known by what they begin with. Everything is read at once: memory is what the samples take as complex64, twice that of several channels,
//! 240 bytes a pulse and channel, and what a data set of HDF5 needs for a piece of it. `tests/recordings/arrays.rs` reads what NumPy and h5py write.

mod fields;
#[cfg(feature = "hdf5")]
mod hdf5;
mod source;

use std::fs::File;
use std::path::Path;

use subaperture_model::phase_history::{
    Channel, Channels, InMemory, InputFile, PhaseHistory, ReadError, check_finite,
};

use crate::input::{Stamp, checksum};
use fields::{Fields, Parsed};
use source::Source;

/// What [`open_channels`] reads, in words.
pub const SCHEMA: &str = include_str!("schema.md");

/// Reads all channels of a file; their names are their numbers, from 1. No more than `memory_bytes` is held.
///
/// # Errors
/// [`ReadError::Io`]; [`ReadError::Malformed`], naming the array; [`ReadError::NotFinite`]; [`ReadError::Memory`]; [`ReadError::Changed`].
pub fn open_channels(path: &Path, memory_bytes: u64) -> Result<Channels<'static>, ReadError> {
    let io = |source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let malformed = |what: String| ReadError::Malformed {
        path: path.to_owned(),
        what,
    };
    let mut file = File::open(path).map_err(io)?;
    let stamp = Stamp::of(&file).map_err(io)?;
    let (bytes, crc32) = checksum(&mut file).map_err(io)?;
    let input = InputFile {
        path: path.to_owned(),
        bytes,
        crc32,
    };
    let source = Source::open(path).map_err(malformed)?;
    let parsed = Fields::new(source, memory_bytes).and_then(Parsed::read);
    let parsed = parsed.map_err(|fault| match fault {
        Fault::Malformed(what) => malformed(what),
        Fault::Memory(needed_bytes) => ReadError::Memory {
            path: path.to_owned(),
            needed_bytes,
            allowed_bytes: memory_bytes,
        },
    })?;
    stamp.check(&file, path)?;
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    let name = stem.to_string_lossy().into_owned();
    let mut channels = Vec::new();
    for (c, (mut collection, samples)) in parsed.channels.into_iter().enumerate() {
        // Here and not in `InMemory` alone, which knows no path.
        check_finite(
            &path.display().to_string(),
            0,
            collection.num_samples,
            &samples,
        )?;
        collection.name.clone_from(&name);
        let about = Channel::new((c + 1).to_string());
        let history = InMemory::new(collection, samples)?
            .with_inputs(vec![input.clone()])
            .with_channels(vec![about.clone()]);
        channels.push((about, Box::new(history) as Box<dyn PhaseHistory>));
    }
    Ok(Channels::new(channels)?)
}

/// Why arrays are no phase history.
enum Fault {
    /// What is wrong, naming the array.
    Malformed(String),
    /// Bytes needed.
    Memory(u64),
}

impl From<String> for Fault {
    fn from(what: String) -> Self {
        Self::Malformed(what)
    }
}
