//! List `files` in the JSON results of commands that write files.

use std::path::Path;

use serde::Serialize;
use subaperture::io::product;

/// File or folder that a command wrote, as listed in JSON results. Folders are Zarr stores.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct OutputFile {
    path: String,
    /// Content: `image`, `record`, `picture`, `phase history`, ...
    kind: &'static str,
}

impl OutputFile {
    pub(crate) fn new(path: &Path, kind: &'static str) -> Self {
        Self {
            path: path.display().to_string(),
            kind,
        }
    }

    /// Path as printed.
    pub(crate) fn path(&self) -> &str {
        &self.path
    }
}

/// Files of an image's folder; `image` is the name of the array or tile store.
pub(crate) fn of_image(folder: &Path, image: &str) -> Vec<OutputFile> {
    let [record, picture] = product::TILED_NAMES;
    let named = [(image, "image"), (record, "record"), (picture, "picture")];
    let files = named.map(|(name, kind)| OutputFile::new(&folder.join(name), kind));
    files.into()
}

/// Pictures in a folder.
pub(crate) fn pictures<N: AsRef<str>>(
    folder: &Path,
    names: impl IntoIterator<Item = N>,
) -> Vec<OutputFile> {
    let names = names.into_iter();
    let of = |name: N| OutputFile::new(&folder.join(name.as_ref()), "picture");
    names.map(of).collect()
}
