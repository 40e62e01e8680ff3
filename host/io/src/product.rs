//! Output folder of `subap focus` with image, metadata and quicklook, written atomically.
//!
//! | file | content |
//! |---|---|
//! | `image.npy` | complex64, rows (y ascending) x columns (x ascending) |
//! | `image.zarr` | replaces `image.npy` for an image formed in tiles ([`tiles`]) |
//! | `image.json` | axes, frame, settings; under `files` the size and CRC-32 of the other two files |
//! | `image.png` | quicklook, optional |
//!
//! **Atomic output.** All files are written and synced in a hidden staging folder on the same file system. Then
//! - if the folder does not exist, the staging folder is renamed to it in one step;
//! - if it exists, its other files remain, and `image.json` marks a complete product: the old one is removed first,
//!   image and quicklook are renamed into place, and the new `image.json` last. A reader that sees `image.json` also
//!   sees the other two, and can verify by `files` that they belong to it even if they are replaced while being read.
//!   A failed rename undoes the earlier ones.
//!
//! An error removes the staging folder. Only a killed process or a power cut leaves one (`.subap-*`), never a partial
//! product; the next run that writes there removes it.
//!
//! [`read`] reads a product.

mod antennas;
mod frame;
mod growing;
mod read;
pub mod record;

use std::io::Write;
use std::panic::resume_unwind;
use std::path::Path;
use std::thread;

use serde_json::{Value, json};

use super::atomic::WriteError;
use super::npy;
use super::staging::{Contents, Staged, StagedEntry, StagedSet};
use super::tiles::{self, TileStore};
use super::together::FileSet;
use super::written::{FileKind, WrittenFile};
use subaperture_model::image::Image;

pub use antennas::Antennas;
pub use frame::frame_of;
pub use growing::{CompleteProduct, PendingProduct};
pub use read::{
    OpenProduct, Pixels, RECORD_LIMITS, ReadError, StoredProduct, open, open_unread, read,
    record as read_record, verify,
};

const IMAGE: &str = "image.npy";
const METADATA: &str = "image.json";
const QUICKLOOK: &str = "image.png";

/// Names of the files of a product.
pub const NAMES: [&str; 3] = [IMAGE, METADATA, QUICKLOOK];

/// Names of the files of a product in tiles, in addition to [`tiles::NAME`].
pub const TILED_NAMES: [&str; 2] = [METADATA, QUICKLOOK];

/// Content of an output folder with an image in tiles, all complete.
#[derive(Clone, Copy, Debug)]
pub struct TiledProduct<'a> {
    /// Image.
    pub store: &'a TileStore,
    /// See [`Product::metadata`].
    pub metadata: &'a Value,
    /// See [`Product::quicklook`].
    pub quicklook: &'a [u8],
}

impl TiledProduct<'_> {
    /// Write record and picture into `folder`, which contains the store. Returns all files, the store first.
    ///
    /// # Errors
    /// [`WriteError`], as [`Product::write`].
    ///
    /// # Panics
    /// Panics if `metadata` is not an object.
    pub fn write(&self, folder: &Path) -> Result<Vec<WrittenFile>, WriteError> {
        let tiling = self.store.tiling();
        let image = json!({ "tiles": tiling.count(), "bytes": tiles::disk_bytes(&tiling) });
        let files = json!({ tiles::NAME: image });
        let others = write_beside(folder, self.metadata, self.quicklook, files)?;
        let store = WrittenFile::new(folder.join(tiles::NAME), FileKind::Image);
        Ok([store].into_iter().chain(others).collect())
    }
}

/// Write record and picture; `files` describes the other files of the product.
fn write_beside(
    folder: &Path,
    metadata: &Value,
    quicklook: &[u8],
    mut files: Value,
) -> Result<Vec<WrittenFile>, WriteError> {
    let staged = Staged::begin(folder, quicklook.len() as u64)?;
    files[QUICKLOOK] = staged.write(QUICKLOOK, |out| out.write_all(quicklook))?;
    write_metadata(&staged, metadata, files)?;
    commit(staged.complete(Contents {
        files: [METADATA, QUICKLOOK].map(entry).into(),
        gone: Vec::new(),
    }))
}

fn write_metadata(staged: &Staged, metadata: &Value, files: Value) -> Result<(), WriteError> {
    let mut metadata = metadata.clone();
    metadata
        .as_object_mut()
        .expect("metadata is a JSON object")
        .insert("files".to_owned(), files);
    staged.write(METADATA, |out| {
        serde_json::to_writer_pretty(&mut *out, &metadata)?;
        out.write_all(b"\n")
    })?;
    Ok(())
}

