//! `subap export`: write an image in formats of other programs. Commands that form images use [`Products`] for the same formats.

mod maps;
mod sicd;
mod sidd;
mod zarr;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use serde_json::{Value, json};
use subaperture::geometry::{Geodetic, ImageGrid, SceneFrame};
use subaperture::images::{ImageKind, OpenImage, PixelGeometry, Pixels};
use subaperture::io::claim::OutputClaims;

use super::stored;
use crate::args::{Export, ImageFormat, Mapping, Writing};
use crate::config::Session;
use crate::failure::Usage;
use crate::text;
use maps::MapFormat;

/// Reads a product and writes it.
pub(crate) fn run(session: &Session, typed: &Export) -> anyhow::Result<()> {
    let Some(format) = typed.format.or_else(|| ImageFormat::of(&typed.out)) else {
        let what = format!(
            "{}: its ending names no format: give --format sicd, sidd, cog, kmz, png or zarr",
            typed.out.display()
        );
        return Err(Usage(what).into());
    };
    let [image, others @ ..] = typed.images.as_slice() else {
        return Err(Usage("no image is named".to_owned()).into());
    };
    if !others.is_empty() && format != ImageFormat::Zarr {
        let what = format!(
            "--format {} is of one image, and {} are named: --format zarr takes several",
            format.name(),
            typed.images.len()
        );
        return Err(Usage(what).into());
    }
    let folder = stored::product_folder(image).unwrap_or(image);
    // What it is decides what it can be written as, before anything is claimed.
    check_format(typed, &stored::open_unread(session, image)?, format)?;
    let export = One {
        image,
        others,
        folder,
        format,
        out: &typed.out,
        place: typed.place,
        speed_m_s: typed.speed,
        maps: typed.maps,
        writing: typed.writing,
    };
    export.check()?;
    let mut claims = session.claims(&typed.writing, &typed.images);
    export.claim(&mut claims)?;
    let written = export.write(session)?;
    if session.json() {
        return text::say_json(written.name, written.about);
    }
    if session.tells() {
        text::say(written.line)?;
    }
    Ok(())
}

/// Opens an image whose pixels are all there.
fn whole(session: &Session, path: &Path) -> anyhow::Result<OpenImage> {
    let image = stored::open(session, path)?;
    if let Pixels::Unfinished(tiles) = &image.pixels {
        let [formed, count] = tiles.tiles();
        bail!(
            "{}: {formed} of its {count} tiles are formed: export it once subap focus has formed them all",
            path.display()
        );
    }
    Ok(image)
}

/// The grid and the record of an image.
fn recorded(one: &One, image: &OpenImage) -> anyhow::Result<(ImageGrid, Value)> {
    match (image.grid(), &image.record) {
        (Some((grid, _)), Some(record)) => Ok((grid.clone(), record.clone())),
        _ => bail!(
            "{}: it is an image of the kind {}, whose record does not say what --format {} needs: where pixels are and from where they were seen",
            one.image.display(),
            image.kind(),
            one.format.name()
        ),
    }
}

/// Refuses a format that the image cannot be written as.
fn check_format(typed: &Export, image: &OpenImage, format: ImageFormat) -> anyhow::Result<()> {
    let path = image.path.display();
    let is_map = matches!(
        format,
        ImageFormat::Cog | ImageFormat::Kmz | ImageFormat::Png
    );
    let says_its_place = matches!(
        image.lies,
        PixelGeometry::Sicd { .. } | PixelGeometry::Map(_)
    ) || image.kind() == ImageKind::Sidd;
    if typed.place.is_some() && says_its_place {
        return Err(Usage(format!(
            "{path} says itself where on the Earth it is: leave --place out"
        ))
        .into());
    }
    match image.kind() {
        ImageKind::Product => Ok(()),
        _ if format == ImageFormat::Zarr => Ok(()),
        ImageKind::Sicd if is_map => Ok(()),
        ImageKind::Sicd => Err(Usage(format!(
            "{path} is a SICD, of which maps are made (--format cog, kmz or png) and stacks (zarr): --format {} is of images that subap formed",
            format.name()
        ))
        .into()),
        ImageKind::Zarr if image.looks().is_some() => Ok(()),
        kind => bail!(
            "{path} is an image of the kind {kind}, which does not say from where its pixels were seen: --format zarr takes it, and --format {} is of \
             products of subap focus{}",
            format.name(),
            if is_map { " and of SICDs" } else { "" }
        ),
    }
}

/// An image as one file, or with others as one stack.
struct One<'a> {
    /// As the user calls it.
    image: &'a Path,
    /// Those of its stack.
    others: &'a [PathBuf],
    /// Where it lies: a product's folder, or a SICD's file.
    folder: &'a Path,
    format: ImageFormat,
    out: &'a Path,
    place: Option<Geodetic>,
    speed_m_s: Option<f64>,
    maps: Mapping,
    writing: Writing,
}

