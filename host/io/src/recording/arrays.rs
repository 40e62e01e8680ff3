//! Files named by a description, each read once however often the description is varied.

use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::files::expand;
use super::keys::{FormatKeys, RecordingKeys};
use crate::input::{Stamp, open_file};
use crate::npy::Array;
use subaperture_describe::declare::Located;
use subaperture_describe::error::Fault;
use subaperture_model::phase_history::{InputFile, ReadError};

type Name = (PathBuf, Option<String>);

/// Arrays by file and name, and other files that were read.
#[derive(Clone, Debug, Default)]
pub(super) struct Arrays {
    held: Arc<Mutex<BTreeMap<Name, Arc<Array>>>>,
    /// State of the files when they were first read.
    stamps: Arc<Mutex<BTreeMap<PathBuf, Stamp>>>,
}

impl Arrays {
    /// Files read so far.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        let held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        let mut files: Vec<PathBuf> = held.keys().map(|(path, _)| path.clone()).collect();
        files.dedup();
        files
    }

    /// Sizes and checksums of the files read so far.
    ///
    /// # Errors
    /// [`ReadError::Io`]; [`ReadError::Changed`] if a file has changed since it was read.
    pub(super) fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        let stamps = self.stamps.lock().unwrap_or_else(PoisonError::into_inner);
        let files = self.files().into_iter();
        files.map(|path| input(&path, stamps.get(&path))).collect()
    }

    /// Bytes of all arrays in memory.
    fn held_bytes(&self) -> u64 {
        sum(&self.held.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The array with this name; unless it is in memory, it is read by `read` within the rest of `memory_bytes`.
    pub(super) fn hold(
        &self,
        name: Name,
        memory_bytes: u64,
        read: impl FnOnce(&Name, u64) -> Result<Array, String>,
    ) -> Result<Arc<Array>, String> {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(array) = held.get(&name) {
            return Ok(array.clone());
        }
        let left = memory_bytes.saturating_sub(sum(&held));
        if let Ok(stamp) = open_file(&name.0).and_then(|file| Stamp::of(&file)) {
            let mut stamps = self.stamps.lock().unwrap_or_else(PoisonError::into_inner);
            stamps.entry(name.0.clone()).or_insert(stamp);
        }
        let array = Arc::new(read(&name, left)?);
        held.insert(name, array.clone());
        Ok(array)
    }
}

fn sum(held: &BTreeMap<Name, Arc<Array>>) -> u64 {
    held.values().map(|array| bytes(array)).sum()
}

/// Bytes of an array: every value takes 8.
fn bytes(array: &Array) -> u64 {
    8 * array.shape.iter().map(|&size| size as u64).product::<u64>()
}

/// Source of a description's arrays.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) arrays: &'a Arrays,
    pub(super) folder: &'a Path,
    /// `[recording]`.
    pub(super) recording: &'a RecordingKeys,
    pub(super) memory_bytes: u64,
}

impl Source<'_> {
    /// Bytes left by the arrays.
    pub(super) fn left_bytes(&self) -> u64 {
        self.memory_bytes.saturating_sub(self.arrays.held_bytes())
    }

    /// Files of the samples, at least one.
    pub(super) fn files(&self) -> Result<Vec<PathBuf>, Fault> {
        let mut files = Vec::new();
        let file = &self.recording.file;
        for text in file.iter() {
            let names = expand(text).map_err(|what| file.fault(what))?;
            files.extend(names.iter().map(|name| self.folder.join(name)));
        }
        if files.len() > 1 && self.is_archive() {
            let what = "expected one archive file: give one, or format = \"npy\"";
            return Err(file.fault(what));
        }
        Ok(files)
    }

    fn is_archive(&self) -> bool {
        matches!(self.recording.format, FormatKeys::Npz { .. })
    }

    /// The first file of the samples.
    pub(super) fn file(&self) -> PathBuf {
        let files = self.files().ok();
        files
            .and_then(|files| files.into_iter().next())
            .unwrap_or_default()
    }

    /// The array of this name: a path that ends in `.npy`, or an array of the samples' archive.
    pub(super) fn array(&self, key: &Located<String>) -> Result<Arc<Array>, Fault> {
        let text = &**key;
        let name = if Path::new(text).extension().is_some_and(|e| e == "npy") {
            (self.folder.join(text), None)
        } else if self.is_archive() {
            (self.file(), Some(text.to_owned()))
        } else {
            return Err(key.fault(
                "the samples are not in an archive: give the path of a .npy file, or use \
                 format = \"npz\"",
            ));
        };
        self.hold(name).map_err(|what| key.fault(what))
    }

    /// A `.npy` file or an array of an archive.
    pub(super) fn hold(&self, name: Name) -> Result<Arc<Array>, String> {
        self.arrays
            .hold(name, self.memory_bytes, |(path, name), left| {
                Array::read(path, name.as_deref(), left).map_err(|error| error.to_string())
            })
    }

    /// A vector of finite real numbers of this name.
    pub(super) fn vector(&self, key: &Located<String>) -> Result<Vec<f64>, Fault> {
        let array = self.array(key)?;
        let real = array
            .real()
            .filter(|real| array.shape.len() == 1 && !real.is_empty());
        let Some(real) = real else {
            return Err(key.fault(format!(
                "expected a row of real numbers, found shape {:?}, {}",
                array.shape,
                match array.real() {
                    Some(_) => "real",
                    None => "complex",
                }
            )));
        };
        match real.iter().position(|x| !x.is_finite()) {
            None => Ok(real.to_vec()),
            Some(i) => Err(key.fault(format!("value {i} is {}", real[i]))),
        }
    }
}

/// Size and checksum of a file; fails if it differs from `stamp`.
pub(super) fn input(path: &Path, stamp: Option<&Stamp>) -> Result<InputFile, ReadError> {
    let failed = |source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let file = open_file(path).map_err(failed)?;
    let sum = || {
        let mut file = BufReader::with_capacity(1 << 16, &file);
        let (mut hasher, mut total, mut piece) = (crc32fast::Hasher::new(), 0, vec![0; 1 << 16]);
        loop {
            match file.read(&mut piece)? {
                0 => return Ok((total, hasher.finalize())),
                count => {
                    hasher.update(&piece[..count]);
                    total += count as u64;
                }
            }
        }
    };
    let (bytes, crc) = sum().map_err(failed)?;
    if let Some(stamp) = stamp {
        stamp.check(&file, path)?;
    }
    Ok(InputFile::with_crc32(path, bytes, format!("{crc:08x}")))
}
