//! Output folder of `subap focus` with image, metadata and quicklook, written atomically.
//!
//! | file | holds |
//! |---|---|
//! | `image.npy` | complex64, rows (y ascending) x columns (x ascending) |
//! | `image.zarr` | in its place, an image that was formed in tiles ([`tiles`]) |
//! | `image.json` | axes, frame, settings; under `files` the size and CRC-32 of the other two |
//! | `image.png` | the quicklook, if there is one |
//!
//! How it is complete or absent. All three are written, and forced to disk side by side, in a hidden staging folder
//! on the same file system. Then
//! - if the folder does not exist, the staging folder is renamed to it: one step;
//! - if it exists, whatever else lies in it stays, and `image.json` is the mark of a whole product:
//!   an old one is removed first, image and quicklook are renamed into place, and the new
//!   `image.json` last. Whoever finds it finds the other two, and by `files` can tell that they are
//!   the same product's even if they were replaced while being read. A failed rename undoes the earlier ones.
//!
//! An error on the way removes the staging folder; only a killed process or a power cut leaves one
//! (`.subap-*`), never a product in part, and the next run that writes there removes it.
//!
//! [`read`] reads one back.

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
use super::staging::{Names, Staged, StagedSet};
use super::tiles::{self, TileStore};
use super::together::FileSet;
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

/// What a folder is to hold beside an image in tiles, all of which are there.
#[derive(Clone, Copy, Debug)]
pub struct TiledProduct<'a> {
    /// The image.
    pub store: &'a TileStore,
    /// As [`Product::metadata`].
    pub metadata: &'a Value,
    /// As [`Product::quicklook`].
    pub quicklook: &'a [u8],
}

impl TiledProduct<'_> {
    /// Writes record and picture into `folder`, in which the store lies.
    ///
    /// # Errors
    /// [`WriteError`], as [`Product::write`].
    ///
    /// # Panics
    /// If `metadata` is not an object.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let tiling = self.store.tiling();
        let image = json!({ "tiles": tiling.count(), "bytes": tiles::disk_bytes(&tiling) });
        let files = json!({ tiles::NAME: image });
        write_beside(folder, self.metadata, self.quicklook, files)
    }
}

/// Writes record and picture; `files` are what else the record is of.
fn write_beside(
    folder: &Path,
    metadata: &Value,
    quicklook: &[u8],
    mut files: Value,
) -> Result<(), WriteError> {
    let staged = Staged::begin(folder, quicklook.len() as u64)?;
    files[QUICKLOOK] = staged.write(QUICKLOOK, |out| out.write_all(quicklook))?;
    write_metadata(&staged, metadata, files)?;
    commit(staged.complete(names(&[QUICKLOOK], &[])))
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

/// What a folder is to hold.
#[derive(Clone, Copy, Debug)]
pub struct Product<'a> {
    /// The image.
    pub image: &'a Image,
    /// Everything that should be known of it: a JSON object, to which `files` is added.
    pub metadata: &'a Value,
    /// The picture, as the bytes of a PNG file; empty if there is none.
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
        let staged = Staged::begin(folder, npy::file_bytes(num_pixels))?;
        staged.check([IMAGE, METADATA, QUICKLOOK])
    }

    /// Writes the files into `folder`, which is made if need be, with its parents. A picture of an older product goes if
    /// there is no new one.
    ///
    /// # Errors
    /// [`WriteError`]; then the folder is as it was.
    ///
    /// # Panics
    /// If `metadata` is not an object.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let mut alone = FileSet::new();
        self.add_to(&mut alone, folder)?;
        alone.commit()
    }

    /// As [`Self::write`], put in place with the other files of a set.
    ///
    /// # Errors
    /// [`WriteError`].
    ///
    /// # Panics
    /// If `metadata` is not an object.
    pub fn add_to(&self, files: &mut FileSet, folder: &Path) -> Result<(), WriteError> {
        let needed_bytes =
            npy::file_bytes(self.image.pixels.len() as u64) + self.quicklook.len() as u64;
        let staged = Staged::begin(folder, needed_bytes)?;
        let image = staged.write(IMAGE, |out| npy::write_to(out, self.image))?;
        files.add_folder(finish(staged, image, self.metadata, self.quicklook)?);
        Ok(())
    }
}

/// Writes an image in memory, the record that `describe` makes and the picture that `draw` makes into `folder`, as [`Product::write`]
/// does; gives the record back. The image is written, and forced to the disk, and described while the picture is drawn.
///
/// # Errors
/// As [`Product::write`]; that of `draw`, with nothing left behind.
///
/// # Panics
/// If what `describe` makes is not an object.
pub fn write_drawing<E: From<WriteError>>(
    folder: &Path,
    image: &Image,
    describe: impl Fn() -> Value + Sync,
    draw: impl FnOnce() -> Result<Vec<u8>, E>,
) -> Result<Value, E> {
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
            // One after the other, where there is no other thread.
            Err(_) => write(),
        };
        (written, drawn)
    });
    commit(finish(staged, written?, &metadata, &drawn?)?)?;
    Ok(metadata)
}

/// Writes record and picture of a staged image, whose file `image` describes. A picture of an older product goes if there is no
/// new one.
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
        true => names(&[IMAGE], &[QUICKLOOK]),
        false => names(&[IMAGE, QUICKLOOK], &[]),
    }))
}

fn names(files: &[&str], gone: &[&str]) -> Names {
    let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    Names {
        files: owned(files),
        marks: vec![METADATA.to_owned()],
        gone: owned(gone),
    }
}

/// The set alone, moved into place.
fn commit(set: StagedSet) -> Result<(), WriteError> {
    let mut alone = FileSet::new();
    alone.add_folder(set);
    alone.commit()
}
