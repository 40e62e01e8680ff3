//! Export of one image: its task and its result.

use std::path::{Path, PathBuf};

use anyhow::bail;
use serde_json::{Value, json};
use subaperture::geometry::{Geodetic, ImageGrid};
use subaperture::images::{OpenImage, Pixels};
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::sicd::SicdVersion;

use crate::args::{ImageFormat, Mapping, Writing};
use crate::commands::stored;
use crate::config::Session;

/// Image to write: to a file of its own, or with others to one stack.
pub(super) struct One<'a> {
    /// Path as given by the user.
    pub(super) image: &'a Path,
    /// All images of its stack.
    pub(super) others: &'a [PathBuf],
    /// Folder of a product, or path of a SICD.
    pub(super) folder: &'a Path,
    pub(super) format: ImageFormat,
    pub(super) out: &'a Path,
    pub(super) place: Option<Geodetic>,
    pub(super) speed_m_s: Option<f64>,
    pub(super) sicd_version: Option<SicdVersion>,
    pub(super) maps: Mapping,
    pub(super) writing: Writing,
}

/// Result of writing one format.
pub(crate) struct Written {
    /// Schema of the JSON result.
    pub(super) name: &'static str,
    /// JSON result without its files.
    pub(super) about: Value,
    /// The output file, then its sidecars.
    pub(crate) files: Vec<WrittenFile>,
    /// Line printed for the user.
    pub(super) line: String,
}

impl Written {
    /// Output file in the image's own pixel grid.
    pub(super) fn file(one: &One, bytes: u64) -> Self {
        let file = one.file();
        Self {
            name: "export",
            about: json!({ "bytes": bytes }),
            line: file.path.display().to_string(),
            files: vec![file],
        }
    }
}

impl One<'_> {
    /// The output file with its kind.
    pub(super) fn file(&self) -> WrittenFile {
        let kind = match self.format {
            ImageFormat::Sicd => FileKind::Sicd,
            ImageFormat::Sidd => FileKind::Sidd,
            ImageFormat::Cog => FileKind::Cog,
            ImageFormat::Kmz => FileKind::Kmz,
            ImageFormat::Png => FileKind::Png,
            ImageFormat::Zarr => FileKind::Zarr,
        };
        WrittenFile::new(self.out, kind)
    }
}

/// Open an image whose tiles must all be formed.
pub(super) fn whole(session: &Session, path: &Path) -> anyhow::Result<OpenImage> {
    let image = stored::open(session, path)?;
    if let Pixels::Unfinished(tiles) = &image.pixels {
        let [formed, count] = tiles.tiles();
        bail!(
            "{}: {formed} of {count} tiles are formed: complete the image with subap focus before exporting it",
            path.display()
        );
    }
    Ok(image)
}

/// Grid and record of an image.
pub(super) fn recorded(one: &One, image: &OpenImage) -> anyhow::Result<(ImageGrid, Value)> {
    match (image.grid(), &image.record) {
        (Some((grid, _)), Some(record)) => Ok((grid.clone(), record.clone())),
        _ => bail!(
            "{}: expected a product of subap focus, found {}: --format {} needs the pixel positions and the viewing geometry from its record",
            one.image.display(),
            image.kind(),
            one.format.name()
        ),
    }
}
