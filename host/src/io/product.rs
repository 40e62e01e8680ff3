//! The folder that `subap focus` leaves: image, metadata, quicklook; complete or absent.
//!
//! | file | holds |
//! |---|---|
//! | `image.npy` | complex64, rows (y ascending) x columns (x ascending) |
//! | `image.json` | axes, frame, settings; under `files` the size and CRC-32 of the other two |
//! | `image.png` | the quicklook |
//!
//! How it is complete or absent. All three are written, and forced to disk, in a hidden staging folder
//! on the same file system. Then
//! - if the folder does not exist, the staging folder is renamed to it: one step;
//! - if it exists, whatever else lies in it stays, and `image.json` is the mark of a whole product:
//!   an old one is removed first, image and quicklook are renamed into place, and the new
//!   `image.json` last. Whoever finds it finds the other two, and by `files` can tell that they are
//!   the same product's even if they were replaced while being read.
//!
//! An error on the way removes the staging folder; only a killed process or a power cut leaves one
//! (`.subap-*`), never a product in part.
//!
//! [`read`] reads one back.

mod read;

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::atomic::{WriteError, plain, sync_folder};
use super::npy;
use crate::image::Image;

pub use read::{ReadError, StoredProduct, read};

const IMAGE: &str = "image.npy";
const METADATA: &str = "image.json";
const QUICKLOOK: &str = "image.png";

/// What a folder is to hold.
#[derive(Clone, Copy, Debug)]
pub struct Product<'a> {
    /// The image.
    pub image: &'a Image,
    /// Everything that should be known of it: a JSON object, to which `files` is added.
    pub metadata: &'a Value,
    /// The picture, as the bytes of a PNG file.
    pub quicklook: &'a [u8],
}

impl Product<'_> {
    /// Checks, before the work, that a product of this many pixels can go into `folder`: that it or
    /// its nearest existing parent can be written to, that nothing is in the way, and that the disk
    /// has room for the image (as an ordinary user sees it). Leaves nothing behind.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn prepare(folder: &Path, num_pixels: u64) -> Result<(), WriteError> {
        let needed_bytes = npy::file_bytes(num_pixels);
        let failed = |source| WriteError::Io {
            path: folder.to_owned(),
            needed_bytes,
            source,
        };
        let base = staging_place(folder)?;
        drop(stage(&base).map_err(failed)?);
        for name in [IMAGE, METADATA, QUICKLOOK] {
            let path = folder.join(name);
            if path.is_dir() {
                let what = "a folder of that name is in the way";
                return Err(WriteError::Blocked { path, what });
            }
        }
        // Where the system cannot tell, writing will.
        match fs4::available_space(&base) {
            Ok(free_bytes) if free_bytes < needed_bytes => Err(WriteError::NoSpace {
                path: folder.to_owned(),
                needed_bytes,
                free_bytes,
            }),
            _ => Ok(()),
        }
    }

    /// Writes the three files into `folder`, which is made if need be, with its parents.
    ///
    /// # Errors
    /// [`WriteError`]; then the folder is as it was, or, if replacing an older product failed half way,
    /// without an `image.json`.
    ///
    /// # Panics
    /// If `metadata` is not an object.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let needed_bytes =
            npy::file_bytes(self.image.pixels.len() as u64) + self.quicklook.len() as u64;
        let failed = |name: &str| {
            let path = folder.join(name);
            move |source| WriteError::Io {
                path,
                needed_bytes,
                source,
            }
        };
        let staging = stage(&staging_place(folder)?).map_err(failed(""))?;
        let image = write_file(&staging.path().join(IMAGE), |out| {
            npy::write_to(out, self.image)
        })
        .map_err(failed(IMAGE))?;
        let quicklook = write_file(&staging.path().join(QUICKLOOK), |out| {
            out.write_all(self.quicklook)
        })
        .map_err(failed(QUICKLOOK))?;
        let mut metadata = self.metadata.clone();
        metadata
            .as_object_mut()
            .expect("metadata is a JSON object")
            .insert(
                "files".to_owned(),
                json!({ IMAGE: image, QUICKLOOK: quicklook }),
            );
        write_file(&staging.path().join(METADATA), |out| {
            serde_json::to_writer_pretty(&mut *out, &metadata)?;
            out.write_all(b"\n")
        })
        .map_err(failed(METADATA))?;
        sync_folder(staging.path()).map_err(failed(""))?;
        if folder.is_dir() {
            replace(staging.path(), folder).map_err(failed(""))
        } else {
            place(staging.path(), folder).map_err(failed(""))?;
            // The staging folder is the product now: nothing is left to remove.
            let _ = staging.keep();
            Ok(())
        }
    }
}

