//! `subap export`: write an image in other formats. Commands that form images use [`Products`] for the same formats.

mod maps;
mod one;
mod sicd;
mod sidd;
mod zarr;

use std::path::Path;

use anyhow::{Context, bail};
use serde_json::json;
use subaperture::geometry::{Geodetic, SceneFrame};
use subaperture::images::{ImageKind, OpenImage, PixelGeometry};
use subaperture::io::claim::OutputClaims;

use super::stored;
use crate::args::{Export, ImageFormat, Mapping, Writing};
use crate::config::Session;
use crate::failure::Usage;
use crate::text;
use maps::MapFormat;
use one::One;

pub(crate) use one::Written;
pub(super) use zarr::attributes as stack_attributes;

/// Read an image and write it in the requested format.
pub(crate) fn run(session: &Session, typed: &Export) -> anyhow::Result<()> {
    let Some(format) = typed.format.or_else(|| ImageFormat::of(&typed.out)) else {
        let fault = format!(
            "{}: no format has this extension: give --format sicd, sidd, cog, kmz, png or zarr",
            typed.out.display()
        );
        return Err(Usage(fault).into());
    };
    let [image, others @ ..] = typed.images.as_slice() else {
        return Err(Usage("expected at least one image".to_owned()).into());
    };
    if !others.is_empty() && format != ImageFormat::Zarr {
        let fault = format!(
            "--format {} takes one image, found {}: only --format zarr takes several",
            format.name(),
            typed.images.len()
        );
        return Err(Usage(fault).into());
    }
    if typed.sicd_version.is_some() && format != ImageFormat::Sicd {
        let fault = "--sicd-version applies to --format sicd: leave it out";
        return Err(Usage(fault.to_owned()).into());
    }
    let folder = stored::product_folder(image).unwrap_or(image);
    // The kind of the image decides which formats are possible; checked before outputs are claimed.
    check_format(typed, &stored::open_unread(session, image)?, format)?;
    let export = One {
        image,
        others,
        folder,
        format,
        out: &typed.out,
        place: typed.place,
        speed_m_s: typed.speed,
        sicd_version: typed.sicd_version,
        maps: typed.maps,
        writing: typed.writing,
    };
    export.check()?;
    let mut claims = session.claims(&typed.writing, &typed.images);
    export.claim(&mut claims)?;
    let written = export.write(session)?;
    if session.json() {
        let mut about = written.about;
        about["files"] = json!(written.files);
        return text::say_json(written.name, about);
    }
    if session.prints_text() {
        text::say(written.line)?;
    }
    Ok(())
}

/// Check that an image can be written in a format.
fn check_format(typed: &Export, image: &OpenImage, format: ImageFormat) -> anyhow::Result<()> {
    let path = image.path.display();
    let is_map = matches!(
        format,
        ImageFormat::Cog | ImageFormat::Kmz | ImageFormat::Png
    );
    let states_position = matches!(
        image.lies,
        PixelGeometry::Sicd { .. } | PixelGeometry::Map(_)
    ) || image.kind() == ImageKind::Sidd;
    if typed.place.is_some() && states_position {
        return Err(Usage(format!(
            "{path} states its own position on the Earth: leave --place out"
        ))
        .into());
    }
    match image.kind() {
        ImageKind::Product => Ok(()),
        _ if format == ImageFormat::Zarr => Ok(()),
        ImageKind::Sicd if is_map => Ok(()),
        ImageKind::Sicd => Err(Usage(format!(
            "{path} is a SICD: use --format cog, kmz, png or zarr; --format {} needs a product of subap focus",
            format.name()
        ))
        .into()),
        ImageKind::Zarr if image.looks().is_some() => Ok(()),
        kind => bail!(
            "{path}: found {kind}, which does not state its viewing geometry: use --format zarr; --format {} needs \
             a product of subap focus{}",
            format.name(),
            if is_map { " or a SICD" } else { "" }
        ),
    }
}

impl One<'_> {
    /// Check that the options apply to the format.
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

    /// Claim all output files.
    fn claim(&self, claims: &mut OutputClaims) -> anyhow::Result<()> {
        match self.format {
            ImageFormat::Sicd | ImageFormat::Sidd => sicd::claim(self, claims),
            ImageFormat::Cog | ImageFormat::Kmz | ImageFormat::Png => {
                maps::claim(self, MapFormat::of(self.format), claims)
            }
            ImageFormat::Zarr => zarr::claim(self, claims),
        }
    }

    /// Write all output files, complete or not at all.
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

/// Additional formats of an image formed in the same run, written to its folder under fixed names.
pub(crate) struct Products<'a> {
    /// Folder of the image.
    pub(crate) folder: &'a Path,
    pub(crate) formats: &'a [ImageFormat],
    /// Position of the scene's origin on the Earth, for recordings that do not state it.
    pub(crate) place: Option<Geodetic>,
    pub(crate) writing: Writing,
}

impl Products<'_> {
    /// Claim all files before the image is formed; `inputs` are the files read by the run. The claim lasts until the run ends.
    pub(crate) fn claim<P: AsRef<Path>>(
        &self,
        session: &Session,
        inputs: &[P],
    ) -> anyhow::Result<OutputClaims> {
        let mut claims = session.claims(&self.writing, inputs);
        for (n, &format) in self.formats.iter().enumerate() {
            if self.formats[..n].contains(&format) {
                let fault = format!("--product {}: given twice", format.name());
                return Err(Usage(fault).into());
            }
            self.with(format, |one| {
                one.check()?;
                one.claim(&mut claims)
            })?;
        }
        Ok(claims)
    }

    /// Check before forming that an image in this scene frame can be written in all formats.
    pub(crate) fn check_place(&self, frame: &SceneFrame) -> anyhow::Result<()> {
        if self.place.is_some() || !matches!(frame, SceneFrame::Local) {
            return Ok(());
        }
        match self.formats.iter().find(|format| format.is_of_the_earth()) {
            Some(format) => bail!(
                "--product {}: the recording does not state its position on the Earth: give the scene's origin with --place LAT,LON[,HEIGHT]",
                format.name()
            ),
            None => Ok(()),
        }
    }

    /// Write all formats of the complete image.
    pub(crate) fn write(&self, session: &Session) -> anyhow::Result<Vec<Written>> {
        let one = |&format: &ImageFormat| {
            self.with(format, |one| {
                one.write(session).with_context(|| {
                    format!(
                        "{} is written, but writing {} failed",
                        self.folder.display(),
                        format.name()
                    )
                })
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
            sicd_version: None,
            maps: Mapping::default(),
            writing: self.writing,
        })
    }
}