/// Content of an output folder.
#[derive(Clone, Copy, Debug)]
pub struct Product<'a> {
    /// Image.
    pub image: &'a Image,
    /// Metadata of the image: a JSON object, to which `files` is added.
    pub metadata: &'a Value,
    /// Picture as the bytes of a PNG file; empty for none.
    pub quicklook: &'a [u8],
}

impl Product<'_> {
    /// Check before the work that a product of this many pixels can be written to `folder`: the folder or its nearest
    /// existing parent is writable, its names are free, and the disk has room for the image (for an ordinary user).
    /// Writes nothing.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn prepare(folder: &Path, num_pixels: u64) -> Result<(), WriteError> {
        let staged = Staged::begin(folder, npy::file_bytes(num_pixels))?;
        staged.check([IMAGE, METADATA, QUICKLOOK])
    }

    /// Write the files into `folder`, which is created with its parents if missing. Without a new picture, the
    /// picture of an older product is removed.
    ///
    /// # Errors
    /// [`WriteError`]; the folder is then unchanged.
    ///
    /// # Panics
    /// Panics if `metadata` is not an object.
    pub fn write(&self, folder: &Path) -> Result<Vec<WrittenFile>, WriteError> {
        let mut alone = FileSet::new();
        self.add_to(&mut alone, folder)?;
        alone.commit()
    }

    /// Like [`Self::write`], renamed together with the other files of a set.
    ///
    /// # Errors
    /// [`WriteError`].
    ///
    /// # Panics
    /// Panics if `metadata` is not an object.
    pub fn add_to(&self, files: &mut FileSet, folder: &Path) -> Result<(), WriteError> {
        let needed_bytes =
            npy::file_bytes(self.image.pixels.len() as u64) + self.quicklook.len() as u64;
        let staged = Staged::begin(folder, needed_bytes)?;
        let image = staged.write(IMAGE, |out| npy::write_to(out, self.image))?;
        files.add_folder(finish(staged, image, self.metadata, self.quicklook)?);
        Ok(())
    }
}

/// Write an image from memory, the record made by `describe` and the picture made by `draw` into `folder` like
/// [`Product::write`]. The image is written, synced and described while the picture is drawn.
///
/// # Errors
/// As [`Product::write`]; the error of `draw`. Nothing is then written.
///
/// # Panics
/// Panics if `describe` does not return an object.
pub fn write_drawing<E: From<WriteError>>(
    folder: &Path,
    image: &Image,
    describe: impl Fn() -> Value + Sync,
    draw: impl FnOnce() -> Result<Vec<u8>, E>,
) -> Result<Vec<WrittenFile>, E> {
    let staged = Staged::begin(folder, npy::file_bytes(image.pixels.len() as u64))?;
    let write = || {
        let written = staged.write(IMAGE, |out| npy::write_to(out, image));
        (written, describe())
    };
    let ((written, metadata), drawn) = thread::scope(|scope| {
        let writing = thread::Builder::new().spawn_scoped(scope, write);
        let drawn = draw();
        let written = match writing {
            Ok(writing) => writing.join().unwrap_or_else(|panic| resume_unwind(panic)),
            // Sequentially if no thread can be started.
            Err(_) => write(),
        };
        (written, drawn)
    });
    Ok(commit(finish(staged, written?, &metadata, &drawn?)?)?)
}

/// Write record and picture of a staged image, whose file `image` describes. Without a new picture, the picture of an
/// older product is removed.
fn finish(
    staged: Staged,
    image: Value,
    metadata: &Value,
    quicklook: &[u8],
) -> Result<StagedSet, WriteError> {
    let mut files = json!({ IMAGE: image });
    if !quicklook.is_empty() {
        files[QUICKLOOK] = staged.write(QUICKLOOK, |out| out.write_all(quicklook))?;
    }
    write_metadata(&staged, metadata, files)?;
    Ok(staged.complete(match quicklook.is_empty() {
        true => Contents {
            files: [IMAGE, METADATA].map(entry).into(),
            gone: vec![QUICKLOOK],
        },
        false => Contents {
            files: NAMES.map(entry).into(),
            gone: Vec::new(),
        },
    }))
}

/// File of a product by its name.
fn entry(name: &str) -> StagedEntry {
    let kind = match name {
        METADATA => FileKind::Record,
        QUICKLOOK => FileKind::Picture,
        _ => FileKind::Image,
    };
    StagedEntry {
        file: WrittenFile::new(name, kind),
        is_mark: name == METADATA,
    }
}

/// Rename a single set into place.
fn commit(set: StagedSet) -> Result<Vec<WrittenFile>, WriteError> {
    let mut alone = FileSet::new();
    alone.add_folder(set);
    alone.commit()
}
