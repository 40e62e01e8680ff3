//! Files at URLs, read by ranges of bytes.
//!
//! The library opens no connections. A program passes an [`Opener`] to [`set_opener`] once; the Python package passes one that uses fsspec.
//! From then on, paths such as `s3://bucket/recording.cphd` are opened by it. Reads are aligned to blocks of [`BLOCK_BYTES`], and the last
//! [`KEPT_BLOCKS`] are kept: neighbouring pulses arrive with one request.

#[cfg(any(feature = "container", feature = "npz"))]
mod blocks;

use std::fmt::Debug;
use std::io;
use std::path::Path;
use std::sync::OnceLock;

#[cfg(any(feature = "container", feature = "npz"))]
pub(crate) use blocks::Remote;
#[cfg(any(feature = "gotcha", feature = "npz"))]
use subaperture_model::phase_history::ReadError;

/// Size of a request, bytes.
pub const BLOCK_BYTES: u64 = 4 << 20;
/// Number of blocks kept in memory for each open file. Each thread holds one more while it reads.
pub const KEPT_BLOCKS: usize = 8;

/// Size and version of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileState {
    /// Size, bytes.
    pub bytes: u64,
    /// Text that changes with the content, such as an HTTP entity tag.
    pub version: String,
}

/// File behind a URL.
pub trait RemoteFile: Debug + Send + Sync {
    /// Current size and version, as the server states them.
    ///
    /// # Errors
    /// The server's refusal, or that of the network.
    fn state(&self) -> io::Result<FileState>;

    /// Fill `bytes` with the content from byte `offset` on.
    ///
    /// # Errors
    /// As [`Self::state`]; [`io::ErrorKind::UnexpectedEof`] if the file is shorter.
    fn read_at(&self, offset: u64, bytes: &mut [u8]) -> io::Result<()>;
}

/// Function that opens a URL.
pub type Opener = fn(url: &str) -> io::Result<Box<dyn RemoteFile>>;

static OPENER: OnceLock<Opener> = OnceLock::new();

/// Set the opener of URLs of this process. Only the first call has an effect; returns whether this was it.
pub fn set_opener(opener: Opener) -> bool {
    OPENER.set(opener).is_ok()
}

/// The URL that a path is, such as `https://host/file`. The drive of a path on Windows has one letter and makes no URL.
pub fn url(path: &Path) -> Option<&str> {
    let text = path.to_str()?;
    let (scheme, _) = text.split_once("://")?;
    let in_scheme = |c: char| c.is_ascii_alphanumeric() || "+-.:".contains(c);
    (scheme.len() > 1 && scheme.chars().all(in_scheme)).then_some(text)
}

/// First bytes of the file at a URL, at most `count`.
///
/// # Errors
/// As [`Remote::open`].
pub(crate) fn start(url: &str, count: usize) -> io::Result<Vec<u8>> {
    let file = opened(url)?;
    let count = file.state()?.bytes.min(count as u64);
    let mut bytes = vec![0; count as usize];
    file.read_at(0, &mut bytes)?;
    Ok(bytes)
}

/// Content of the file at a URL, within `memory_bytes`; `None` for a local path.
///
/// # Errors
/// [`ReadError::Memory`] if the file is larger; [`ReadError::Io`].
#[cfg(any(feature = "gotcha", feature = "npz"))]
pub(crate) fn content(path: &Path, memory_bytes: u64) -> Result<Option<Vec<u8>>, ReadError> {
    let Some(url) = url(path) else {
        return Ok(None);
    };
    let io = |source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let file = opened(url).map_err(io)?;
    let needed_bytes = file.state().map_err(io)?.bytes;
    let too_large = || ReadError::Memory {
        path: path.to_owned(),
        needed_bytes,
        allowed_bytes: memory_bytes,
    };
    let size = usize::try_from(needed_bytes).ok();
    let size = size.filter(|_| needed_bytes <= memory_bytes);
    let mut bytes = Vec::new();
    size.and_then(|size| bytes.try_reserve_exact(size).ok())
        .ok_or_else(too_large)?;
    bytes.resize(needed_bytes as usize, 0);
    file.read_at(0, &mut bytes).map_err(io)?;
    Ok(Some(bytes))
}

fn opened(url: &str) -> io::Result<Box<dyn RemoteFile>> {
    let Some(opener) = OPENER.get() else {
        return Err(io::Error::new(
            io::ErrorKind::Unsupported,
            "expected a local file, found a URL, which this program does not open: copy the file, or use the command of the \
             Python package (pip install subaperture fsspec)",
        ));
    };
    opener(url)
}

/// Open an HDF5 file, on disk or at a URL; data are read on demand.
///
/// # Errors
/// Text of the error, without the path.
#[cfg(feature = "hdf5")]
pub(crate) fn hdf5(path: &Path) -> Result<hdf5_pure::File, String> {
    let file = match url(path) {
        Some(url) => {
            let remote = Remote::open(url).map_err(|error| error.to_string())?;
            hdf5_pure::File::from_source(remote)
        }
        None => hdf5_pure::File::open_streaming(path),
    };
    file.map_err(|error| format!("unreadable HDF5 file: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_are_recognised_and_paths_are_not() {
        for text in [
            "s3://bucket/a.cphd",
            "https://host/a",
            "simplecache::gs://b/c",
        ] {
            assert_eq!(url(Path::new(text)), Some(text));
        }
        for text in ["a.cphd", "/tmp/a", "C://a", "C:\\a", "a b://c", "://a"] {
            assert_eq!(url(Path::new(text)), None, "{text}");
        }
    }
}
