//! Channels of a CPHD or CRSD file: selection, opening and sizes of their arrays.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::{Block, Blocks, Element, MetadataError, SignalFormat, Source};
use subaperture_model::phase_history::{ChannelError, PhaseHistory, ReadError, which_channel};

/// Channels stated by a file.
pub(crate) struct Table<'f> {
    pub(crate) source: &'f Source,
    pub(crate) blocks: &'f Blocks,
    /// Identifier and arrays of each channel, in the order of the file.
    pub(crate) channels: Vec<(&'f str, &'f Arrays)>,
    /// Identifier of the reference channel, and the path of the element that states it.
    pub(crate) reference: (&'f str, &'static str),
    /// Size of a record of per-vector parameters, bytes.
    pub(crate) record_bytes: u64,
    pub(crate) format: SignalFormat,
    /// Name of the compression of the signal arrays.
    pub(crate) compression: Option<&'f str>,
}

/// An open file with channels.
pub(crate) trait ChannelFile: Sized {
    /// Read header and XML, within `memory_bytes`.
    fn open(source: Source, memory_bytes: u64) -> Result<Self, ReadError>;

    fn table(&self) -> Table<'_>;

    /// Check contents that only this format has.
    fn check(&self) -> Result<(), String> {
        Ok(())
    }
}

/// Open channel of a file.
pub(crate) trait FileChannel: PhaseHistory + Sized {
    /// File of the channel.
    type File: ChannelFile;

    /// Open a channel, by its index.
    fn of(file: Arc<Self::File>, channel: usize, memory_bytes: u64) -> Result<Self, ReadError>;
}

/// Open a channel by its identifier or its number from 1; the reference channel for `None`.
pub(crate) fn open_one<T: FileChannel>(
    source: Source,
    channel: Option<&str>,
    memory_bytes: u64,
) -> Result<T, ReadError> {
    let file = T::File::open(source, memory_bytes)?;
    let table = file.table();
    let chosen = table.index(channel);
    let chosen = chosen.map_err(|what| table.source.malformed(what))?;
    check(&file)?;
    T::of(Arc::new(file), chosen, memory_bytes)
}

/// Open channels, each by its identifier or its number from 1; all for `None`. The file is opened once; the channels share its memory.
pub(crate) fn open_several<T: FileChannel, S: AsRef<str>>(
    source: Source,
    channels: Option<&[S]>,
    memory_bytes: u64,
) -> Result<Vec<T>, ReadError> {
    let file = Arc::new(T::File::open(source, memory_bytes)?);
    let ids = file.table().ids();
    let chosen: Vec<usize> = match channels {
        None => (0..ids.len()).collect(),
        Some(wanted) => {
            let places = wanted.iter().map(|id| which_channel(&ids, id.as_ref()));
            places.collect::<Result<_, _>>()?
        }
    };
    check(&*file)?;
    let mut left_bytes = memory_bytes;
    let mut opened = Vec::new();
    for channel in chosen {
        let next = T::of(Arc::clone(&file), channel, left_bytes)?;
        left_bytes -= next.held_bytes();
        opened.push(next);
    }
    Ok(opened)
}

/// Check that the arrays of all channels can be read and lie within their blocks.
fn check(file: &impl ChannelFile) -> Result<(), ReadError> {
    let table = file.table();
    let checked = table
        .check_compression()
        .and_then(|()| file.check())
        .and_then(|()| table.check_arrays());
    checked.map_err(|what| table.source.malformed(what))
}

