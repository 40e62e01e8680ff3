//! Files at URLs, opened by fsspec.

use std::fmt;
use std::io;

use pyo3::exceptions::{PyFileNotFoundError, PyPermissionError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use subaperture::io::remote::{FileState, RemoteFile, set_opener};

/// Object of the class `subaperture._remote.RemoteFile`.
struct FsspecFile(Py<PyAny>);

impl fmt::Debug for FsspecFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("FsspecFile")
    }
}

/// Let the library and the command open URLs.
pub(crate) fn install() {
    set_opener(open);
}

fn open(url: &str) -> io::Result<Box<dyn RemoteFile>> {
    called(|py| {
        let class = py.import("subaperture._remote")?.getattr("RemoteFile")?;
        let file: Box<dyn RemoteFile> = Box::new(FsspecFile(class.call1((url,))?.unbind()));
        Ok(file)
    })
}

impl RemoteFile for FsspecFile {
    fn state(&self) -> io::Result<FileState> {
        called(|py| {
            let (bytes, version) = self.0.bind(py).call_method0("state")?.extract()?;
            Ok(FileState { bytes, version })
        })
    }

    fn read_at(&self, offset: u64, bytes: &mut [u8]) -> io::Result<()> {
        called(|py| {
            let read = self
                .0
                .bind(py)
                .call_method1("read", (offset, bytes.len()))?;
            let read = read.cast::<PyBytes>()?.as_bytes();
            if read.len() != bytes.len() {
                return Ok(Err(io::ErrorKind::UnexpectedEof.into()));
            }
            bytes.copy_from_slice(read);
            Ok(Ok(()))
        })?
    }
}

/// Call Python with the interpreter lock, from any thread. Its exceptions become errors with their texts.
fn called<T>(call: impl FnOnce(Python<'_>) -> PyResult<T>) -> io::Result<T> {
    Python::attach(|py| {
        call(py).map_err(|error| {
            let kind = if error.is_instance_of::<PyFileNotFoundError>(py) {
                io::ErrorKind::NotFound
            } else if error.is_instance_of::<PyPermissionError>(py) {
                io::ErrorKind::PermissionDenied
            } else {
                io::ErrorKind::Other
            };
            let class = error.get_type(py).name().map(|name| name.to_string());
            let text = format!("{}: {}", class.unwrap_or_default(), error.value(py));
            io::Error::new(kind, text)
        })
    })
}
