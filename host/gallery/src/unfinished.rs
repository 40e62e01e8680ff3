//! Images of an unfinished item, so that an interrupted run continues with the first missing one.

use std::fs;
use std::path::{Path, PathBuf};

use subaperture_focus::ImageFormer;
use subaperture_io::atomic::WriteError;
use subaperture_io::npy;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::phase_history::Collection;
use subaperture_signal::window::Window;

/// Start and end of the names of images, hidden files.
const START: &str = ".subap-unfinished-";
const END: &str = ".npy";

/// File of the image that `former` makes of a collection with this window, by program version, settings and grid.
pub(crate) fn path(
    folder: &Path,
    collection: &Collection,
    grid: &ImageGrid,
    former: &dyn ImageFormer,
    window: Window,
) -> PathBuf {
    let key = format!(
        "{} {} {} {window:?} {} {} {} {grid:?}",
        env!("CARGO_PKG_VERSION"),
        former.name(),
        former.settings(),
        collection.name,
        collection.pulses.len(),
        collection.num_samples,
    );
    let crc = crc32fast::hash(key.as_bytes());
    folder.join(format!("{START}{crc:08x}{END}"))
}

/// Image of this file, if it has the grid's shape.
pub(crate) fn load(path: &Path, grid: &ImageGrid) -> Option<Image> {
    let image = npy::read(path).ok()?;
    let shape = [grid.rows.count, grid.columns.count];
    ([image.rows, image.columns] == shape).then_some(image)
}

/// Write an image, complete or not at all.
pub(crate) fn save(path: &Path, image: &Image) -> Result<(), WriteError> {
    npy::write(path, image)
}

/// Delete the images of a finished item.
pub(crate) fn clear(folder: &Path) {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    for name in entries.filter_map(|entry| entry.file_name().into_string().ok()) {
        if is_ours(&name) {
            // A file that remains is reused or replaced by a later run.
            let _ = fs::remove_file(folder.join(name));
        }
    }
}

fn is_ours(name: &str) -> bool {
    let crc = name.strip_prefix(START).and_then(|n| n.strip_suffix(END));
    crc.is_some_and(|crc| crc.len() == 8 && crc.bytes().all(|byte| byte.is_ascii_hexdigit()))
}
