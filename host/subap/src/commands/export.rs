//! `subap export`: an image in a format that other programs read.

mod maps;
mod sicd;
mod sidd;

use anyhow::bail;

use super::stored;
use crate::args::{Export, ImageFormat};
use crate::config::Session;
use crate::failure::Usage;
use maps::MapFormat;

/// Reads a product and writes it.
pub(crate) fn run(session: &Session, typed: &Export) -> anyhow::Result<()> {
    let Some(format) = typed.format.or_else(|| ImageFormat::of(&typed.out)) else {
        let what = format!(
            "{}: its ending names no format: give --format sicd, sidd, cog, kmz or png",
            typed.out.display()
        );
        return Err(Usage(what).into());
    };
    let Some(folder) = stored::product_folder(&typed.image) else {
        bail!(
            "{}: no image: give the folder of a product (with image.json and image.npy)",
            typed.image.display()
        );
    };
    match format {
        ImageFormat::Sicd => sicd::run(session, typed, folder),
        ImageFormat::Sidd => sidd::run(session, typed, folder),
        ImageFormat::Cog => maps::run(session, typed, MapFormat::Cog, folder),
        ImageFormat::Kmz => maps::run(session, typed, MapFormat::Kmz, folder),
        ImageFormat::Png => maps::run(session, typed, MapFormat::Png, folder),
    }
}
