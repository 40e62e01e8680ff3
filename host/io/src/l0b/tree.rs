//! Groups and data sets of an HDF5 file, with sizes checked before memory is allocated.

use std::path::Path;

use hdf5_pure::{ChunkCacheConfig, DType, Dataset, DatasetAccessProperties, Error, File};

use crate::container::Source;
use crate::date;
use crate::hdf5_numbers::is_number;
use crate::remote;
use subaperture_model::phase_history::ReadError;

/// Maximum length of a text, bytes.
const MAX_TEXT_BYTES: u64 = 64 << 10;

/// Whether an HDF5 file has the root group of NISAR products.
pub(crate) fn is_nisar(path: &Path) -> bool {
    remote::hdf5(path).is_ok_and(|file| file.group("science").is_ok())
}

/// HDF5 file that is open for reading.
pub(super) struct Tree {
    file: File,
    source: Source,
}

/// Numbers of a data set.
pub(super) struct Numbers {
    pub(super) shape: Vec<u64>,
    pub(super) values: Vec<f64>,
}

/// Reference time of a data set of times, as nanoseconds since the beginning of 1970.
pub(super) type Epoch = i64;

impl Tree {
    pub(super) fn open(source: Source) -> Result<Self, ReadError> {
        let file = remote::hdf5(source.path()).map_err(|error| source.malformed(error))?;
        Ok(Self { file, source })
    }

    pub(super) fn source(&self) -> &Source {
        &self.source
    }

    /// Names of the groups in a group, sorted.
    pub(super) fn groups(&self, path: &str) -> Result<Vec<String>, ReadError> {
        let names = self.file.group(path).and_then(|group| group.groups());
        let mut names = names.map_err(|error| self.fault(path, "a group", &error))?;
        names.sort_unstable();
        Ok(names)
    }

    /// Names of the data sets in a group.
    pub(super) fn data_sets(&self, path: &str) -> Result<Vec<String>, ReadError> {
        let names = self.file.group(path).and_then(|group| group.datasets());
        names.map_err(|error| self.fault(path, "a group", &error))
    }

    /// Data set, read through a cache of decompressed chunks of `cache_bytes`.
    pub(super) fn cached(&self, path: &str, cache_bytes: usize) -> Result<Dataset, ReadError> {
        let cache = ChunkCacheConfig::new()
            .with_max_bytes(cache_bytes)
            .with_max_slots(1 << 16);
        let properties = DatasetAccessProperties::new().with_chunk_cache(cache);
        let set = self.file.dataset_with_options(path, properties);
        set.map_err(|error| self.fault(path, "a data set", &error))
    }

    pub(super) fn data_set(&self, path: &str) -> Result<Dataset, ReadError> {
        let set = self.file.dataset(path);
        set.map_err(|error| self.fault(path, "a data set", &error))
    }

    pub(super) fn shape(&self, path: &str) -> Result<Vec<u64>, ReadError> {
        let shape = self.data_set(path)?.shape();
        shape.map_err(|error| self.fault(path, "a shape", &error))
    }

    /// Numbers of a data set, with at most `memory_bytes` of memory.
    pub(super) fn numbers(&self, path: &str, memory_bytes: u64) -> Result<Numbers, ReadError> {
        let set = self.data_set(path)?;
        let shape = self.shape(path)?;
        let count = shape.iter().try_fold(1u64, |n, &size| n.checked_mul(size));
        let most_bytes = memory_bytes.min(usize::MAX as u64);
        // Stored and converted values.
        let needed = count.and_then(|count| count.checked_mul(16));
        self.source
            .check_memory(needed.unwrap_or(u64::MAX), most_bytes)?;
        let kind = set
            .dtype()
            .map_err(|error| self.fault(path, "a type", &error))?;
        if !is_number(&kind) {
            return Err(self
                .source
                .malformed(format!("{path}: expected numbers, found {kind}")));
        }
        let values = set
            .read_f64()
            .map_err(|error| self.fault(path, "numbers", &error))?;
        if Some(values.len() as u64) != count {
            return Err(self.source.malformed(format!(
                "{path}: expected values of shape {shape:?}, found {}",
                values.len()
            )));
        }
        Ok(Numbers { shape, values })
    }

