//! Images as they are stored: a product, by its folder or its `image.json`, or an array alone.

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::bail;
use serde_json::Value;
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::io::{npy, product};

use crate::config::Session;
use crate::text;

/// An image, and what is stored beside it.
pub(super) struct Stored {
    pub(super) path: PathBuf,
    pub(super) image: Image,
    /// Grid and record of a product.
    pub(super) product: Option<(ImageGrid, Value)>,
}

/// The folder of the product that a path names: itself, or that of its `image.json`.
pub(super) fn product_folder(path: &Path) -> Option<&Path> {
    if path.is_dir() {
        return Some(path);
    }
    let is_record = path.file_name().is_some_and(|name| name == "image.json");
    let folder = path.parent().filter(|_| is_record)?;
    Some(match folder == Path::new("") {
        true => Path::new("."),
        false => folder,
    })
}

/// Reads a product or a complex64 `.npy`.
pub(super) fn read(path: &Path) -> anyhow::Result<Stored> {
    let path = path.to_owned();
    if let Some(folder) = product_folder(&path) {
        if is_velocity_plane(folder) {
            return Ok(Stored {
                image: npy::read(&folder.join("image.npy"))?,
                product: None,
                path,
            });
        }
        let stored = product::read(folder)?;
        return Ok(Stored {
            image: stored.image,
            product: Some((stored.grid, stored.metadata)),
            path,
        });
    }
    check_is_array(&path)?;
    let image = npy::read(&path)?;
    if image.pixels.is_empty() {
        bail!("{}: an image without pixels", path.display());
    }
    Ok(Stored {
        image,
        product: None,
        path,
    })
}

/// Whether a folder is of `subap velocity`, whose axes are no places.
fn is_velocity_plane(folder: &Path) -> bool {
    // What cannot be read is told by who reads it next.
    let record = fs::read(folder.join("image.json")).unwrap_or_default();
    let record: Value = serde_json::from_slice(&record).unwrap_or_default();
    record["schema"] == "subaperture-velocity-plane"
}

/// Refuses a file that is no array, such as a recording, with a word about what is wanted.
pub(super) fn check_is_array(path: &Path) -> anyhow::Result<()> {
    let mut start = [0; 6];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    // What cannot be opened is told by who reads it next; what is shorter is no array.
    if path.is_file() && !(read.is_ok() && &start == b"\x93NUMPY") {
        bail!(
            "{}: no image: give the folder of a product (with image.json and image.npy) or a complex64 array (.npy)",
            path.display()
        );
    }
    Ok(())
}

impl Stored {
    /// Refuses two products whose pixels are not the same places: their difference would say nothing.
    pub(super) fn check_same_grid(&self, other: &Self) -> anyhow::Result<()> {
        if let (Some((grid, _)), Some((others, _))) = (&self.product, &other.product)
            && grid != others
        {
            bail!(
                "{} and {} are on different grids: form both with one --grid",
                self.path.display(),
                other.path.display()
            );
        }
        Ok(())
    }
}

/// Refuses images that take, `times` over, more than the budget.
pub(super) fn check_memory<'a>(
    session: &Session,
    paths: impl IntoIterator<Item = &'a PathBuf>,
    times: u128,
    doing: &str,
) -> anyhow::Result<()> {
    // A file that cannot be asked for its size cannot be read either, and reading says why.
    let size = |path: &PathBuf| {
        let folder = product_folder(path);
        let file = folder.map_or_else(|| path.clone(), |folder| folder.join("image.npy"));
        fs::metadata(file).map_or(0, |about| u128::from(about.len()))
    };
    let paths: Vec<&PathBuf> = paths.into_iter().collect();
    let bytes = times * paths.iter().map(|path| size(path)).sum::<u128>();
    if bytes > u128::from(session.memory_bytes) {
        let names: Vec<String> = paths
            .iter()
            .map(|path| path.display().to_string())
            .collect();
        bail!(
            "{doing} {} needs {}; --memory allows {}: raise --memory, or take smaller images",
            names.join(" and "),
            text::bytes(bytes),
            text::bytes(session.memory_bytes.into())
        );
    }
    Ok(())
}