impl<'f> Table<'f> {
    fn ids(&self) -> Vec<&'f str> {
        self.channels.iter().map(|(id, _)| *id).collect()
    }

    /// Index of the channel of this identifier or number; of the reference channel for `None`.
    fn index(&self, channel: Option<&str>) -> Result<usize, String> {
        let ids = self.ids();
        if let Some(id) = channel {
            return which_channel(&ids, id).map_err(|error| error.to_string());
        }
        let (reference, stated_at) = self.reference;
        let found = ids.iter().position(|id| *id == reference);
        found.ok_or_else(|| {
            let unknown = ChannelError::Unknown {
                wanted: reference.to_owned(),
                names: ids.iter().map(|id| (*id).to_owned()).collect(),
            };
            format!("{stated_at}: {unknown}")
        })
    }

    fn check_compression(&self) -> Result<(), String> {
        self.compression.map_or(Ok(()), |name| {
            Err(format!(
                "the signal arrays are compressed ('{name}'); only uncompressed CI2, CI4 and CF8 are read: decompress the file with its \
                 producer's tool"
            ))
        })
    }

    fn check_arrays(&self) -> Result<(), String> {
        for (id, arrays) in &self.channels {
            let Arrays {
                num_vectors,
                num_samples,
                pvp_offset,
                signal_offset,
            } = arrays;
            let what = |array: &str| {
                format!(
                    "channel '{id}': its {array} array ({num_vectors} vectors of {num_samples} samples)"
                )
            };
            let records = num_vectors.checked_mul(self.record_bytes);
            (self.blocks.pvp).check_array("PVP", *pvp_offset, records, || what("PVP"))?;
            let samples = num_vectors.checked_mul(*num_samples);
            let bytes = samples.and_then(|n| n.checked_mul(self.format.sample_bytes() as u64));
            (self.blocks.signal).check_array("signal", *signal_offset, bytes, || what("signal"))?;
        }
        Ok(())
    }
}

/// Name of a channel's phase history: that of the collection, else of the file; with the identifier where there are several channels.
pub(crate) fn history_name(
    collection: Option<&str>,
    path: &Path,
    id: &str,
    channels: usize,
) -> String {
    let file = || path.file_name().map(|n| n.to_string_lossy().into_owned());
    let name = collection.filter(|n| !n.is_empty()).map(str::to_owned);
    let name = name.or_else(file).unwrap_or_default();
    match channels {
        1 => name,
        _ => format!("{name} channel {id}"),
    }
}

/// Elements `Parameters` by `Identifier`, the first of each: a search for every channel would be quadratic in their number.
pub(crate) fn parameters<'a, 'i>(
    channel_node: Element<'a, 'i>,
) -> HashMap<String, Element<'a, 'i>> {
    let mut by_id = HashMap::new();
    for entry in channel_node.children("Parameters") {
        if let Some(id) = entry.optional_text("Identifier") {
            by_id.entry(id).or_insert(entry);
        }
    }
    by_id
}

/// Arrays of a channel as stated by its element in `Data`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Arrays {
    /// Number of vectors, at least 1.
    pub(crate) num_vectors: u64,
    /// Samples of a vector, at least 1.
    pub(crate) num_samples: u64,
    /// Bytes from the beginning of the PVP block.
    pub(crate) pvp_offset: u64,
    /// Bytes from the beginning of the signal block.
    pub(crate) signal_offset: u64,
}

impl Arrays {
    pub(crate) fn of(entry: Element) -> Result<Self, MetadataError> {
        let positive = |name| -> Result<u64, MetadataError> {
            let element = entry.child(name)?;
            match element.count()? {
                0 => Err(element.fault("0: the channel is empty")),
                n => Ok(n),
            }
        };
        Ok(Self {
            num_vectors: positive("NumVectors")?,
            num_samples: positive("NumSamples")?,
            pvp_offset: entry.child("PVPArrayByteOffset")?.count()?,
            signal_offset: entry.child("SignalArrayByteOffset")?.count()?,
        })
    }
}

impl Block {
    /// Check that an array lies within this block; `bytes` is `None` if its size overflows, `what` describes it.
    pub(crate) fn check_array(
        &self,
        name: &str,
        offset: u64,
        bytes: Option<u64>,
        what: impl FnOnce() -> String,
    ) -> Result<(), String> {
        match bytes.and_then(|bytes| offset.checked_add(bytes)) {
            Some(end) if end <= self.size => Ok(()),
            _ => Err(format!(
                "{} at offset {offset} does not fit the {name} block of {} bytes at byte {}; the XML is damaged",
                what(),
                self.size,
                self.offset
            )),
        }
    }
}