/// Result of writing one format.
struct Written {
    /// Key in the JSON record.
    name: &'static str,
    about: Value,
    /// Line printed for the user.
    line: String,
}

impl Written {
    /// A file of the image's own pixels.
    fn file(out: &Path, bytes: u64) -> Self {
        let path = out.display().to_string();
        Self {
            name: "export",
            about: json!({ "path": path, "bytes": bytes }),
            line: path,
        }
    }
}

impl One<'_> {
    /// Refuses options that are not of the format.
    fn check(&self) -> Result<(), Usage> {
        match self.format {
            ImageFormat::Sicd => sicd::check(self),
            ImageFormat::Sidd => sidd::check(self),
            ImageFormat::Cog | ImageFormat::Kmz | ImageFormat::Png => {
                maps::check(self, MapFormat::of(self.format))
            }
            ImageFormat::Zarr => zarr::check(self),
        }
    }

    /// Claims all that is going to be written.
    fn claim(&self, claims: &mut OutputClaims) -> anyhow::Result<()> {
        match self.format {
            ImageFormat::Sicd | ImageFormat::Sidd => sicd::claim(self, claims),
            ImageFormat::Cog | ImageFormat::Kmz | ImageFormat::Png => {
                maps::claim(self, MapFormat::of(self.format), claims)
            }
            ImageFormat::Zarr => zarr::claim(self, claims),
        }
    }

    /// Writes it, complete or not at all.
    fn write(&self, session: &Session) -> anyhow::Result<Written> {
        match self.format {
            ImageFormat::Sicd => sicd::write(session, self),
            ImageFormat::Sidd => sidd::write(session, self),
            ImageFormat::Cog | ImageFormat::Kmz | ImageFormat::Png => {
                maps::write(session, self, MapFormat::of(self.format))
            }
            ImageFormat::Zarr => zarr::write(session, self),
        }
    }
}

/// Formats of an image that is formed by the same run, written into its folder each under a name of its own.
pub(crate) struct Products<'a> {
    /// Folder of the image.
    pub(crate) folder: &'a Path,
    pub(crate) formats: &'a [ImageFormat],
    /// Where on the Earth the scene's origin is, where the recording does not say.
    pub(crate) place: Option<Geodetic>,
    pub(crate) writing: Writing,
}

impl Products<'_> {
    /// Claims all files, before there is an image; `inputs` are what the run reads. Held until the run's end.
    pub(crate) fn claim<P: AsRef<Path>>(
        &self,
        session: &Session,
        inputs: &[P],
    ) -> anyhow::Result<OutputClaims> {
        let mut claims = session.claims(&self.writing, inputs);
        for (n, &format) in self.formats.iter().enumerate() {
            if self.formats[..n].contains(&format) {
                let what = format!("--product {}: it is named twice", format.name());
                return Err(Usage(what).into());
            }
            self.with(format, |one| {
                one.check()?;
                one.claim(&mut claims)
            })?;
        }
        Ok(claims)
    }

    /// Refuses what the image of a scene in this frame cannot be written as, before it is formed.
    pub(crate) fn check_place(&self, frame: &SceneFrame) -> anyhow::Result<()> {
        if self.place.is_some() || !matches!(frame, SceneFrame::Local) {
            return Ok(());
        }
        match self.formats.iter().find(|format| format.is_of_the_earth()) {
            Some(format) => bail!(
                "--product {}: the recording ties its scene to no place on the Earth: give --place LAT,LON[,HEIGHT] of the scene's origin",
                format.name()
            ),
            None => Ok(()),
        }
    }

    /// Writes all of them of the image that is there now; their paths.
    pub(crate) fn write(&self, session: &Session) -> anyhow::Result<Vec<PathBuf>> {
        let one = |&format: &ImageFormat| {
            self.with(format, |one| {
                one.write(session).with_context(|| {
                    format!(
                        "{} is there, but not its {}",
                        self.folder.display(),
                        format.name()
                    )
                })?;
                Ok(one.out.to_owned())
            })
        };
        self.formats.iter().map(one).collect()
    }

    /// Call a function with the export of one format.
    fn with<T>(
        &self,
        format: ImageFormat,
        work: impl FnOnce(&One) -> anyhow::Result<T>,
    ) -> anyhow::Result<T> {
        work(&One {
            image: self.folder,
            others: &[],
            folder: self.folder,
            format,
            out: &self.folder.join(format.file_name()),
            place: self.place,
            speed_m_s: None,
            maps: Mapping::default(),
            writing: self.writing,
        })
    }
}
