//! Named arrays: in memory, and in files (NumPy archives and HDF5).

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::npy::{self, Array};
use subaperture_model::phase_history::ReadError;

/// First bytes of a zip archive.
pub(super) const ARCHIVE_MAGIC: [u8; 4] = *b"PK\x03\x04";

/// Open file of named arrays.
pub(super) enum Source {
    Archive(PathBuf),
    /// Archive in memory.
    Bytes(Vec<u8>),
    /// Arrays in memory, each until it is read.
    Arrays(RefCell<BTreeMap<String, Array>>),
    #[cfg(feature = "hdf5")]
    Hdf5(super::hdf5::Hdf5),
}

impl Source {
    pub(super) fn open(path: &Path) -> Result<Self, String> {
        let is_archive = std::fs::File::open(path)
            .and_then(|mut file| {
                let mut start = [0; ARCHIVE_MAGIC.len()];
                std::io::Read::read_exact(&mut file, &mut start)?;
                Ok(start == ARCHIVE_MAGIC)
            })
            .unwrap_or(false);
        if is_archive {
            return Ok(Self::Archive(path.to_owned()));
        }
        #[cfg(feature = "hdf5")]
        return super::hdf5::Hdf5::open(path).map(Self::Hdf5);
        #[cfg(not(feature = "hdf5"))]
        Err("not an archive of arrays (.npz)".to_owned())
    }

    /// Names of the arrays.
    pub(super) fn names(&self) -> Result<Vec<String>, String> {
        match self {
            Self::Archive(path) => npy::names(path).map_err(without_path),
            Self::Bytes(bytes) => npy::names_of(bytes),
            Self::Arrays(arrays) => Ok(arrays.borrow().keys().cloned().collect()),
            #[cfg(feature = "hdf5")]
            Self::Hdf5(file) => file.names(),
        }
    }

    /// Read the array `name` with at most `memory_bytes` of memory.
    pub(super) fn array(&self, name: &str, memory_bytes: u64) -> Result<Array, String> {
        match self {
            Self::Archive(path) => {
                Array::read(path, Some(name), memory_bytes).map_err(without_path)
            }
            Self::Bytes(bytes) => Array::of_archive(bytes, name, memory_bytes),
            Self::Arrays(arrays) => {
                let array = arrays.borrow_mut().remove(name);
                array.ok_or_else(|| format!("array '{name}' is read twice"))
            }
            #[cfg(feature = "hdf5")]
            Self::Hdf5(file) => file.array(name, memory_bytes),
        }
    }
}

/// Message without the path; the caller adds it.
fn without_path(error: ReadError) -> String {
    match error {
        ReadError::Io { source, .. } => source.to_string(),
        ReadError::Malformed { what, .. } => what,
        other => other.to_string(),
    }
}