    /// Numbers of shape `[rows]`, or `[rows, columns]` for `columns` above 1. All are finite.
    pub(super) fn table(
        &self,
        path: &str,
        rows: u64,
        columns: u64,
        memory_bytes: u64,
    ) -> Result<Vec<f64>, ReadError> {
        let expected = match columns {
            1 => vec![rows],
            _ => vec![rows, columns],
        };
        let shape = self.shape(path)?;
        if shape != expected {
            return Err(self.source.malformed(format!(
                "{path}: expected the shape {expected:?}, found {shape:?}"
            )));
        }
        let values = self.numbers(path, memory_bytes)?.values;
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok(values),
            Some(at) => Err(self.source.malformed(format!(
                "{path}: expected finite values, found {} at index {}",
                values[at],
                at as u64 / columns
            ))),
        }
    }

    /// A single finite number.
    pub(super) fn number(&self, path: &str) -> Result<f64, ReadError> {
        let found = self.numbers(path, 1 << 10)?;
        match found.values[..] {
            [value] if value.is_finite() => Ok(value),
            _ => Err(self.source.malformed(format!(
                "{path}: expected a single finite number, found {:?}",
                found.values
            ))),
        }
    }

    /// A single positive number.
    pub(super) fn positive(&self, path: &str) -> Result<f64, ReadError> {
        match self.number(path)? {
            value if value > 0.0 => Ok(value),
            value => Err(self.source.malformed(format!(
                "{path}: expected a positive number, found {value:?}"
            ))),
        }
    }

    /// Bytes of a data set of one byte a value: integers or an enumeration.
    pub(super) fn bytes(&self, path: &str, count: u64) -> Result<Vec<u8>, ReadError> {
        let set = self.data_set(path)?;
        let (shape, size) = (self.shape(path)?, set.element_size());
        let size = size.map_err(|error| self.fault(path, "a type", &error))?;
        if shape != [count] || size != 1 {
            return Err(self.source.malformed(format!(
                "{path}: expected the shape [{count}] and values of 1 byte, found {shape:?} and {size} bytes"
            )));
        }
        let bytes = set.read_raw_rows(0, count);
        let bytes = bytes.map_err(|error| self.fault(path, "values", &error))?;
        match bytes.len() as u64 == count {
            true => Ok(bytes),
            false => Err(self.source.malformed(format!(
                "{path}: expected {count} values, found {}",
                bytes.len()
            ))),
        }
    }

    /// A text, without blanks around it.
    pub(super) fn text(&self, path: &str) -> Result<String, ReadError> {
        let set = self.data_set(path)?;
        let shape = self.shape(path)?;
        let fault = |error: Error| self.fault(path, "a text", &error);
        let kind = set.dtype().map_err(fault)?;
        let count = shape.iter().try_fold(1u64, |n, &size| n.checked_mul(size));
        let size = set.element_size().map_err(fault)?;
        let stored = count.and_then(|count| count.checked_mul(size));
        let long = || {
            self.source.malformed(format!(
                "{path}: expected a text of at most {MAX_TEXT_BYTES} bytes, found a longer one"
            ))
        };
        if stored.is_none_or(|bytes| bytes > MAX_TEXT_BYTES) {
            return Err(long());
        }
        match kind {
            DType::String => {}
            DType::VariableLengthString => {
                if set.vlen_string_payload_size().map_err(fault)? > MAX_TEXT_BYTES {
                    return Err(long());
                }
            }
            other => {
                return Err(self
                    .source
                    .malformed(format!("{path}: expected a text, found {other}")));
            }
        }
        match set.read_string().map_err(fault)?.as_slice() {
            [text] => Ok(text.trim_matches(['\0', ' ']).to_owned()),
            texts => Err(self.source.malformed(format!(
                "{path}: expected a single text, found {}",
                texts.len()
            ))),
        }
    }

    /// Reference time in the attribute `units` of a data set of times.
    pub(super) fn epoch(&self, path: &str) -> Result<Epoch, ReadError> {
        let attributes = self.data_set(path)?.attrs();
        let attributes = attributes.map_err(|error| self.fault(path, "attributes", &error))?;
        let units = attributes.get("units").and_then(|units| units.as_str());
        let date = units.and_then(|units| units.trim().strip_prefix("seconds since "));
        let epoch = date.and_then(|date| {
            let date = date.trim().trim_end_matches('Z').replacen(' ', "T", 1);
            date::nanoseconds(&format!("{date}Z"))
        });
        epoch.ok_or_else(|| {
            self.source.malformed(format!(
                "{path}: expected the attribute units 'seconds since YYYY-MM-DDThh:mm:ss', found {units:?}"
            ))
        })
    }

    /// Error about an object that is missing or unreadable.
    pub(super) fn fault(&self, path: &str, expected: &str, error: &Error) -> ReadError {
        self.source
            .malformed(format!("{path}: expected {expected}: {error}"))
    }
}
