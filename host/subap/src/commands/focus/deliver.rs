//! Writing of a complete image with its record and picture, and the summary printed for it.

use std::path::{Path, PathBuf};

use serde_json::Value;
use subaperture::image::{Image, ImageSource};
use subaperture::io::product::{self, CompleteProduct, Product, TiledProduct};
use subaperture::io::tiles::{self, TileStore};
use subaperture::plot::{self, Panel, Source};

use super::record::Record;
use crate::args::Focus;
use crate::config::Session;
use crate::{interrupt, text};

/// Pixels of a complete image.
pub(super) enum Whole<'a> {
    Memory(&'a Image),
    Array(Box<CompleteProduct>),
    Tiles(&'a TileStore),
}

impl Whole<'_> {
    pub(super) fn parts(&self) -> &dyn ImageSource {
        match self {
            Self::Memory(image) => *image,
            Self::Array(grown) => &**grown,
            Self::Tiles(store) => *store,
        }
    }

    fn source(&self) -> Source<'_> {
        match self {
            Self::Memory(image) => Source::Whole(image),
            parts => Source::ImageSource(parts.parts()),
        }
    }
}

impl Whole<'_> {
    /// Write the record and picture of the image. Returns the record.
    fn write_metadata(
        self,
        out: &Path,
        mut metadata: Value,
        quicklook: &[u8],
    ) -> anyhow::Result<Value> {
        match self {
            Self::Memory(image) => Product {
                image,
                metadata: &metadata,
                quicklook,
            }
            .write(out)?,
            Self::Array(grown) => grown.write(&metadata, quicklook)?,
            Self::Tiles(store) => {
                metadata["image"]["file"] = tiles::NAME.into();
                TiledProduct {
                    store,
                    metadata: &metadata,
                    quicklook,
                }
                .write(out)?;
            }
        }
        Ok(metadata)
    }
}

/// Write the output folder and report it.
pub(super) fn deliver(
    session: &Session,
    typed: &Focus,
    image: Whole,
    record: &Record,
    title: &str,
) -> anyhow::Result<()> {
    interrupt::check()?;
    let writing = session.progress("writing");
    let panel = Panel {
        scale: typed.look.scale(),
        colours: typed.look.colours(),
        orientation: record.orientation,
        ..Panel::new(image.source(), record.grid, title)
    };
    let draw = || {
        Ok(plot::quicklook_within(
            &panel,
            session.memory.picture_bytes,
        )?)
    };
    let out = &typed.out;
    let metadata = if let Whole::Memory(image) = &image {
        product::write_drawing::<anyhow::Error>(out, image, || record.to_json(title), draw)?
    } else {
        let quicklook = &draw()?;
        image.write_metadata(out, record.to_json(title), quicklook)?
    };
    writing.finish();
    let products = super::products(typed).write(session)?;
    report(session, typed, record, metadata, &products)
}

/// Report the output in a few lines.
fn report(
    session: &Session,
    typed: &Focus,
    record: &Record,
    mut metadata: Value,
    products: &[PathBuf],
) -> anyhow::Result<()> {
    if session.json() {
        metadata["folder"] = typed.out.display().to_string().into();
        if !products.is_empty() {
            let paths = products.iter().map(|path| path.display().to_string());
            metadata["products"] = paths.collect::<Vec<_>>().into();
        }
        return text::say_json("image", metadata);
    }
    if !session.tells() {
        return Ok(());
    }
    text::say(format!(
        "{}: {} x {} pixels in {}",
        typed.out.display(),
        record.grid.columns.count,
        record.grid.rows.count,
        text::duration(record.taken)
    ))?;
    text::say(match record.peak {
        Some(peak) => {
            let [x, y, z] = peak.position_m;
            let level_db = peak.level_db;
            format!(
                "brightest point at x {x:.3} m, y {y:.3} m, z {z:.3} m: {}",
                text::decibels(level_db)
            )
        }
        None => "no brightest point: the image is zero".to_owned(),
    })?;
    for path in products {
        text::say(path.display().to_string())?;
    }
    Ok(())
}