/// Where to stage: in the folder itself, or in its nearest existing parent.
fn staging_place(folder: &Path) -> Result<PathBuf, WriteError> {
    let absolute = std::path::absolute(folder).map_err(|source| WriteError::Io {
        path: folder.to_owned(),
        needed_bytes: 0,
        source,
    })?;
    for place in absolute.ancestors() {
        match fs::metadata(place) {
            Ok(metadata) if metadata.is_dir() => return Ok(place.to_owned()),
            Ok(_) => {
                return Err(WriteError::Blocked {
                    path: folder.to_owned(),
                    what: "it, or a part of its path, is a file and not a folder",
                });
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            // A file where a folder should be: its own turn comes.
            Err(error) if error.kind() == io::ErrorKind::NotADirectory => {}
            Err(source) => {
                return Err(WriteError::Io {
                    path: folder.to_owned(),
                    needed_bytes: 0,
                    source,
                });
            }
        }
    }
    Ok(PathBuf::from("."))
}

/// A staging folder in `place`, with the permissions of any other folder; removed when dropped.
fn stage(place: &Path) -> io::Result<tempfile::TempDir> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".subap-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
    builder.tempdir_in(place).map_err(plain)
}

/// Writes a file to the disk, not only to the system's memory; its size and CRC-32.
fn write_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<Checked>) -> io::Result<()>,
) -> io::Result<Value> {
    let mut out = BufWriter::new(Checked {
        file: File::create_new(path)?,
        bytes: 0,
        crc: crc32fast::Hasher::new(),
    });
    write(&mut out)?;
    let checked = out.into_inner().map_err(io::IntoInnerError::into_error)?;
    checked.file.sync_all()?;
    let crc32 = format!("{:08x}", checked.crc.finalize());
    Ok(json!({ "bytes": checked.bytes, "crc32": crc32 }))
}

/// A file and the CRC-32 of what went into it.
struct Checked {
    file: File,
    bytes: u64,
    crc: crc32fast::Hasher,
}

impl Write for Checked {
    fn write(&mut self, data: &[u8]) -> io::Result<usize> {
        let count = self.file.write(data)?;
        self.crc.update(&data[..count]);
        self.bytes += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Moves the staged files over those of an existing folder, `image.json` first off and last on.
fn replace(staging: &Path, folder: &Path) -> io::Result<()> {
    match fs::remove_file(folder.join(METADATA)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => sync_folder(folder)?,
    }
    for name in [IMAGE, QUICKLOOK] {
        fs::rename(staging.join(name), folder.join(name))?;
    }
    sync_folder(folder)?;
    fs::rename(staging.join(METADATA), folder.join(METADATA))?;
    sync_folder(folder)
}

/// Renames the staging folder to one that does not exist yet, making its parents.
fn place(staging: &Path, folder: &Path) -> io::Result<()> {
    let folder = std::path::absolute(folder)?;
    let parent = folder.parent().unwrap_or(Path::new("/"));
    let made: Vec<&Path> = parent.ancestors().take_while(|p| !p.exists()).collect();
    fs::create_dir_all(parent)
        .and_then(|()| fs::rename(staging, &folder))
        .inspect_err(|_| {
            // Innermost first. One that someone else has begun to use is not empty, and stays.
            for folder in &made {
                let _ = fs::remove_dir(folder);
            }
        })?;
    sync_folder(parent)
}
